"""The results of this checkout, brought up to date, and builds in copies of the project."""

from __future__ import annotations

import copy
import fcntl
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.documents import read_yaml
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
from reobserve_papers.steps.freshness import states
from tests import ROOT, project_copy
from tests.forks import Forks, forking

# Results of a default build: all papers, their figures and tables. An evaluation is made once for
# all tests of a process.
CONFIG = read_yaml(ROOT / "config" / "config.yaml")
PAPERS = known_papers(ROOT)
PARAMETER_FILES = {paper: Parameters.load(ROOT, paper, seed=CONFIG["seed"]) for paper in PAPERS}
EVALUATORS = {paper: Evaluator(parameters) for paper, parameters in PARAMETER_FILES.items()}
FIGURES = [(paper, figure) for paper in PAPERS for figure in PARAMETER_FILES[paper].tree["figures"]]
TABLES = [
    (paper, table) for paper in PAPERS for table in PARAMETER_FILES[paper].tree.get("tables", {})
]


# For the most expensive studies, only these levels are built; each gives golden numbers of its own.
# A constant that changes the omitted levels changes these too, at a fraction of the time.
FEW_LEVELS: dict[str, dict[str, Any]] = {
    "tradeoff": {"rhos": [5.0]},
    "ensemble": {"orders": [2]},
}


def with_few_levels(parameters: Parameters) -> Parameters:
    tree = copy.deepcopy(parameters.tree)
    for study in FEW_LEVELS.keys() & tree.get("studies", {}).keys():
        for name, levels in FEW_LEVELS[study].items():
            tree["studies"][study][name]["value"] = levels
    return Parameters(parameters.paper, tree, parameters.seed)


# What Snakemake imports before it reads a workflow takes longer than a dry run.
IMPORTED = "import snakemake.cli, snakemake.report.html_reporter, snakemake.storage"
DRY_RUN = """
import sys
sys.argv = {words!r}
sys.path.insert(0, {source!r})
from snakemake.cli import main
sys.exit(main())
"""


@cache
def snakemakes() -> Forks:
    """Processes that have imported Snakemake, and nothing of this project."""
    return forking(IMPORTED, {**os.environ, "PYTHONDONTWRITEBYTECODE": ""})


@dataclass(frozen=True)
class Project:
    """A copy of the project whose own ``src`` is used in it."""

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        """The environment variables for commands in the copy."""
        return project_copy.copy_environment(self.folder)

    def run(
        self,
        *command: str,
        check: bool = True,
        given: str | None = None,
        environment: dict[str, str] | None = None,
    ) -> subprocess.CompletedProcess[str]:
        """Run a command in the copy with this input, and capture its output."""
        done = subprocess.run(
            command, cwd=self.folder, env=environment or self.environment, capture_output=True,
            text=True, check=False, input=given,
        )  # fmt: skip
        assert done.returncode == 0 or not check, done.stdout + done.stderr
        return done

    def snakemake(
        self, *arguments: str, check: bool = True, environment: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run Snakemake in the copy; without jobs, in a process that has imported it already."""
        command = ["snakemake", "--cores", "2", *arguments]
        if "--dry-run" not in arguments:
            return self.run(*command, check=check, environment=environment)
        program = DRY_RUN.format(words=command, source=str(self.folder / "src"))
        done = snakemakes().run(self.folder, program, **(environment or self.environment))
        assert done.returncode == 0 or not check, done.stdout + done.stderr
        return done

    def stale(self, *arguments: str, config: Sequence[str] = ()) -> dict[str, int]:
        """The number of jobs per rule that a build would run now, with these ``--config`` pairs."""
        pairs = ("--config", *config) if config else ()
        output = self.snakemake("--dry-run", *arguments, *pairs).stdout
        table = re.search(r"Job stats:\n(.*?)\ntotal", output, re.DOTALL)
        rows = table[1].splitlines()[2:] if table else []
        jobs = {row.split()[0]: int(row.split()[1]) for row in rows}
        return {rule: number for rule, number in jobs.items() if rule not in ("all", "figures")}

    def results(self) -> dict[str, bytes]:
        """The content of all results, by path."""
        built = self.folder / "results"
        return {
            str(path.relative_to(built)): path.read_bytes()
            for path in sorted(built.rglob("*"))
            if path.is_file() and path.name != "README.md"
        }


def copy_project(target: Path) -> Project:
    """A copy of what git tracks or would track."""
    project_copy.copy_project(ROOT, target)
    return Project(target)


def copy_toy(target: Path) -> Project:
    """The same with `toy` as the only paper: it has every stage, and a package of its own."""
    toy, project = Path(__file__).parent / "toy", copy_project(target)
    shutil.copytree(toy / "toy", target / "src/toy_paper")
    shutil.copy(toy / "toy.yaml", target / "config/papers")
    (target / "workflow/report/toy").mkdir()
    shutil.copy(toy / "fig1.rst", target / "workflow/report/toy")
    shutil.copy(toy / "claims.yaml", target / "config/claims/toy.yaml")
    shutil.copy(toy / "errata.yaml", target / "config/errata/toy.yaml")
    config = "papers: [toy]\nbench: [torque]\nformats: [svg]\nseed: 1\n"
    config += "samples: 40\ncached: true\n"
    (target / "config/config.yaml").write_text(config)
    return project


def shared_folder(
    factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]
) -> Project:
    """A folder that the first process that needs it makes for all of them."""
    shared = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    folder, made = shared / name, shared / f"{name}.made"
    with (shared / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not made.exists():
            make(folder)
            made.touch()
    return Project(folder)


def built_by(*asked: str) -> Callable[[Path], object]:
    """A function that copies the project into a folder and builds there what is asked for."""
    return lambda folder: copy_project(folder).snakemake(*asked)


# Keys of `config.yaml` on which accepted numbers, figures or verdicts depend.
DEFAULTS = {"style": "default", "notes": True, "seed": 20070501, "samples": 40, "cached": True}


def limits(config: Mapping[str, Any]) -> str:
    """Why a build with this `config.yaml` has not all results that tests compare, or nothing."""
    if "papers" in config:
        return f"it builds {', '.join(config['papers'])} only: remove `papers`"
    if changed := [paper for paper in PAPERS if paper in config]:
        return f"it changes parameters of {', '.join(changed)}: remove these keys"
    if changed := [key for key, value in DEFAULTS.items() if config[key] != value]:
        return f"{changed[0]} is {config[changed[0]]!r}, must be {DEFAULTS[changed[0]]!r}"
    if missing := [kind for kind in ("pdf", "svg", "png") if kind not in config["formats"]]:
        return f"it builds no {', '.join(missing)}: add to `formats`"
    return ""


def take_results(checkout: Path, folder: Path) -> None:
    """Bring the results of a checkout up to date, and copy them with Snakemake's records of them.

    Tests need these results whole: what hinders that fails in a sentence.
    """
    if why := limits(read_yaml(checkout / "config/config.yaml")):
        pytest.fail(f"config/config.yaml: {why}; tests compare all results", pytrace=False)
    done = Project(checkout).snakemake(check=False)
    if "cannot be locked" in done.stderr:
        pytest.fail(
            "the folder is locked: another build runs, wait for it; or one was killed: make unlock",
            pytrace=False,
        )
    if done.returncode:
        pytest.fail(f"the build failed, see `make`:\n{done.stderr[-2000:]}", pytrace=False)
    made = states(checkout)
    odd = {path.relative_to(checkout).as_posix(): why for path, why in made.items() if why}
    if odd:
        first, why = next(iter(odd.items()))
        rest = f" and {len(odd) - 1} more" if len(odd) > 1 else ""
        pytest.fail(f"{first}{rest}: {why}; remove them and `make` again", pytrace=False)
    parameters = (checkout / f"results/{paper}/parameters.json" for paper in PAPERS)
    for path in (*made, *parameters):
        copied = folder / path.relative_to(checkout)
        copied.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, copied)
    for name in (".snakemake/metadata", "logs"):
        shutil.copytree(checkout / name, folder / name)


@pytest.fixture(scope="session")
def as_built(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The results of this checkout, up to date, and nothing else. For reading only."""
    return shared_folder(tmp_path_factory, "results", lambda folder: take_results(ROOT, folder))


@pytest.fixture(scope="session")
def built(as_built: Project, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy of the project with these results; tests must restore what they change.

    Tests in the same process may run jobs in it; tests in other processes compare with `as_built`.
    """

    def make(folder: Path) -> None:
        copy_project(folder)
        shutil.copytree(as_built.folder, folder, dirs_exist_ok=True)

    return shared_folder(tmp_path_factory, "built", make)


@pytest.fixture(scope="session")
def built_bench(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Another copy, with the bench: in `built` it would make the report stale. For reading only."""
    return shared_folder(tmp_path_factory, "built_bench", built_by("bench"))


# What `compared` needs of a build, in the format in which figures are compared.
COMPARED = (
    "figures",
    *(f"results/{paper}/theory.metrics.csv" for paper in PAPERS
      if "theory" in PARAMETER_FILES[paper].tree),
    "--config", "formats=[png]",
)  # fmt: skip


@pytest.fixture(scope="session")
def compared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """What is compared with golden numbers and accepted figures: `as_built`, or a build apart.

    With `--build-apart` this process has the settings of another processor than the checkout's
    results.
    """
    if request.config.getoption("build_apart"):
        return shared_folder(tmp_path_factory, "compared", built_by(*COMPARED))
    whole: Project = request.getfixturevalue("as_built")
    return whole


@pytest.fixture(scope="session")
def evaluators(as_built: Project) -> dict[str, Evaluator]:
    """`EVALUATORS`, which take the rows of the most expensive studies from the build."""
    for paper, evaluator in EVALUATORS.items():
        for study in FEW_LEVELS.keys() & PARAMETER_FILES[paper].tree.get("studies", {}).keys():
            table = as_built.folder / "results" / paper / f"{study}.study.csv"
            evaluator.take_study(study, table)
    return EVALUATORS


@pytest.fixture
def fresh(tmp_path: Path) -> Project:
    """A separate copy with nothing built."""
    return copy_project(tmp_path)

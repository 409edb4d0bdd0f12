"""Builds in copies of the project: user commands, run outside this checkout."""

from __future__ import annotations

import copy
import fcntl
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.documents import read_yaml
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
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


# Samples give verdicts, which are compared every night; a build in a test needs only one, and no
# search for reversals, which takes longer than all figures.
FEW_SAMPLES = ("samples=1", "cached=false")


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
    config += "samples: 40\nchunks: 1\ncached: true\n"
    (target / "config/config.yaml").write_text(config)
    return project


def build_once(factory: pytest.TempPathFactory, name: str, *asked: str) -> Project:
    """A copy in a folder ``name``, built by the first process that needs it for all of them."""
    shared = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    folder, whole = shared / name, shared / f"{name}.whole"
    with (shared / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not whole.exists():
            copy = copy_project(folder)
            # The package of this checkout, whose compiled kernels the unit tests share.
            environment = project_copy.copy_environment(ROOT)
            copy.snakemake(*asked, environment=environment)
            shutil.copytree(folder / "results", whole / "results")
    return Project(folder)


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy with all papers built on two cores; tests must restore what they change.

    Each claim has a single sample, see `FEW_SAMPLES`. Tests in the same process may run jobs in
    it; tests in other processes compare with `as_built`.
    """
    return build_once(tmp_path_factory, "built", "--config", *FEW_SAMPLES)


@pytest.fixture(scope="session")
def built_bench(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Another copy, with the bench: in `built` it would make the report stale. For reading only."""
    return build_once(tmp_path_factory, "built_bench", "bench")


@pytest.fixture(scope="session")
def as_built(built: Project) -> Project:
    """The results of `built` right after its build, and nothing else."""
    return Project(built.folder.with_name("built.whole"))


# What `compared` needs of a build, in the format in which figures are compared.
COMPARED = (
    "figures",
    *(f"results/{paper}/theory.metrics.csv" for paper in PAPERS
      if "theory" in PARAMETER_FILES[paper].tree),
    "--config", "formats=[png]",
)  # fmt: skip


@pytest.fixture(scope="session")
def compared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """What is compared with golden numbers and accepted figures: of `as_built`, if a test takes it.

    On another processor none does: then neither claims nor other formats are built.
    """
    names = [set(getattr(item, "fixturenames", ())) for item in request.session.items]
    if any({"built", "as_built"} & taken for taken in names):
        whole: Project = request.getfixturevalue("as_built")
        return whole
    return build_once(tmp_path_factory, "compared", *COMPARED)


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

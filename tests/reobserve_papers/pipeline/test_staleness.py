"""An edit makes exactly its dependents stale; touching a file makes nothing stale."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

from reobserve.core.documents import parse_yaml
from reobserve.core.import_closure import import_closure
from reobserve_papers.parameters.step_kinds import KINDS
from reobserve_papers.steps.chain import reads
from reobserve_papers.steps.provenance import stage_modules

from .conftest import CONFIG, PAPERS, PARAMETER_FILES, Project, take_results

# Stages that a paper has if its parameter file has the section.
OPTIONAL = {"design": "designs", "study": "studies", "table": "tables", "theory": "theory"}
ALWAYS = {"plant", "observe", "metrics", "plot"}
ALL_STAGES = ALWAYS | set(OPTIONAL)
# One quick study; all import the same modules.
STUDIES = {
    "delay": "tuning",
    "eso": "designs",
    "ilo": "matching",
    "imm": "changes",
    "lie": "orders",
}
ALL = {"plant": 4, "observe": 14, "study": 1, "metrics": 6, "plot": 6}
FROM_OBSERVE = {"observe": 14, "study": 1, "metrics": 6, "plot": 6}


@contextmanager
def edited(path: Path, old: str = "", new: str = "# edited\n") -> Iterator[None]:
    """Replace ``old`` by ``new`` in a file (append if ``old`` is empty)."""
    before, status = path.read_bytes(), path.stat()
    text = before.decode()
    assert old in text
    path.write_text(text.replace(old, new, 1) if old else text + new, encoding="utf-8")
    try:
        yield
    finally:
        path.write_bytes(before)
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


# The module, and the jobs of `ilo` that its edit makes stale: its own stage and later ones.
EDITS = {
    "reobserve_papers/papers/ilo/metrics.py": {"metrics": 6, "plot": 6},
    "reobserve_papers/cli/stages/parameters.py": {},
}
MORE_EDITS = {
    "reobserve_papers/plants/satellite.py": ALL,
    "reobserve_papers/papers/ilo/plant.py": ALL,
    "reobserve/systems/rigid_body.py": ALL,  # imported indirectly by plant and observers
    "reobserve_papers/papers/ilo/observe.py": FROM_OBSERVE,
    "reobserve_papers/steps/build_job.py": ALL,
    "reobserve_papers/papers/ilo/study.py": {"study": 1, "metrics": 1, "plot": 1},
    "reobserve_papers/papers/ilo/study_rows.py": {"study": 1, "metrics": 6, "plot": 6},
    "reobserve/synthesis/ilo_accuracy.py": {"metrics": 6, "plot": 6},  # by way of the prediction
    "reobserve_papers/papers/ilo/plot.py": {"plot": 6},
    "reobserve_papers/plotting/figures.py": {"plot": 6},
    "reobserve_papers/plotting/captions.py": {"plot": 6},
    "reobserve_papers/golden/comparison.py": {},
    "reobserve_papers/parameters/overview.py": {},
    "reobserve_papers/report/logs.py": {},
    "reobserve_papers/parameters/prepare.py": {},
}


@pytest.mark.parametrize(
    ("module", "expected"),
    [
        *EDITS.items(),
        *(pytest.param(*edit, marks=pytest.mark.nightly) for edit in MORE_EDITS.items()),
    ],
)
def test_edit_makes_its_stage_and_later_stages_stale(
    built: Project, module: str, expected: dict[str, int]
) -> None:
    # Other papers depend on common modules, and not on those of `ilo`.
    shared = "/ilo" not in module
    with edited(built.folder / "src" / module):
        stale = built.stale("figures", config=["papers=[ilo]"] if shared else [])
    assert stale == expected


def test_touching_a_file_makes_nothing_stale(built: Project) -> None:
    for path in (built.folder / "src").rglob("*.py"):
        path.touch()
    for path in (built.folder / "config").rglob("*.yaml"):
        path.touch()
    assert built.stale() == {}


@pytest.mark.nightly
def test_new_package_version_makes_dependent_jobs_stale(built: Project) -> None:
    """Everything that computes or plots; by metadata found before those of the real package."""
    about = built.folder / "src/numpy-0.1.dist-info"
    about.mkdir()
    try:
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 0.1\n")
        stale = built.stale("figures", config=["papers=[ilo]"])
    finally:
        shutil.rmtree(about)
    assert stale == ALL
    assert built.stale("figures", config=["papers=[ilo]"]) == {}


@pytest.mark.nightly
@pytest.mark.parametrize(
    "override",
    [
        "ilo={figures: {fig2: {observers: [sampled]}}}",
        "ilo={figures: {fig2: {scenario: constant}}}",
        "eso={observers: {pi: {design: pi_optimal}}}",
    ],
)
def test_samples_are_stale_after_changes_of_figures_and_observers(
    built: Project, override: str
) -> None:
    stale = built.stale(config=[override])
    assert stale["robustness"] == stale["sensitivity"] == 1


def test_changed_value_makes_only_its_dependents_stale(built: Project) -> None:
    """The gain of one observer: its runs, the study and their figures, no plant and not Fig. 4."""
    gain = "ilo={observers: {forgetting: {K2: 1900}}}"
    label = "ilo={observers: {forgetting: {label: another name}}}"
    observe = {"observe": 4, "study": 1, "metrics": 5, "plot": 5}
    assert built.stale("figures", config=[gain]) == observe
    assert built.stale("figures", config=[label]) == {"plot": 5}


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("section", "name"), [("scenarios", "constant"), ("studies", "matching"), ("figures", "fig1")]
)
def test_changed_title_makes_only_the_plot_stale(built: Project, section: str, name: str) -> None:
    title = f"ilo={{{section}: {{{name}: {{title: another title}}}}}}"
    assert built.stale("figures", config=[title]) == {"plot": 1}


@pytest.mark.nightly
def test_changed_caption_makes_its_plot_stale(built: Project) -> None:
    with edited(built.folder / "workflow/report/ilo/fig2.rst"):
        assert built.stale() == {"plot": 1, **REPORTED}


# Jobs made stale by the wording of a claim, and by its checks.
REPORTED = {"report": 1, "verdicts": 1}
REDECIDED = {"alternatives": 1, "sensitivity": 1, "claims": 1, **REPORTED}
DECIDED = {"robustness": 1, **REDECIDED}
EACH = dict.fromkeys(("robustness", "alternatives", "sensitivity"), len(PAPERS))
ALL_DECIDED = DECIDED | EACH


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("file", "old", "new", "stale"),
    [
        (
            "config/claims/ilo.yaml",
            "    statement: ",
            "    statement: In short, ",
            REDECIDED,
        ),
        ("config/claims/ilo.yaml", "round_gain, below: 1", "round_gain, below: 2", DECIDED),
        ("config/errata/ilo.yaml", "    why: ", "    why: In short, ", REPORTED),
        ("src/reobserve_papers/report/render.py", "", "# edited\n", REPORTED),
        (
            "src/reobserve_papers/claims/verdict_rules.py",
            "",
            "# edited\n",
            ALL_DECIDED,
        ),
        (
            "src/reobserve_papers/cli/stages/robustness.py",
            "",
            "# edited\n",
            ALL_DECIDED,
        ),
        ("src/reobserve_papers/papers/eso/theory.py", "", "# edited\n", {"theory": 1, **DECIDED}),
    ],
)
def test_evidence_is_stale_after_its_inputs_change(
    built: Project, file: str, old: str, new: str, stale: dict[str, int]
) -> None:
    with edited(built.folder / file, old, new):
        assert built.stale() == stale


def test_bench_renews_the_report_and_is_built_by_its_own_target_only(built: Project) -> None:
    """Whatever is edited; here a table of a task stands for the bench."""
    module = built.folder / "src/reobserve_papers/bench/tasks/torque.py"
    table = built.folder / "results/bench/torque/table.csv"
    table.parent.mkdir(parents=True)
    try:
        table.write_text("condition,method\n")
        with edited(module):
            assert built.stale() == REPORTED
    finally:
        shutil.rmtree(table.parents[1])
    with edited(module):
        assert built.stale() == {}


@pytest.mark.nightly
def test_changed_search_result_makes_its_dependents_stale(fresh: Project) -> None:
    """By file times alone, so that nothing need be built."""
    found = "config/searches/imm_calibrated.json"
    studies = {
        name: body["scenario"]
        for name, body in PARAMETER_FILES["imm"].tree["studies"].items()
        if any(isinstance(entry, dict) and entry["value"] == found for entry in body.values())
    }
    assert studies
    for name, scenario in studies.items():
        target = fresh.folder / f"results/imm/{name}.study.csv"
        plant = target.parent / scenario / "plant.parquet"
        plant.parent.mkdir(parents=True)
        now = time.time_ns()
        for path, age in ((fresh.folder / found, 3), (plant, 2), (target, 1)):
            path.touch()
            os.utime(path, ns=(now - age * 10**9,) * 2)
        ask = (f"results/imm/{name}.study.csv", "--rerun-triggers", "mtime")
        assert fresh.stale(*ask) == {}
        (fresh.folder / found).touch()
        assert fresh.stale(*ask) == {"study": 1}


@pytest.mark.nightly
def test_build_runs_only_stale_jobs(fresh: Project) -> None:
    figure = "results/ilo/fig1.svg"
    fresh.snakemake(figure)
    before = {path: path.stat().st_mtime_ns for path in (fresh.folder / "results").rglob("*.*")}
    with edited(fresh.folder / "src/reobserve_papers/papers/ilo/metrics.py"):
        fresh.snakemake(figure)
    changed = {path.name for path, stamp in before.items() if path.stat().st_mtime_ns != stamp}
    assert changed == {
        "fig1.metrics.csv", "fig1.svg", "fig1.pdf", "fig1.png", "fig1.caption.rst",
    }  # fmt: skip


@pytest.mark.nightly
def test_edited_kernel_is_not_loaded_from_an_old_cache(fresh: Project) -> None:
    """Machine code is cached on disk; the matrix product is inlined into other kernels."""
    target = "results/ilo/constant/plant.parquet"
    fresh.snakemake(target)
    before = fresh.results()["ilo/constant/plant.parquet"]
    source = fresh.folder / "src/reobserve/systems/rigid_body_arithmetic.py"
    with edited(source, "torque[0] - (y * hz - z * hy)", "torque[0] + (y * hz - z * hy)"):
        fresh.snakemake(target)
        series = json.loads(
            fresh.run(
                "python", "-c",
                "import json; from reobserve_papers.signals.series import Series; "
                f"print(json.dumps(Series.read('{target}')['rate'][-1].tolist()))",
            ).stdout
        )  # fmt: skip
    fresh.snakemake(target)
    assert fresh.results()["ilo/constant/plant.parquet"] == before
    again = fresh.run(
        "python", "-c",
        "import json; from reobserve_papers.signals.series import Series; "
        f"print(json.dumps(Series.read('{target}')['rate'][-1].tolist()))",
    ).stdout  # fmt: skip
    assert abs(series[0] - json.loads(again)[0]) > 1e-6


@pytest.mark.parametrize(
    ("key", "text", "said"),
    [
        ("papers", "[ilo]", "it builds ilo only: remove `papers`"),
        ("ilo", "{}", "it changes parameters of ilo: remove these keys"),
        ("formats", "[svg, pdf]", "it builds no png: add to `formats`"),
        ("seed", "7", "seed is 7, must be 20070501"),
        ("style", "slides", "style is 'slides', must be 'default'"),
    ],
)
def test_config_that_leaves_out_results_is_refused(
    tmp_path: Path, key: str, text: str, said: str
) -> None:
    (tmp_path / "config").mkdir()
    config = CONFIG | {key: parse_yaml(text, "")}
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(config))
    with pytest.raises(pytest.fail.Exception, match=re.escape(f"config/config.yaml: {said}; ")):
        take_results(tmp_path, tmp_path / "taken")


@pytest.mark.nightly
def test_edited_results_and_a_locked_folder_are_refused(
    built: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(built.folder / "src"))
    take_results(built.folder, tmp_path / "whole")
    assert Project(tmp_path / "whole").results() == built.results()
    path = built.folder / "results/ilo/fig1.svg"
    with edited(path):
        said = r"results/ilo/fig1\.svg: written since its job ended: .*; remove them and `make`"
        with pytest.raises(pytest.fail.Exception, match=said):
            take_results(built.folder, tmp_path / "taken")
    locks = built.folder / ".snakemake/locks"
    locks.mkdir(exist_ok=True)
    lock = locks / "0.output.lock"
    try:
        lock.write_text("results/ilo/fig1.svg\n")
        with pytest.raises(pytest.fail.Exception, match=r"the folder is locked: .*make unlock"):
            take_results(built.folder, tmp_path / "taken")
    finally:
        lock.unlink()


# Each in a process that has imported only third-party packages common to all.
LOADED = """
import json, os, sys
import jinja2, matplotlib.figure, numba, pandas, pyarrow.parquet, scipy.optimize, scipy.signal
for line in sys.stdin:
    child = os.fork()
    if not child:
        from reobserve_papers.cli.main import main
        done = main(["stage", *json.loads(line)])
        found = sorted(name for name in sys.modules if name.startswith("reobserve"))
        print(json.dumps([done, found]), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


LATE = {
    "reobserve_papers.__main__",  # of `python -m reobserve_papers`, which this test does not use
    "reobserve.core.yaml_loader",
    "reobserve.core.documents",  # imported for reading YAML, which few stages do
    "reobserve_papers.plotting.style_context",  # when a figure is plotted in another process
    "reobserve_papers.plotting.pgf",  # and where a picture for LaTeX is asked for
    "reobserve_papers.plotting.latex_text",
    "reobserve_papers.plants.first_order_lag",  # of the two the one that a scenario names
    "reobserve_papers.plants.pendulum",
    "reobserve.observers.many_records",  # and for many records at once
    "reobserve.observers.run_plot",  # and when a run is plotted, by names
    "reobserve.systems.signal_names",
    "reobserve.observers.run_diagnostics",  # and when it is asked for its diagnostics
    "reobserve.core.chi_squared",
    "reobserve_papers.parameters.parameter_file",  # where parameters are checked, once a build
    "reobserve_papers.plotting",  # of a label with a formula
    "reobserve_papers.plotting.formulas",
    "reobserve_papers.parameters.overrides",  # and where a user overrides some
    "reobserve_papers.steps.figures",  # for the metrics of a figure, as what follows
    "reobserve_papers.steps.glossary",
    "reobserve_papers.metrics",
    "reobserve_papers.metrics.metrics",
    "reobserve_papers.metrics.study_table",
    "reobserve_papers.parameters.figure_data",
    "reobserve_papers.signals.piecewise_constant",  # of a signal that has such terms
    "reobserve_papers.signals.samples",
    "reobserve.synthesis",  # where a filter is to estimate R, and must be able to see it
    "reobserve.synthesis.linear_gain",
    "reobserve.synthesis.placed_gains",
    "reobserve.core.balancing",
    "reobserve.core.finite",
}


# What metrics load only for figures in which observers that know nothing are scored.
OF_NULLS = {
    "delay": ["reobserve_papers.papers.delay.without_threshold"],
    "eso": ["reobserve_papers.papers.eso.observe", "reobserve_papers.papers.eso.random_gains"],
}


@pytest.fixture(scope="module")
def commands(built: Project) -> list[list[str]]:
    """The arguments of all stage jobs, after the name of the stage."""
    asked = ("--dry-run", "--forceall", "--printshellcmds")
    output = built.snakemake(*asked).stdout
    found = re.findall(r"\(set -x; reobserve-papers stage (.*?)\) ", output)
    return [command.split() for command in found]


@pytest.mark.nightly
@pytest.mark.parametrize("paper", PAPERS)
def test_import_closure_contains_every_module_a_stage_loads(
    built: Project, commands: list[list[str]], paper: str
) -> None:
    """The closure is read from source text; here each stage runs and reports its imports.

    One job of each kind runs: with and without a design, with and without a study; plots in one
    format. The robustness stage uses the same modules and would take too long here.
    """
    jobs: dict[tuple[str, bool, bool], list[str]] = {}
    for words in commands:
        of_paper = f"results/{paper}/parameters.json" in words
        slow = words[0] == "study" and STUDIES[paper] not in words
        if of_paper and words[0] in ALL_STAGES and not slow:
            count = len(KINDS[words[0]].names)
            needs = {
                need for need, *_ in reads(PARAMETER_FILES[paper], words[0], *words[2:][:count])
            }
            kind = (words[0], "design" in needs, "study" in needs)
            jobs.setdefault(kind, [word for word in words if word not in ("pdf", "png")])
    optional = {
        stage for stage, section in OPTIONAL.items() if section in PARAMETER_FILES[paper].tree
    }
    assert {stage for stage, *_ in jobs} == ALWAYS | optional
    asked = "\n".join(map(json.dumps, jobs.values()))
    said = built.run("python", "-c", LOADED, given=asked).stdout.splitlines()
    for (stage, _, studied), line in zip(jobs, said, strict=True):
        done, names = json.loads(line)
        assert done == 0
        loaded = set(names)
        closure = set(import_closure(stage_modules(stage, PARAMETER_FILES[paper].package)))
        assert loaded <= closure, stage
        columns = set() if studied else {f"reobserve_papers.papers.{paper}.study_rows"}
        nulls = set(import_closure(OF_NULLS.get(paper, []))) if stage == "metrics" else set()
        assert closure - loaded <= LATE | columns | nulls, stage

"""What stages import of what is slow to load: those that compute nothing wait for no compiler."""

from __future__ import annotations

import ast
import json
import shlex
from functools import cache
from pathlib import Path

import pytest

from reobserve.ledger.names import STAGES, paper_part
from reobserve.replication import provenance

from .conftest import LEDGERS, PAPERS, Project

SLOW = (
    "numba", "cvxpy", "matplotlib", "pandas", "scipy.signal", "scipy.stats", "sympy", "jinja2",
)  # fmt: skip

# Where observers are built or run; matplotlib where somebody asks a run for its picture.
RUNS = {"numba", "scipy.signal", "matplotlib"}

# The most that a stage may import, at once or late.
MAY = {
    **dict.fromkeys(("ledger", "design", "plant", "observe", "study", "search", "table"), RUNS),
    **dict.fromkeys(("theory", "draw", "robustness"), RUNS),
    "metrics": set(),
    "plot": {"matplotlib", "jinja2"},
    "sensitivity": {"matplotlib", "scipy.stats"},
    "claims": set(),
    "verdicts": set(),
    "report": {"jinja2"},
    "archive": {"jinja2"},
}

# And in one paper besides: matrix inequalities, exact series, and intervals of shares.
BESIDES = {
    **{("eso", stage): {"cvxpy"} for stage in MAY if MAY[stage] is RUNS},
    **{("lie", stage): {"sympy"} for stage in MAY if MAY[stage] is RUNS},
    **{("imm", stage): {"scipy.stats"} for stage in ("metrics", "plot", "draw", "robustness")},
}


@cache
def named(module: str) -> set[str]:
    """All that a module imports, at once or late, by a statement or by `package`."""
    path = provenance._source(module)
    assert path is not None
    calls = [node for node in ast.walk(ast.parse(path.read_bytes())) if isinstance(node, ast.Call)]
    late = {
        call.args[0].value
        for call in calls
        if getattr(call.func, "id", "") == "package" and isinstance(call.args[0], ast.Constant)
    }
    return {*provenance._imports(module), *late}


def imported(stage: str, paper: str) -> dict[str, list[str]]:
    """By what is slow: the modules of the stage that import it."""
    report = ["reobserve.evidence.report"]
    start = report if stage == "report" else provenance.stage_modules(stage, paper)
    found: dict[str, list[str]] = {}
    for module in provenance.import_closure(start):
        for slow in SLOW:
            if any(f"{name}.".startswith(f"{slow}.") for name in named(module)):
                found.setdefault(slow, []).append(module)
    return found


def test_the_table_has_all_stages() -> None:
    assert set(MAY) == {"ledger", *STAGES}


@pytest.mark.parametrize("stage", MAY)
def test_a_stage_imports_what_it_needs(stage: str) -> None:
    for paper in PAPERS:
        found = imported(stage, paper)
        found.pop("pandas", None)  # series and runs give data frames, for which no stage asks
        allowed = MAY[stage] | BESIDES.get((paper, stage), set())
        assert {slow: found[slow] for slow in found if slow not in allowed} == {}, paper


# Each job in a process that has imported numpy and what files are read with.
LOADED = f"""
import importlib, json, os, sys
import pyarrow.parquet
for line in sys.stdin:
    modules, words = json.loads(line)
    child = os.fork()
    if not child:
        from reobserve.cli import main
        for module in modules:
            importlib.import_module(module)
        done = main(["stage", *words])
        print(json.dumps([done, sorted(set({SLOW}) & set(sys.modules))]), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


def words_of(built: Project, stage: str, paper: str, figure: str) -> list[str]:
    """The arguments of ``reobserve stage`` that the log of a figure has."""
    log = STAGES[stage].log.format(paper=paper, figure=figure)
    command = (built.folder / log).read_text().partition("\n")[0]
    return shlex.split(command)[3:]  # after what shells put before a command that they show


def test_metrics_and_plots_load_no_compiler(built: Project, tmp_path: Path) -> None:
    """What they import by way of others, too: each paper is judged again, and one is drawn.

    Drawings take long; of the other papers what draws is imported.
    """
    jobs: list[tuple[list[str], list[str]]] = []
    for paper in PAPERS:
        figures = LEDGERS[paper].tree["figures"]
        studied = next(name for name in figures if "study" in figures[name])
        *words, _ = words_of(built, "metrics", paper, studied)
        jobs.append(([], [*words, str(tmp_path / f"{paper}.csv")]))
    drawn = PAPERS[0]
    words = words_of(built, "plot", drawn, next(iter(LEDGERS[drawn].tree["figures"])))
    words = words[: words.index("--caption")]
    words += ["--caption", str(tmp_path / "one.rst"), "--outputs", str(tmp_path / "one.svg")]
    jobs.append(([paper_part(paper, "plot") for paper in PAPERS], words))
    asked = "\n".join(map(json.dumps, jobs))
    said = built.run("python", "-c", LOADED, given=asked).stdout.splitlines()
    for (_, words), line in zip(jobs, said, strict=True):
        done, loaded = json.loads(line)
        assert done == 0
        assert set(loaded) <= MAY[words[0]], words

"""What short steps import: nothing is compiled to compute metrics or to draw."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

from reobserve.ledger.names import paper_part

from .conftest import LEDGERS, PAPERS, Project

SLOW = ("numba", "cvxpy", "matplotlib", "pandas", "scipy.signal", "scipy.stats", "sympy")
MAY = {"metrics": {"scipy.stats"}, "plot": {"matplotlib", "scipy.stats"}}

# Each step in a process that has imported numpy and what files are read with.
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


def words_of(built: Project, step: str, paper: str, figure: str) -> list[str]:
    """The arguments of ``reobserve stage`` in the log of a figure."""
    command = (built.folder / f"logs/{paper}/{figure}.{step}.log").read_text().partition("\n")[0]
    return shlex.split(command)[3:]  # after what shells put before a command that they show


def test_metrics_and_plots_load_no_compiler(built: Project, tmp_path: Path) -> None:
    """The metrics of a study's figure of each paper, and one drawing, since drawing takes long.

    Of the other papers the module that draws is imported.
    """
    jobs: list[tuple[list[str], list[str]]] = []
    for paper in PAPERS:
        figures = LEDGERS[paper].tree["figures"]
        studied = next(name for name in figures if "study" in figures[name])
        *words, _ = words_of(built, "metrics", paper, studied)
        jobs.append(([], [*words, str(tmp_path / f"{paper}.csv")]))
    drawn = PAPERS[0]
    words = words_of(built, "plot", drawn, next(iter(LEDGERS[drawn].tree["figures"])))
    words = words[: words.index("--outputs")]
    words += ["--caption", str(tmp_path / "one.rst"), "--outputs", str(tmp_path / "one.svg")]
    jobs.append(([paper_part(paper, "plot") for paper in PAPERS], words))
    asked = "\n".join(map(json.dumps, jobs))
    said = built.run("python", "-c", LOADED, given=asked).stdout.splitlines()
    for (_, words), line in zip(jobs, said, strict=True):
        done, loaded = json.loads(line)
        assert done == 0
        assert set(loaded) <= MAY[words[0]], words

"""The functions of `src` behind four calls: `python -m tests.walks [--where]`.

It prints how many functions and class bodies with names each call enters, in how many files, and
their lines of code, and fails where a number is above that of `tests/budget.toml`. `--where` lists
the files. Comprehensions and compiled functions do not count, which newer Pythons do not enter.
"""

from __future__ import annotations

import ast
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import reobserve

from . import ROOT
from .budget import TABLE

SOURCE = ROOT / "src"
SECTION = "functions, files and lines of code behind"

Walk = set[tuple[Path, int, str]]  # file, first line and name of each function


def walk(call: Callable[[], object], source: Path = SOURCE) -> Walk:
    """The functions and class bodies in a folder that a call enters."""
    seen: set[tuple[str, int, str]] = set()

    def entered(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        compiled = "__name__" not in frame.f_globals  # the frame is one that numba makes up
        inside = code.co_filename.startswith(str(source))
        if event == "call" and inside and code.co_name[0] != "<" and not compiled:
            seen.add((code.co_filename, code.co_firstlineno, code.co_name))

    sys.setprofile(entered)
    try:
        call()
    finally:
        sys.setprofile(None)
    return {(Path(file), first, name) for file, first, name in seen}


def sizes(seen: Walk) -> list[int]:
    """The numbers of functions, of files and of lines with code, without docstrings."""
    lines: set[tuple[Path, int]] = set()
    files = {path for path, _, _ in seen}
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
                if (path, first, node.name) in seen:
                    body = node.body[ast.get_docstring(node) is not None :]
                    parts = [part for statement in body for part in ast.walk(statement)]
                    code = [part for part in parts if isinstance(part, ast.stmt | ast.expr)]
                    lines |= {(path, part.lineno) for part in code}
    return [len(seen), len(files), len(lines)]


def filters() -> list[Any]:
    """Three filters of the library."""
    linear = reobserve.LinearModel([[0.9, 0.1], [0, 0.8]], [[0], [1]], [[1, 0]], Q=1e-4, R=1e-2)
    nonlinear = reobserve.NonlinearModel(
        ["a + 0.1*b", "b - 0.1*sin(a) + v"], ["a"], [1e-4, 1e-4], 1e-2, state_names=["a", "b"],
        input_names=["v"], sampling_period=0.1,
    )  # fmt: skip
    kalman = reobserve.KalmanFilter(linear)
    bank = reobserve.IMM([kalman, kalman], [[0.9, 0.1], [0.1, 0.9]])
    return [kalman, reobserve.ExtendedKalmanFilter(nonlinear), bank]


def run(one: Any) -> Any:
    """A short run of a filter."""
    return one.run(np.zeros(20), np.ones(20), start=one.init([0.0, 0.0], 1.0))


def plant_walk(parameter_file: str) -> Walk:
    """The walk of a job that simulates a plant, with what it imports beside the filters."""
    filters()
    from reobserve_papers.cli.main import main as command

    return walk(lambda: command(["stage", "plant", parameter_file, "constant"]))


def walks() -> dict[str, Walk]:
    """All walks. Each call is made before, so that nothing is compiled on the way."""
    found = {}
    for one in filters():
        run(one)
        found[f"{type(one).__name__}.run"] = walk(lambda one=one: run(one))
    from reobserve_papers.parameters.parameters import Parameters

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "results/ilo/parameters.json")
        file.parent.mkdir(parents=True)
        file.write_text(Parameters.load(ROOT, "ilo").text(), encoding="utf-8")
        for _ in range(2):  # each in its own process, where nothing else has been imported
            with ProcessPoolExecutor(1, get_context("spawn")) as process:
                found["stage plant"] = process.submit(plant_walk, str(file)).result()
        assert (file.parent / "constant/plant.parquet").is_file()
    return found


def main() -> int:
    """Print all walks, and return 1 if one is longer than stated."""
    stated = tomllib.loads((ROOT / TABLE).read_text(encoding="utf-8"))[SECTION]
    code = 0
    for name, seen in walks().items():
        found = sizes(seen)
        longer = any(one > most for one, most in zip(found, stated[name], strict=True))
        code |= longer
        print(f"{name}: {found}" + f", above {stated[name]} in {TABLE}" * longer)
        if "--where" in sys.argv:
            for path, count in sorted(Counter(path for path, _, _ in seen).items()):
                print(f"    {path.relative_to(SOURCE)}: {count}")
    return code


if __name__ == "__main__":
    sys.exit(main())

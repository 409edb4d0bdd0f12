"""How long a line takes from text to text: an IMM of three models of four states."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any
from unittest import mock

import numpy as np
import yaml

from benchmarks.report import Row, Section
from reobserve.estimation import row_by_row
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.row_by_row import RowByRow, unchecked_step
from reobserve.estimation.specification import read_specification

_PERIOD = 0.001
_HEADER = "t,position,rate,torque"
_AIM, _AIM_OF_TEXT = 100e-6, 50e-6
_FIRST = 100


def run(quick: bool) -> Section:
    """Time a line in this process, what of it is not the observer's step, and one through pipes."""
    count = 2_000 if quick else 20_000
    section = Section(
        "Streams",
        f"median of {count} lines: time, two measurements and an input in, 13 numbers out; "
        "IMM of 3 Kalman filters of 4 states",
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "imm.yaml"
        path.write_text(yaml.safe_dump(_specification()))
        columns = _HEADER.split(",")
        estimation = Estimation(read_specification(path), columns, "the record")
        rows, lines = RowByRow(estimation, columns), list(_lines(count + _FIRST))
        steps: list[float] = []
        with mock.patch.object(row_by_row, "unchecked_step", _timed(unchecked_step, steps)):
            taken = _times(lines, rows.read)
        whole = median(taken)
        beside = median(line - step for line, step in zip(taken, steps[-len(taken) :], strict=True))
        piped = _through_pipes(path, lines)
    section.rows += [
        Row("a line in, a line out", whole, f"{_AIM * 1e6:g} us", _AIM, cost=True, aim=1.0),
        Row(
            "all but the observer's step", beside, f"{_AIM_OF_TEXT * 1e6:g} us",
            _AIM_OF_TEXT, cost=True, aim=1.0,
        ),
        Row("a line through pipes", piped, "in one process", whole, cost=True),
    ]  # fmt: skip
    return section


def _times(lines: list[str], job: Callable[[str], Any]) -> list[float]:
    """Of all lines but the first, with which much is met for the first time."""
    taken: list[float] = []
    timed = _timed(job, taken)
    for line in lines:
        timed(line)
    return taken[_FIRST:]


def _timed(job: Callable[..., Any], taken: list[float]) -> Callable[..., Any]:
    def timed(*arguments: Any) -> Any:
        start = time.perf_counter()
        found = job(*arguments)
        taken.append(time.perf_counter() - start)
        return found

    return timed


def _through_pipes(path: Path, lines: list[str]) -> float:
    command = [sys.executable, "-m", "reobserve", "estimate", str(path), "--stream", "--warm"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        bufsize=1,
    ) as child:  # fmt: skip
        assert child.stdin is not None
        assert child.stdout is not None
        to, back = child.stdin, child.stdout
        to.write(_HEADER + "\n")
        back.readline()

        def there_and_back(line: str) -> None:
            to.write(line)
            back.readline()

        found = median(_times(lines, there_and_back))
        to.close()
        back.read()
    return found


def _lines(count: int) -> Iterator[str]:
    random = np.random.default_rng(4)
    for k, (position, rate) in enumerate(random.normal(size=(count, 2)).tolist()):
        yield f"{k * _PERIOD:.3f},{position!r},{rate!r},0.25\n"


def _specification() -> dict[str, Any]:
    def transition(friction: float) -> list[list[float]]:
        return [[0, 1, 0, 0], [-40, -friction, 40, 0], [0, 0, 0, 1], [20, 0, -20, -1]]

    stays = (0.98 * np.eye(3) + 0.01 * (1 - np.eye(3))).tolist()
    return {
        "observer": {
            "kind": "imm", "time": "continuous", "A": transition(1), "B": [[0], [10], [0], [0]],
            "C": [[1, 0, 0, 0], [0, 1, 0, 0]], "Q": 1e-4, "R": [1e-2, 1e-2],
            "modes": {"a": {}, "b": {"A": transition(2)}, "c": {"A": transition(4)}},
            "gains": {"transition": stays},
            "initial_state": [0.0] * 4, "initial_covariance": 1.0,
        },
        "columns": {
            "time": {"column": "t", "unit": "s"},
            "measurements": [
                {"column": "position", "unit": "deg", "model_unit": "rad"},
                {"column": "rate", "unit": "deg/s", "model_unit": "rad/s"},
            ],
            "inputs": [{"column": "torque", "unit": "N m"}],
        },
        "sampling": {"period": _PERIOD},
    }  # fmt: skip

"""Statistics of innovations: the rate of false alarms, and the power against wrong models."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom, chi2, norm

from reobserve import KalmanFilter, LinearModel
from reobserve.core.validation import parse
from reobserve.estimation.consistency import RATE, statistics
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.specification import Specification
from tests.reobserve.estimation.records import write_record

Array = NDArray[np.float64]

CLOSEST = {"nis": 1.0, "autocorrelation": 0.0, "mean": 0.0}
POLE, TURN = 0.9, np.array([[0.95, 0.2], [-0.2, 0.9]])
# A model, and the deviation of its sensors.
PLANTS: dict[str, dict[str, Any]] = {
    "lag": {"A": [[POLE]], "B": [[1.0 - POLE]], "C": [[1.0]], "Q": 1e-6, "R": 1e-4},
    "walk": {"A": [[1.0]], "B": [[0.0]], "C": [[1.0]], "Q": 1e-4, "R": 1e-4},
    "swing": {"A": TURN, "B": [[0.0], [0.1]], "C": np.eye(2), "Q": 1e-5, "R": [1e-4, 4e-4]},
    "one of two": {"A": TURN, "B": [[0.0], [0.1]], "C": [[1.0, 0.0]], "Q": 1e-5, "R": 1e-3},
}
WRONG: dict[str, tuple[str, dict[str, Any], float]] = {
    "pole": ("lag", {"A": [[0.9 * POLE]]}, 0.0),
    "pole of the swing": ("swing", {"A": 0.9 * TURN}, 0.0),
    "R too small": ("lag", {"R": 0.25e-4}, 0.0),
    "R too large": ("lag", {"R": 4e-4}, 0.0),
    "R of the swing": ("one of two", {"R": 0.25e-3}, 0.0),
    "bias": ("lag", {}, 0.02),
    "bias of the swing": ("swing", {}, 0.03),
}


def innovations(
    name: str, records: int, rows: int, seed: int, bias: float = 0.0, **wrong: Any
) -> Iterator[tuple[Array, Array]]:
    """Innovations of records of a plant, by a filter of a model that may be another."""
    plant, random = PLANTS[name], np.random.default_rng(seed)
    A, B, C = (np.asarray(plant[key], dtype=float) for key in "ABC")
    n, p = len(A), len(C)
    u = np.repeat(np.sign(np.sin(0.05 * np.arange(rows)))[None, :, None], records, axis=0)
    x, y = np.zeros((records, n)), np.empty((records, rows, p))
    deviations = np.sqrt(np.broadcast_to(plant["R"], p))
    for k in range(rows):
        y[:, k] = x @ C.T + deviations * random.normal(size=(records, p))
        x = x @ A.T + u[:, k] @ B.T + math.sqrt(plant["Q"]) * random.normal(size=(records, n))
    y[:, :, 0] += bias
    kalman = KalmanFilter(LinearModel(**{**plant, **wrong}))
    run = kalman.run(y, u, start=kalman.init(np.zeros(n), 1e-9))
    return zip(run["innovation"], run["innovation_covariance"], strict=True)


def warned(name: str, records: int, rows: int, seed: int, **wrong: Any) -> int:
    """The records whose statistics are beyond their bounds."""
    found = innovations(name, records, rows, seed, **wrong)
    return sum(any(not one.fits for one in statistics(*each)) for each in found)


@pytest.mark.parametrize("rows", [40, 200])
@pytest.mark.parametrize("name", PLANTS)
def test_right_models_are_warned_of_no_more_often_than_stated(name: str, rows: int) -> None:
    records = 400
    assert warned(name, records, rows, rows) <= binom.ppf(0.999, records, RATE)


@pytest.mark.parametrize("name", WRONG)
def test_wrong_models_are_found_in_a_thousand_rows(name: str) -> None:
    plant, wrong, bias = WRONG[name]
    assert warned(plant, 40, 1000, 8, bias=bias, **wrong) > 0.9 * 40


@pytest.mark.parametrize("missing", [0.0, 0.3])
@pytest.mark.parametrize("m", [1, 2])
def test_rate_of_false_alarms_is_kept_without_tolerance(m: int, missing: float) -> None:
    """Of white innovations that are correlated among each other, some of them missing."""
    random, records, rate = np.random.default_rng(m), 700, 0.05
    root = np.tril(random.normal(size=(m, m))) + 2.0 * np.eye(m)
    S = np.broadcast_to(root @ root.T, (100, m, m))
    wrong = 0
    for _ in range(records):
        e = random.normal(size=(100, m)) @ root.T
        e[random.random(e.shape) < missing] = np.nan
        wrong += any(not one.fits for one in statistics(e, S, rate, CLOSEST))
    assert 0.2 * rate * records < wrong <= binom.ppf(0.999, records, rate)


def test_statistics_are_those_of_their_formulas() -> None:
    random, rate = np.random.default_rng(4), 0.01
    e, sizes = random.normal(size=(53, 2)) * [2.0, 3.0], np.array([2.0, 3.0])
    found = {
        (one.name, one.place): one
        for one in statistics(e, np.broadcast_to(np.diag(sizes**2), (53, 2, 2)), rate, CLOSEST)
    }
    w, ends = e / sizes, [0, 11, 22, 33, 43, 53]
    parts = [w[a:b] for a, b in pairwise(ends)]
    q = (rate / (2 * 5) / 10) ** (1 / 3)
    assert binom.sf(2, 5, q) < rate / 10 < 1.2 * binom.sf(2, 5, q)
    nis = found.pop(("nis", 0))
    assert nis.value == pytest.approx(np.median([np.sum(one**2) / len(one) / 2 for one in parts]))
    assert (nis.lower, nis.upper) == pytest.approx(tuple(chi2.ppf([q, 1 - q], 20) / 20))
    for (name, place), one in found.items():
        values = []
        for part in parts:
            column = part[:, place].tolist()
            mean = sum(column) / len(column)
            off = [value - mean for value in column]
            lagged = sum(off[k] * off[k - 1] for k in range(1, len(off)))
            values.append(mean if name == "mean" else lagged / sum(value**2 for value in off))
        assert one.value == pytest.approx(sorted(values)[2])
        assert (-one.lower, one.upper) == pytest.approx((norm.isf(q) / math.sqrt(10),) * 2)
    assert set(found) == {(name, c) for name in ("autocorrelation", "mean") for c in (0, 1)}


@pytest.mark.parametrize(("pole", "fits"), [(POLE, True), (0.98 * POLE, False)])
def test_report_has_the_statistics_and_one_sentence(
    pole: float, fits: bool, tmp_path: Path
) -> None:
    random, rows = np.random.default_rng(2), 1000
    u, x = np.sign(np.sin(0.05 * np.arange(rows))), np.zeros(rows)
    for k in range(rows - 1):
        x[k + 1] = POLE * x[k] + 0.1 * u[k]
    record = {"u": u, "level": x + 0.03 * random.normal(size=rows)}
    tree = {
        "observer": {
            "kind": "kalman", "time": "discrete", "states": {"level": "m"}, "inputs": {"u": "V"},
            "measurements": {"level": "m"}, "A": [[pole]], "B": [[0.1]], "C": [[1.0]],
            "Q": 1e-7, "R": 9e-4, "initial_covariance": 1.0,
        },
        "columns": {"measurements": [{"column": "level"}], "inputs": [{"column": "u"}]},
        "sampling": {"period": 1.0},
    }  # fmt: skip
    chosen, path = parse(Specification, tree), write_record(tmp_path / "r.csv", record)
    report = estimate_file(chosen, path, tmp_path / "e.csv").report
    found = report.innovations
    assert set(found) == {"nis", "autocorrelation", "mean"}
    if fits:
        assert (found["nis"], found["mean"]["level"]) == (
            pytest.approx(1.0, abs=0.2), pytest.approx(0.0, abs=0.2)
        )  # fmt: skip
        assert report.warnings == []
    else:
        (sentence,) = report.warnings
        assert sentence.startswith("innovations: over the first 1000 rows they do not fit the ")
        assert f"lag-1 autocorrelation of level {found['autocorrelation']['level']:.2g}" in sentence

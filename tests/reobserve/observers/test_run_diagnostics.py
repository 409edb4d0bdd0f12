"""What a run says against its model: known answers of right and wrong models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve import InputError, KalmanFilter, LinearModel, Run

RNG = np.random.default_rng(3)
W, V = RNG.normal(size=(2, 400, 2))


def model(**changes: Any) -> LinearModel:
    stated: dict[str, Any] = {"A": 0.9 * np.eye(2), "C": np.eye(2), "Q": 0.04, "R": 0.25, **changes}
    return LinearModel(**stated, sampling_period=0.1)


def measured() -> Any:
    x, rows = np.zeros(2), []
    for w, v in zip(W, V, strict=True):
        rows.append(x + 0.5 * v)
        x = 0.9 * x + 0.2 * w
    return np.array(rows)


def run(y: Any, start: float = 0.04 / 0.19, **changes: Any) -> Run[Any]:
    found = KalmanFilter(model(**changes))
    return found.run(y, start=found.init([0.0, 0.0], start))


def test_right_model_is_not_spoken_against() -> None:
    found = run(measured()).diagnostics()
    assert (len(found.far), len(found.inflated)) == (0, 0)
    assert found.distance == pytest.approx(1.0, abs=0.15)  # 800 numbers: 3 deviations of 0.05
    assert found.eigenvalue == pytest.approx(1.0)  # two states that have nothing in common
    assert repr(found).startswith("Diagnostics(far: none, inflated: none, distance: ")


def test_outlier_is_named_by_its_row_and_missing_rows_are_none() -> None:
    y = measured()
    y[200, 1] += 40.0
    y[50], y[60, 0] = np.nan, np.nan
    found = run(y).diagnostics()
    assert found.far[0] == 200
    assert found.inflated[0] == 200
    assert found.far.max() < 230


def test_small_noise_is_seen_by_many_innovations_of_which_none_is_far() -> None:
    found = run(measured(), R=0.1).diagnostics()
    assert len(found.far) == 0
    assert 0 < found.inflated[0] < 150
    assert found.distance == pytest.approx(1.8, abs=0.3)
    assert len(run(measured(), R=1.0).diagnostics().inflated) == 0


def test_eigenvalue_is_that_of_the_correlations() -> None:
    P = np.array([[[4.0, 3.0e-6], [3.0e-6, 9.0e-12]], [[1.0, 0.0], [0.0, 0.0]]])
    ones = np.ones((2, 1))
    estimates = {"innovation": ones, "innovation_covariance": ones[..., None]}
    for covariance, expected in ((P[:1], 0.5), (P[1:], 0.0), (-P[:1], -1.5)):
        rows = {name: one[:1] for name, one in estimates.items()} | {"covariance": covariance}
        found = Run(np.zeros(1), rows, {}, None).diagnostics()
        if expected > -1:
            assert found.eigenvalue == pytest.approx(expected, abs=1e-12)
        else:
            assert found.eigenvalue < 0


def test_run_without_innovations_is_refused() -> None:
    with pytest.raises(InputError, match=r"^run: has no innovations"):
        Run(np.zeros(1), {"state": np.zeros((1, 1))}, {}, None).diagnostics()

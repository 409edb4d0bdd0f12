"""R of a single output by row as (k,), in all filters that take R by row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    FaultBank,
    GridFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
    steady_kalman,
)
from tests.reobserve.library.test_docstrings import OBSERVERS

LINEAR = LinearModel([[0.9]], C=[[1.0]], Q=0.2, R=0.1)
TEXT = NonlinearModel(["0.9*a"], ["a"], 0.2, 0.1, state_names=["a"])
TURN = [[0.9, 0.1], [0.1, 0.9]]
FILTERS: dict[str, Callable[[], Any]] = {
    "KalmanFilter": lambda: KalmanFilter(LINEAR),
    "SmoothVariableStructureFilter": lambda: SmoothVariableStructureFilter(
        LINEAR, boundary_layer=1.0, convergence_rate=0.1
    ),
    "FixedGainObserver": lambda: steady_kalman(LINEAR),
    "AugmentedKalmanFilter": lambda: AugmentedKalmanFilter(
        LINEAR, fault_matrix=[[1.0]], random_walk=0.1
    ),
    "IMM": lambda: IMM([KalmanFilter(LINEAR), KalmanFilter(LINEAR)], transition=TURN),
    "FaultBank": lambda: FaultBank(
        LINEAR, fault_matrix=[[1.0]], drift=0.1, jump=0.5, jump_rate=0.1, jump_time=2.0
    ),
    "GridFilter": lambda: GridFilter.of_parameter(
        lambda a: LinearModel([[a]], C=[[1.0]], Q=0.2, R=0.1), grid=[0.8, 0.9], random_walk=1e-3
    ),
    "ExtendedKalmanFilter": lambda: ExtendedKalmanFilter(TEXT),
    "UnscentedKalmanFilter": lambda: UnscentedKalmanFilter(TEXT),
}
Y, R = np.array([0.3, -0.1, np.nan, 0.4]), np.array([0.1, 0.0, 2.0, 0.3])


def test_all_filters_that_take_noise_by_row_are_here() -> None:
    assert set(FILTERS) == {name for name, kind in OBSERVERS.items() if "R" in kind.takes}


@pytest.mark.parametrize("name", FILTERS)
def test_noise_by_row_is_a_number_a_row(name: str) -> None:
    observer = FILTERS[name]()
    start = observer.init([0.2]) if name == "FixedGainObserver" else observer.init([0.2], 1.0)
    found = observer.run(Y, start=start, R=R)
    sought = observer.run(Y, start=start, R=R[:, None, None])
    for each in sought:
        assert np.array_equal(found[each], sought[each], equal_nan=True), each
    other = observer.run(Y, start=start)["log_likelihood"]
    assert not np.array_equal(found["log_likelihood"], other)
    with pytest.raises(InputError, match=r"^R: has shape \(3,\), must be"):
        observer.run(Y, start=start, R=R[:3])
    with pytest.raises(InputError, match=r"^R\[3\]: must be positive semidefinite"):
        observer.run(Y, start=start, R=R - [0.0, 0.0, 0.0, 0.6])

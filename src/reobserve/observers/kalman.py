"""The Kalman filter (Kalman 1960), in predictor-corrector form with Joseph's covariance.

The compiled loop is `reobserve.observers.linear_loop.run_linear`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.correlated_noise import TakenOut, uncorrelated
from reobserve.observers.gain import Gain
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import FilterSteps, InRecord, as_held, side_by_side
from reobserve.observers.linear_loop import (
    CAUSES,
    predict_linear,
    run_linear,
)
from reobserve.observers.linear_steps import new_linear_work
from reobserve.systems.linear import LinearModel, ModelRows

Array = NDArray[np.float64]

KALMAN = Gain(None, np.empty(0))
TAKES = ("A", "B", "C", "D", "Q", "R", "keep")


def linear_in_record(
    filter: GaussianFilter,  # noqa: A002
    given: Mapping[str, Any],
    y: Array,
    inputs: Array,
    held: Mapping[str, Array],
    periods: Array | None,
) -> InRecord:
    """The matrices of each row, and inputs with the known part of correlated noise behind them.

    Raises
    ------
    InputError
        If a matrix that is given has another shape, or is no covariance.
    """
    model: LinearModel = filter.whole
    if ("S" in given or "noise" in held) and model.output_periods is not None:
        problem = "must be left out where outputs have periods: it is of y - C x, which then jumps"
        raise InputError("S", problem)
    if not given and not held and periods is None:
        return InRecord(model.rows, inputs, None)
    matrices = {name: given[name] for name in given if name in ModelRows._fields}
    rows = model.by_row(matrices, len(y), held, periods)
    after = {name: rows[name][-1] for name in ("A", "B", "Q") if name in given}
    before = [held[name] for name in TakenOut._fields if name in held]
    if "S" in given or before:
        open_end = periods is not None and "Q" not in given
        rows, taken = uncorrelated(rows, given.get("S"), y, inputs[0], before, open_end)
        if "S" in given:
            after |= {name: part[-1] for name, part in taken._asdict().items()}
        # x = A x + [B I] [u; J (y - D u)]
        rows["B"] = side_by_side(rows["B"], np.eye(model.states))
        inputs = side_by_side(inputs, taken.known)
    matrices = {name: np.ascontiguousarray(matrix) for name, matrix in rows.items()}
    return InRecord(ModelRows(**matrices), inputs, as_held(after))


LINEAR = FilterSteps(
    LinearModel, linear_in_record, run_linear, predict_linear, new_linear_work,
    CAUSES,
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class KalmanFilter(GaussianFilter):
    """Kalman filter, the linear filter of minimum variance (Kalman 1960).

        x = A x + B u,              P = A P A' + Q
        e = y - C x - D u,          S = C P C' + R
        K = P C' S^-1,              x = x + K e
        P = (I - K C) P (I - K C)' + K R K'

    `init` takes the mean and the covariance of x. `run` and `step` take y, shape (k, m), nan where
    a measurement is missing, and u, (k, p); by name also A, B, C, D, Q, R, S and ``keep``, see
    `GaussianFilter`. Estimates, in units of the model: ``state``, x, shape (k, n), ``covariance``,
    P, (k, n, n), and its diagonal ``variance``, (k, n), after each measurement; ``innovation``, e,
    (k, m), ``innovation_covariance``, S, (k, m, m), and ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The linear model of the plant.

    Raises
    ------
    InputError
        If the model is of another kind.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2, sampling_period=0.1)
    >>> kalman = KalmanFilter(model)
    >>> run = kalman.run([0.0, 0.11, float("nan"), 0.29], state=kalman.init([0, 0], 1.0))
    >>> print(run["state"][-1].round(2), run["variance"][-1].round(3))
    [0.26 0.79] [0.008 0.178]
    """

    model: LinearModel

    steps: ClassVar[FilterSteps] = LINEAR
    has_kalman_gain: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = (*TAKES, "S")

    @property
    def method(self) -> Gain:
        """Kalman's gain, which the loops have built in."""
        return KALMAN

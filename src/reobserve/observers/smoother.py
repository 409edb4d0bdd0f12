"""The fixed-interval smoother of Rauch, Tung and Striebel (1965), for runs of Kalman filters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import as_sample_rows
from reobserve.observers.augmented_kalman import CROSS, AugmentedKalmanFilter
from reobserve.observers.dataframes import read_frames
from reobserve.observers.gaussian_filter import EVEN, GaussianFilter
from reobserve.observers.gaussian_state import KalmanState, TakenOut, refuse_given, warn_of_smoothed
from reobserve.observers.kalman import KalmanFilter, assign, assign_matrix, blocks, shortest
from reobserve.observers.nonlinear_filter import (
    ExtendedKalmanFilter,
    UnscentedKalmanFilter,
    solve_by_root,
    take_root,
)
from reobserve.observers.run import Run
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]


SMOOTHED = (KalmanFilter, AugmentedKalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter)


def rts_smoother(
    filter: GaussianFilter,  # noqa: A002  # as filterpy calls it
    run: Run[Any],
    u: ArrayLike | None = None,
    *,
    y: ArrayLike | None = None, lag: int | None = None,
    A: ArrayLike | None = None, B: ArrayLike | None = None, C: ArrayLike | None = None,
    D: ArrayLike | None = None, Q: ArrayLike | None = None, R: ArrayLike | None = None,
    S: ArrayLike | None = None, parameters: Mapping[str, ArrayLike] | None = None,
    dt: ArrayLike | None = None,
) -> Run[Any]:  # fmt: skip
    """Estimates at all samples of a run, each from the whole record, or from ``lag`` rows more.

        G(k) = cov(x(k), x(k+1)) P(k+1|k)^-1
        x_s(k) = x(k|k) + G (x_s(k+1) - x(k+1|k))
        P_s(k) = P(k|k) + G (P_s(k+1) - P(k+1|k)) G'

    The fixed-interval smoother of Rauch, Tung and Striebel (1965). The cross-covariance is P A' of
    the Kalman filter and of the extended one (at the estimate of row k), and that of the sigma
    points of the unscented one (Sarkka 2008).

    Parameters
    ----------
    filter
        The filter that made the run: a Kalman filter, an extended or unscented one, or one
        augmented by unknown inputs.
    run
        Its run; where measurements are missing, too. That of an augmented filter needs ``keep`` of
        ``state_unknown_input_covariance``.
    u
        The inputs of the run, shape (k, p), or (k,); left out where there are none.
    y
        Its measurements, shape (k, m), if S was given to the run; else of no use.
    lag
        The fixed-lag smoother: a row is estimated from the rows up to ``lag`` after it, 1 to k.
        Left out, from all. The cost grows with it.
    A, B, C, D, Q, R, S, parameters, dt
        As they were given to the run. Times of the run that are uneven are known.

    Returns
    -------
    Run
        With ``state``, (k, n), ``covariance``, (k, n, n), and ``variance``, (k, n), at the run's
        times, and those of unknown inputs. Its last row is the run's own, and so is the state to go
        on from.

    Raises
    ------
    InputError
        If the filter is another one, or the run, the inputs or what is given are not of it.
    DivergenceError
        If the prediction from a row is not finite, or its covariance is not positive semidefinite.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel, rts_smoother
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> kalman = KalmanFilter(model)
    >>> run = kalman.run([0.02, 0.11, 0.19, 0.29], start=kalman.init([0, 0], 1.0))
    >>> smoothed = rts_smoother(kalman, run)
    >>> print(run["variance"][0, 1].round(2), smoothed["variance"][0, 1].round(2))
    1.0 0.17

    """
    if not isinstance(filter, SMOOTHED):
        raise InputError(
            "filter",
            f"{shown(filter)} must be a Kalman filter, extended or unscented or augmented",
        )
    means, covariances = _filtered(filter, run)
    y, u, *_ = read_frames(filter, y, u, None, None, run.time)
    k, m = len(means), filter.measurements
    if u is None and filter.inputs:
        raise InputError("u", f"is left out, must have shape {(k, filter.inputs)}")
    inputs = np.empty((k, 0)) if u is None else as_sample_rows("u", u, filter.inputs, rows=k)
    given = filter._known(
        {"A": A, "B": B, "C": C, "D": D, "Q": Q, "R": R, "S": S, "parameters": parameters, "dt": dt}
    )
    _check_given(run, given)
    refuse_given(filter, given)
    if "S" in given and y is None:
        raise InputError("y", f"is left out, must have shape {(k, m)}: S was given")
    measured = np.zeros((k, m)) if y is None else as_sample_rows("y", y, m, rows=k, missing=True)
    before = np.concatenate([inputs[:1], inputs])[None]
    model, held_inputs, _ = filter.steps.in_record(
        filter, filter._given(given, k), measured, before, {}, _periods(filter, run, given)
    )
    n = means.shape[1]
    ahead = np.empty((k - 1, n)), np.empty((k - 1, n, n)), np.empty((k - 1, n, n))
    with RaisedAfterLoop():
        rows = filter.steps.predict(
            model, filter.method, held_inputs[0], means, covariances, *ahead,
            filter._work(),
        )  # fmt: skip
    if rows < k - 1:
        problem = "the prediction from there is not finite"
        raise DivergenceError("rts_smoother", float(run.time[rows]), problem)
    smooth_means, smooth_covariances = means.copy(), covariances.copy()
    work = blocks(((n, n),) * 3)
    periods = filter._rules.state_periods
    if lag is None:
        row = _smooth(*ahead, smooth_means, smooth_covariances, periods, *work)
    else:
        later = as_whole("lag", lag, 1, k)
        row = _smooth_late(
            later, *ahead, means, covariances, smooth_means, smooth_covariances,
            np.empty((later + 1, n)), np.empty((later + 1, n, n)), periods, *work,
        )  # fmt: skip
    if row >= 0:
        raise DivergenceError(
            "rts_smoother", float(run.time[row]), "going backwards it fails there"
        )
    smooth_means = wrapped(smooth_means, filter._rules.state_periods)
    warn_of_smoothed(*(P.diagonal(axis1=1, axis2=2) for P in (covariances, smooth_covariances)))
    estimates = _by_name(filter, smooth_means, smooth_covariances)
    return Run(
        run.time, estimates, dict.fromkeys(estimates, ""), run.end, run.diverged_at,
        missing=run.missing, component_names=filter.component_names, index=run.index,
        periods=run.periods,
    )  # fmt: skip


def _filtered(filter: GaussianFilter, run: Any) -> tuple[Array, Array]:  # noqa: A002
    """Means and covariances of all that is estimated, (k, n) and (k, n, n)."""
    n, whole = filter.model.states, filter.whole.states
    wanted = {"state": (n,), "covariance": (n, n)}
    if whole > n:
        q = whole - n
        wanted |= {"unknown_input": (q,), "unknown_input_covariance": (q, q), CROSS: (n, q)}
    k = len(run) if isinstance(run, Run) else 0
    if k and type(run.end) is tuple:
        raise InputError("run", "is of many records; take one of them, run.record(0)")
    if k and not isinstance(run.end, KalmanState):
        raise InputError("run", f"ends in {shown(run.end)}, must be a run of the filter")
    for name, shape in wanted.items():
        if not k or name not in run.estimates or run[name].shape != (k, *shape):
            problem = (
                f"{shown(run)} must be a run of the filter, with state and covariance of {n} states"
            )
            if k and name == CROSS:
                problem = f'has no {CROSS}: run the filter with keep=["{CROSS}"]'
            raise InputError("run", problem)
    x, P = run["state"], run["covariance"]
    if whole > n:
        cross, rest = run[CROSS], run["unknown_input_covariance"]
        x = np.concatenate([x, run["unknown_input"]], axis=1)
        P = np.block([[P, cross], [cross.transpose(0, 2, 1), rest]])
    return np.ascontiguousarray(x), np.ascontiguousarray(P)


def _check_given(run: Run[Any], given: dict[str, Any]) -> None:
    """Refuse to smooth a run without what was given to it."""
    for held in run.end.held or {}:
        name = "S" if held in TakenOut._fields else held
        if name not in given:
            raise InputError(name, "is left out, but was given to the run; give the same here")


def _periods(filter: GaussianFilter, run: Run[Any], given: dict[str, Any]) -> Array | None:  # noqa: A002
    """The times that lead to each row, where they differ."""
    if run.end.time is None:
        return None
    period = filter.sampling_period
    periods = np.concatenate([[period], np.diff(run.time)])
    return None if np.abs(periods - period).max() <= EVEN * period else periods


def _by_name(filter: GaussianFilter, means: Array, covariances: Array) -> dict[str, Array]:  # noqa: A002
    """Smoothed estimates by their names."""
    n, variances = filter.model.states, covariances.diagonal(axis1=1, axis2=2)
    estimates = {
        "state": means[:, :n],
        "variance": variances[:, :n],
        "covariance": covariances[:, :n, :n],
    }
    if means.shape[1] > n:
        estimates["unknown_input"] = means[:, n:]
        estimates["unknown_input_variance"] = variances[:, n:]
        estimates["unknown_input_covariance"] = covariances[:, n:, n:]
        estimates[CROSS] = covariances[:, :n, n:]
    return estimates


@kernel
def _smooth(
    next_means: Array, next_covariances: Array, crosses: Array, means: Array, covariances: Array,
    periods: Array, root: Array, gain: Array, change: Array,
) -> int:  # fmt: skip
    """Smooth filtered means and covariances in place, and return the row that fails, or -1."""
    due = FIRST
    for back in range(len(next_means)):
        if back >= due:
            due = poll(back)
        k = len(next_means) - 1 - back
        if not take_root(next_covariances[k], root):
            return k
        # G(k) = cov(x(k), x(k+1)) P(k+1|k)^-1
        solve_by_root(root, crosses[k], gain)
        # x_s(k), P_s(k) from x_s(k+1), P_s(k+1)
        total = _smooth_row(
            means[k + 1], covariances[k + 1], next_means[k], next_covariances[k], means[k],
            covariances[k], periods, gain, change,
        )  # fmt: skip
        if not math.isfinite(total):
            return k
    return -1


@inlined_kernel
def _smooth_row(
    later_mean: Array, later_covariance: Array, next_mean: Array, next_covariance: Array,
    mean: Array, covariance: Array, periods: Array, gain: Array, change: Array,
) -> float:  # fmt: skip
    """Smooth a row by the later one, and return a sum that is finite if all of it is."""
    n, total = len(mean), 0.0
    # x_s(k) = x(k|k) + G (x_s(k+1) - x(k+1|k))
    for a in range(n):
        for i in range(n):
            mean[a] += gain[a, i] * shortest(later_mean[i] - next_mean[i], periods[i])
        total += mean[a]
    # T = G (P_s(k+1) - P(k+1|k))
    for a in range(n):
        for i in range(n):
            change[a, i] = 0.0
            for j in range(n):
                change[a, i] += gain[a, j] * (later_covariance[j, i] - next_covariance[j, i])
    # P_s(k) = P(k|k) + T G'
    for a in range(n):
        for b in range(a + 1):
            for i in range(n):
                covariance[a, b] += change[a, i] * gain[b, i]
            covariance[b, a] = covariance[a, b]
        total += covariance[a, a]
    return total


@kernel
def _smooth_late(
    lag: int, next_means: Array, next_covariances: Array, crosses: Array, means: Array,
    covariances: Array, late_means: Array, late_covariances: Array, some: Array, spreads: Array,
    periods: Array, root: Array, gain: Array, change: Array,
) -> int:  # fmt: skip
    """Write the smoothed row of each stretch of ``lag`` + 1, and return one that fails, or -1."""
    count = len(means)
    for k in range(count):
        last = min(k + lag, count - 1)
        size = last - k + 1
        # x_s(k) = E[x(k) | y(0), ..., y(k + lag)]
        for row in range(size):
            assign(some[row], means[k + row])
            assign_matrix(spreads[row], covariances[k + row])
        failed = _smooth(
            next_means[k:last], next_covariances[k:last], crosses[k:last], some[:size],
            spreads[:size], periods, root, gain, change,
        )  # fmt: skip
        if failed >= 0:
            return k + failed
        assign(late_means[k], some[0])
        assign_matrix(late_covariances[k], spreads[0])
    return -1

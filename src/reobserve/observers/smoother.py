"""The fixed-interval smoother of Rauch, Tung and Striebel (1965), for runs of Kalman filters.

    G(k) = cov(x(k), x(k+1)) P(k+1|k)^-1
    x_s(k) = x(k|k) + G (x_s(k+1) - x(k+1|k))
    P_s(k) = P(k|k) + G (P_s(k+1) - P(k+1|k)) G'

The cross-covariance is P A' of the Kalman filter and of the extended one (at the estimate of row
k), and that of the sigma points of the unscented one (Sarkka 2008).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.core.matrices import as_sample_rows
from reobserve.core.value import for_loop
from reobserve.observers.gaussian_filter import as_covariances
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.nonlinear_filter import NonlinearFilter
from reobserve.observers.nonlinear_filter_loop import predict_rows
from reobserve.observers.nonlinear_filter_work import new_filter_work
from reobserve.observers.run import Run, names_by_model
from reobserve.observers.unscented_kalman_loop import take_root

Array = NDArray[np.float64]


def rts_smoother(
    filter: KalmanFilter | NonlinearFilter,  # noqa: A002  # as filterpy calls it
    run: Run[Any],
    u: ArrayLike | None = None,
    *,
    Q: ArrayLike | None = None,
) -> Run[Any]:
    """Estimates at all samples of a run, each from the whole record.

    Parameters
    ----------
    filter
        The filter that made the run: a Kalman filter, extended or unscented Kalman filter.
    run
        Its run, with ``state`` and ``covariance``; where measurements are missing, too.
    u
        The inputs of the run, shape (k, p), or (k,); left out where there are none.
    Q
        The process noise that was given to the run, if it was: one covariance, or one a row.

    Returns
    -------
    Run
        With ``state``, (k, n), ``covariance``, (k, n, n), and ``variance``, (k, n), at the run's
        times. Its last row is the run's own, and so is the state to go on from.

    Raises
    ------
    InputError
        If the filter is another one, or the run or the inputs are not of it.
    DivergenceError
        If the prediction from a row is not finite, or its covariance is not positive semidefinite.
    """
    if not isinstance(filter, KalmanFilter | NonlinearFilter):
        raise InputError(
            "filter",
            f"{shown(filter)} must be a Kalman filter, extended or unscented Kalman filter",
        )
    n, k = filter.model.states, len(run) if isinstance(run, Run) else 0
    shapes = {"state": (k, n), "covariance": (k, n, n)}
    good = k and all(
        name in run.estimates and run[name].shape == shape for name, shape in shapes.items()
    )
    if not good:
        raise InputError(
            "run", f"{shown(run)} must be a run of the filter, with state and covariance of {n} "
            "states",
        )  # fmt: skip
    if u is None and filter.inputs:
        raise InputError("u", f"is left out, must have shape {(k, filter.inputs)}")
    inputs = np.empty((k, 0)) if u is None else as_sample_rows("u", u, filter.inputs, rows=k)
    if Q is None and run.state.process_noise is not None:
        raise InputError("Q", "is left out, but was given to the run; give the same here")
    noise = for_loop(filter.model.Q)[None] if Q is None else as_covariances("Q", Q, n, k)
    means, covariances = run["state"], run["covariance"]
    ahead = _predicted(filter, run, inputs, noise)
    smooth_means, smooth_covariances = means.copy(), covariances.copy()
    row = _smooth(*ahead, smooth_means, smooth_covariances)
    if row >= 0:
        raise DivergenceError(
            "rts_smoother", float(run.time[row]), "going backwards it fails there"
        )
    estimates = {
        "state": smooth_means,
        "variance": smooth_covariances.diagonal(axis1=1, axis2=2),
        "covariance": smooth_covariances,
    }
    return Run(
        run.time, estimates, dict.fromkeys(estimates, ""), run.state, run.diverged_at,
        missing=run.missing, component_names=names_by_model(filter.model),
    )  # fmt: skip


def _predicted(
    filter: KalmanFilter | NonlinearFilter,  # noqa: A002
    run: Run[Any],
    inputs: Array,
    noise: Array,
) -> tuple[Array, Array, Array]:
    """From each row but the last: the mean, its covariance, and the cross-covariance with x(k)."""
    means, covariances, n = run["state"][:-1], run["covariance"][:-1], filter.model.states
    if isinstance(filter, KalmanFilter):
        A, B = filter.model.A, filter.model.B
        # x = A x + B u, cov(x(k), x(k+1)) = P A', P = A P A' + Q
        crosses = covariances @ A.T
        ahead = A @ crosses + (noise[:-1] if len(noise) > 1 else noise)
        return means @ A.T + inputs[:-1] @ B.T, ahead, crosses
    next_means, next_covariances = np.empty(means.shape), np.empty(covariances.shape)
    crosses = np.empty(covariances.shape)
    rows = predict_rows(
        (0,) * n, filter.functions, filter.weights, noise, inputs,
        np.ascontiguousarray(means), np.ascontiguousarray(covariances),
        next_means, next_covariances, crosses, new_filter_work(n, filter.model.outputs),
    )  # fmt: skip
    filter.model.raise_problem()
    if rows < len(means):
        problem = "the prediction from there is not finite"
        raise DivergenceError("rts_smoother", float(run.time[rows]), problem)
    return next_means, next_covariances, crosses


@kernel
def _smooth(
    next_means: Array, next_covariances: Array, crosses: Array, means: Array, covariances: Array
) -> int:
    """Smooth filtered means and covariances in place; return the row that fails, or -1."""
    n = means.shape[1]
    root, gain, apart = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    for back in range(len(next_means)):
        k = len(next_means) - 1 - back
        if not take_root(next_covariances[k], root):
            return k
        _write_gain(root, crosses[k], gain)
        # x_s(k) = x(k|k) + G (x_s(k+1) - x(k+1|k))
        total = 0.0
        for a in range(n):
            for i in range(n):
                means[k, a] += gain[a, i] * (means[k + 1, i] - next_means[k, i])
            total += means[k, a]
        # P_s(k) = P(k|k) + G (P_s(k+1) - P(k+1|k)) G'
        for a in range(n):
            for i in range(n):
                apart[a, i] = 0.0
                for j in range(n):
                    difference = covariances[k + 1, j, i] - next_covariances[k, j, i]
                    apart[a, i] += gain[a, j] * difference
        for a in range(n):
            for b in range(a + 1):
                for i in range(n):
                    covariances[k, a, b] += apart[a, i] * gain[b, i]
                covariances[k, b, a] = covariances[k, a, b]
            total += covariances[k, a, a]
        if not np.isfinite(total):
            return k
    return -1


@inlined_kernel
def _write_gain(root: Array, cross: Array, gain: Array) -> None:
    """Solve G L L' = cov(x(k), x(k+1)): G L first, then G.

    Where P(k+1|k) = L L' is singular the cross-covariance is, too, and the gain is zero there.
    """
    n = len(root)
    for a in range(n):
        for i in range(n):
            total = cross[a, i]
            for j in range(i):
                total -= root[i, j] * gain[a, j]
            gain[a, i] = total / root[i, i] if root[i, i] > 0.0 else 0.0
        for last in range(n):
            i = n - 1 - last
            total = gain[a, i]
            for j in range(i + 1, n):
                total -= root[j, i] * gain[a, j]
            gain[a, i] = total / root[i, i] if root[i, i] > 0.0 else 0.0

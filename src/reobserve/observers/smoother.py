"""The fixed-interval smoother of Rauch, Tung and Striebel (1965), for runs of Kalman filters.

Covariances are smoothed by square roots, so that rounding makes no variance negative: from those of
P(k|k) and Q where the transition is a matrix, else from that of x(k+1) and x(k) together.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import DivergenceError, InputError, located, shown
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.observers.augmented_kalman import CROSS
from reobserve.observers.gaussian_state import FilterRows
from reobserve.observers.kalman import assign, assign_matrix, blocks, fill, shortest
from reobserve.observers.run import Run
from reobserve.systems.linear import ModelRows
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]

EPSILON = float(np.finfo(float).eps)
NOTHING = 1e-300  # squares below it have no digits


def rts_smoother(run: Run[Any], *, lag: int | None = None) -> Run[Any]:
    """Estimates at all samples of a run, each from the whole record, or from ``lag`` rows more.

        G(k) = cov(x(k), x(k+1)) P(k+1|k)^-1
        x_s(k) = x(k|k) + G (x_s(k+1) - x(k+1|k))
        P_s(k) = P(k|k) + G (P_s(k+1) - P(k+1|k)) G'

    The fixed-interval smoother of Rauch, Tung and Striebel (1965). The cross-covariance is P A' of
    the Kalman filter and of the extended one (at the estimate of row k), and that of the sigma
    points of the unscented one (Sarkka 2008). P_s is found by its square root (Park & Kailath
    1995), so that no variance is negative and a vague start loses no more digits than in the run.

    Parameters
    ----------
    run
        Of a Kalman filter, an extended or unscented one, or one augmented by unknown inputs, which
        needs ``keep`` of ``state_unknown_input_covariance``; of one record or of many.
    lag
        The fixed-lag smoother: a row is estimated from the rows up to ``lag`` after it, 1 to k.
        Left out, from all. The cost grows with it.

    Returns
    -------
    Run
        With ``state``, (k, n), ``covariance``, (k, n, n), and ``variance``, (k, n), at the run's
        times, and those of unknown inputs; of many records, (records, k, ...). Its last row is the
        run's own, and so is the state to go on from.

    Raises
    ------
    InputError
        If the run is of another observer, was smoothed, or lacks what ``keep`` would hold.
    DivergenceError
        If an estimate is not finite.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel, rts_smoother
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2)
    >>> kalman = KalmanFilter(model)
    >>> run = kalman.run([0.02, 0.11, 0.19, 0.29], start=kalman.init([0, 0], 1.0))
    >>> smoothed = rts_smoother(run)
    >>> print(run["variance"][0, 1].round(2), smoothed["variance"][0, 1].round(2))
    1.0 0.17

    """
    if not isinstance(run, Run) or run.source is None or not len(run):
        raise InputError(
            "run", f"{shown(run)} must be one of a Kalman filter, extended or unscented or "
            "augmented, of a row or more, and not smoothed yet",
        )  # fmt: skip
    later = None if lag is None else as_whole("lag", lag, 1, len(run))
    if type(run.source) is not tuple:
        estimates = _smoothed(run, later)
    else:
        estimates, records = {}, len(run.source)
        for r in range(records):
            one = run.record(r)
            with located(f"record {r}"):
                found = _smoothed(one, later) if len(one) else {}
            for name, values in found.items():
                shape = (records, len(run), *values.shape[1:])
                estimates.setdefault(name, np.full(shape, np.nan))[r, : len(one)] = values
    return replace(run, estimates=estimates, units=dict.fromkeys(estimates, ""), source=None)


def _smoothed(run: Run[Any], lag: int | None) -> dict[str, Array]:
    """Smoothed estimates of one record by their names."""
    filter, x, P = run.source.filter, run["state"], run["covariance"]  # noqa: A001
    keep = [CROSS] if CROSS in filter.keeps else []
    if keep:
        if CROSS not in run.estimates:
            raise InputError("run", f'has no {CROSS}: run the filter with keep=["{CROSS}"]')
        cross, rest = run[CROSS], run["unknown_input_covariance"]
        x = np.concatenate([x, run["unknown_input"]], axis=1)
        P = np.block([[P, cross], [cross.transpose(0, 2, 1), rest]])
    means, covariances = np.ascontiguousarray(x), np.ascontiguousarray(P)
    periods, n = filter._rules.state_periods, means.shape[1]
    ahead = _predicted(run, means, covariances)
    smooth_means, smooth_covariances = means.copy(), covariances.copy()
    shapes = (n, n), (n, n), (n, n), (2 * n, 2 * n), (3 * n, 2 * n), (n + 1, n), (n + 1, n), (n,)
    work = SmootherWork(*blocks((*shapes, (2 * n,), (2 * n,))))
    if lag is None:
        row = _smooth(*ahead, 0, smooth_means, smooth_covariances, periods, work)
    else:
        row = _smooth_late(
            lag, *ahead, means, covariances, smooth_means, smooth_covariances,
            np.empty((lag + 1, n)), np.empty((lag + 1, n, n)), periods, work,
        )  # fmt: skip
    if row >= 0:
        problem = "the smoothed estimate there is not finite"
        raise DivergenceError("rts_smoother", float(run.time[row]), problem)
    nothing: Any = [None] * 5
    rows = FilterRows(wrapped(smooth_means, periods), smooth_covariances, *nothing)
    named = filter._by_name(rows, None, keep).items()
    return {name: values for name, values in named if values is not None}


def _predicted(run: Run[Any], means: Array, covariances: Array) -> tuple[Any, Any, Any, Any, Any]:
    """Predictions from each row to the next one, as `_smooth` takes them first."""
    k, (filter, model, inputs) = len(means), run.source  # noqa: A001
    if isinstance(model, ModelRows):
        # x(k+1|k) = A x(k|k) + B u(k)
        A, B = (each[1:k] if len(each) > 2 else each[-1:] for each in (model.A, model.B))
        moved = A @ means[:-1, :, None] + B @ inputs[1:k, :, None]
        return moved[:, :, 0], model.A, model.Q, None, None
    model = model._replace(functions=filter.functions)
    moved, (spreads, crosses) = np.full(means.shape, np.nan), np.empty((2, *covariances.shape))
    ahead = moved[1:], spreads[1:], crosses[1:]
    extended = filter.method.extended and (model.parts == 1).all()
    given = model, filter.method, inputs, means, covariances, *ahead, filter._work()
    with RaisedAfterLoop():
        filter.steps.predict(*given, *([crosses[1:]] if extended else []))
    return ahead[0], *((crosses, model.Q, None, None) if extended else (None, None, *ahead[1:]))


class SmootherWork(NamedTuple):
    """Scratch: squares (n, n), ``joint`` (2 n, 2 n), ``stack`` (3 n, 2 n), then (n + 1, n).

    ``later`` has the root s' of P_s(k+1), and below it x_s(k+1) - x(k+1|k). ``before``, (n,), are
    the filter's variances at row k+1, ``rest`` and ``sums``, (2 n,), are of roots.
    """

    root: Array
    noise: Array
    transposed: Array
    joint: Array
    stack: Array
    later: Array
    solved: Array
    before: Array
    rest: Array
    sums: Array


@kernel
def _smooth(
    next_means: Array, transitions: Array | None, noises: Any, spreads: Array | None,
    crosses: Any, first: int, means: Array, covariances: Array, periods: Array,
    work: SmootherWork,
) -> int:  # fmt: skip
    """Smooth filtered means and covariances in place, and return the row that fails, or -1.

    They begin at row ``first`` of the record. Row k of ``next_means`` is x(k+1|k). Row k of
    ``transitions`` and ``noises`` are A and Q that lead to row k, the last ones those to later
    rows; where they are None, ``spreads`` are P(k+1|k), and ``crosses`` cov(x(k), x(k+1)).
    """
    due, last, n = FIRST, len(means) - 1, means.shape[1]
    _take_rows(covariances[last], work.later, work.rest)
    for i in range(n):
        work.before[i] = covariances[last, i, i]
    for back in range(last):
        if back >= due:
            due = poll(back)
        row = last - 1 - back
        k = first + row
        if transitions is not None:
            if back == 0 or len(transitions) > 1:
                A = transitions[min(k + 1, len(transitions) - 1)]
                for a in range(n):
                    for b in range(n):
                        work.transposed[b, a] = A[a, b]
            if back == 0 or len(noises) > 1:
                _take_rows(noises[min(k + 1, len(noises) - 1)], work.noise, work.rest)
            _stack_roots(covariances[row], work)
        if spreads is not None:
            _stack_joint(spreads[k], crosses[k], covariances[row], work)
        for i in range(n):
            difference = means[row + 1, i] - next_means[k, i]
            work.later[n, i] = shortest(difference, periods[i])
        if not math.isfinite(_smooth_row(means[row], covariances[row], work)):
            return row
    return -1


@inlined_kernel
def _take_rows(covariance: Array, root: Array, rest: Array) -> None:
    """Write W of P = W' W: Cholesky's factor with pivots, which leaves rows beyond the rank zero.

    ``rest``, (n,), is what is left of the variances.
    """
    n = len(covariance)
    for a in range(n):
        rest[a] = covariance[a, a]
    for j in range(n):
        share, pivot = n * EPSILON, -1
        for a in range(n):
            if rest[a] > share * covariance[a, a]:
                share, pivot = rest[a] / covariance[a, a], a
        fill(root[j], 0.0)
        if pivot < 0:
            continue
        # W_ja = (P_pa - sum_(i<j) W_ip W_ia) / W_jp,   W_jp^2 = P_pp - sum_(i<j) W_ip^2
        size = math.sqrt(rest[pivot])
        for i in range(j):
            for a in range(n):
                root[j, a] += root[i, pivot] * root[i, a]
        for a in range(n):
            root[j, a] = (covariance[pivot, a] - root[j, a]) / size if rest[a] > 0.0 else 0.0
            rest[a] -= root[j, a] * root[j, a]
        root[j, pivot], rest[pivot] = size, 0.0


@inlined_kernel
def _stack_roots(covariance: Array, work: SmootherWork) -> None:
    """Write a root of the covariance of x(k+1) and x(k) from those of P(k|k) and Q."""
    n, stack, root = len(covariance), work.stack, work.root
    # [p' A', p'; q', 0],   P(k|k) = p p',   Q = q q'
    _take_rows(covariance, root, work.rest)
    for r in range(n):
        for a in range(n):
            stack[r, a], stack[r, n + a] = 0.0, root[r, a]
            stack[n + r, a], stack[n + r, n + a] = work.noise[r, a], 0.0
        for j in range(n):
            if root[r, j] != 0.0:
                for a in range(n):
                    stack[r, a] += root[r, j] * work.transposed[j, a]


@inlined_kernel
def _stack_joint(spread: Array, cross: Array, covariance: Array, work: SmootherWork) -> None:
    """Write a root of the covariance of x(k+1) and x(k) from that itself."""
    n, joint = len(covariance), work.joint
    # [P(k+1|k), C'; C, P(k|k)],   C = cov(x(k), x(k+1))
    for a in range(n):
        for b in range(n):
            joint[a, b], joint[n + a, n + b] = spread[a, b], covariance[a, b]
            joint[a, n + b] = joint[n + b, a] = cross[b, a]
    _take_rows(joint, work.stack, work.rest)


@inlined_kernel
def _reflect(stack: Array, i: int, first: int, last: int, least: float, sums: Array) -> bool:
    """Make column i zero below row ``first`` by Householder's reflection of rows before ``last``.

    False if the sum of its squares there is not above ``least``.
    """
    width, total = stack.shape[1], 0.0
    for r in range(first, last):
        total += stack[r, i] * stack[r, i]
    if total <= least or total <= NOTHING:
        return False
    # v = m + sign(m_1) |m| e_1,   M = M - 2 v (v' M) / (v' v)
    lead, size = stack[first, i], math.copysign(math.sqrt(total), stack[first, i])
    stack[first, i] = lead + size
    for a in range(i + 1, width):
        sums[a] = 0.0
    for r in range(first, last):
        v = stack[r, i]
        if v != 0.0:
            for a in range(i + 1, width):
                sums[a] += v * stack[r, a]
    scale = 1.0 / (size * (lead + size))
    for a in range(i + 1, width):
        sums[a] *= scale
    for r in range(first, last):
        v = stack[r, i]
        if v != 0.0:
            for a in range(i + 1, width):
                stack[r, a] -= v * sums[a]
            stack[r, i] = 0.0
    stack[first, i] = -size
    return True


@inlined_kernel
def _solve(work: SmootherWork) -> int:
    """Reduce the stack to [L11', L21'; 0, L22'], solve with L11, and return its rank."""
    n, stack, later, solved, rank = len(work.before), work.stack, work.later, work.solved, 0
    # L11 L11' = P(k+1|k),   G = L21 L11^-1
    for i in range(n):
        # What is below the rounding of P(k+1|k+1) says nothing of x(k).
        if _reflect(stack, i, rank, 2 * n, 256.0 * n * EPSILON * work.before[i], work.sums):
            # z L11' = [s'; (x_s(k+1) - x(k+1|k))']
            for r in range(n + 1):
                value = later[r, i]
                for j in range(rank):
                    value -= solved[r, j] * stack[j, i]
                solved[r, rank] = value / stack[rank, i]
            rank += 1
    return rank


@inlined_kernel
def _smooth_row(mean: Array, covariance: Array, work: SmootherWork) -> float:
    """Smooth a row by ``work.later``, which becomes its own, and return a sum to be finite."""
    n, stack, later, solved = len(mean), work.stack, work.later, work.solved
    rank, total = _solve(work), 0.0
    # x_s(k) = x(k|k) + L21 z',   G s = L21 z'
    for r in range(n):
        fill(stack[2 * n + r], 0.0)
    for j in range(rank):
        for a in range(n):
            mean[a] += solved[n, j] * stack[j, n + a]
        for r in range(n):
            for a in range(n):
                stack[2 * n + r, n + a] += solved[r, j] * stack[j, n + a]
    # [L22'; (G s)'] = H [s'; 0],   P_s(k) = s s'
    pivot = rank
    for i in range(n):
        work.before[i] = covariance[i, i]
        if _reflect(stack, n + i, pivot, 3 * n, 0.0, work.sums):
            pivot += 1
    for r in range(n):
        for a in range(n):
            later[r, a] = stack[rank + r, n + a]
    for a in range(n):
        for b in range(a + 1):
            value = 0.0
            for r in range(b + 1):
                value += later[r, a] * later[r, b]
            covariance[a, b] = covariance[b, a] = value
        total += mean[a] + covariance[a, a]
    return total


@kernel
def _smooth_late(
    lag: int, next_means: Array, transitions: Array | None, noises: Any,
    spreads: Array | None, crosses: Any, means: Array, covariances: Array,
    late_means: Array, late_covariances: Array, some: Array, of_some: Array, periods: Array,
    work: SmootherWork,
) -> int:  # fmt: skip
    """Write the smoothed row of each stretch of ``lag`` + 1, and return one that fails, or -1."""
    count = len(means)
    for k in range(count):
        size = min(lag, count - 1 - k) + 1
        # x_s(k) = E[x(k) | y(0), ..., y(k + lag)]
        for row in range(size):
            assign(some[row], means[k + row])
            assign_matrix(of_some[row], covariances[k + row])
        failed = _smooth(
            next_means, transitions, noises, spreads, crosses, k, some[:size], of_some[:size],
            periods, work,
        )  # fmt: skip
        if failed >= 0:
            return k + failed
        assign(late_means[k], some[0])
        assign_matrix(late_covariances[k], of_some[0])
    return -1

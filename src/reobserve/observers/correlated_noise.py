"""Process and measurement noise that are correlated, taken out of a linear model.

    x(k+1) = A x(k) + B u(k) + w(k),  y(k) = C x(k) + D u(k) + v(k),  E[w v'] = S

With J = S R^-1 the noise w - J v is not correlated with v, and v is y - C x - D u:

    x(k+1) = (A - J C) x(k) + B u(k) + J (y(k) - D u(k)) + [w - J v]
    cov(w - J v) = Q - J S'

What of a row was not measured tells nothing of w: its columns of S and its rows of R are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve.observers.linear_steps import (
    LinearWork,
    factor_innovation,
    kalman_gain,
    new_linear_work,
)
from reobserve.systems.linear import ModelRows, as_matrices

Array = NDArray[np.float64]

_ROUNDING = 1e-10  # of a correlation: how far below zero an eigenvalue may be


class TakenOut(NamedTuple):
    """Parts that S takes out of the steps that lead to rows: J C, J S' and J (y - D u), by row."""

    transition: Array
    noise: Array
    known: Array


def uncorrelated(
    matrices: Mapping[str, Array], S: ArrayLike | None, y: Array, inputs: Array,
    before: Sequence[Array], open_end: bool,
) -> tuple[dict[str, Array], TakenOut]:  # fmt: skip
    """A model without S, and what is taken out of it, (k + 1, ...).

    Parameters
    ----------
    matrices
        Matrices by name, as `reobserve.systems.linear.LinearModel.by_row` finds them.
    S
        Shape (n, m), or (k, n, m). That of a row drives the step to the next one. None if the noise
        of this record is not correlated.
    y
        Measurements, shape (k, m); nan where one is missing.
    inputs
        That of the row before the record, then that of each row, shape (k + 1, p).
    before
        The last of what was taken out of the record before; empty if nothing was.
    open_end
        Whether the step from the last row is not known yet.

    Raises
    ------
    InputError
        If S has another shape, or is more than Q and R allow.
    """
    rows, n, m = len(y), matrices["A"].shape[1], y.shape[1]
    transition, noise = np.zeros((2, rows + 1, n, n))
    taken = TakenOut(transition, noise, np.zeros((rows + 1, n)))
    every = np.arange(rows + 1)
    A, Q = (matrices[name][np.minimum(every, len(matrices[name]) - 1)] for name in "AQ")
    for part, first in zip(taken, before, strict=False):
        part[0] = first
    if len(before):
        # In units of the noise, so that what is allowed does not depend on those of the states.
        sizes = np.sqrt(Q[0].diagonal())
        sizes[sizes == 0.0] = 1.0
        left = (Q[0] - taken.noise[0]) / np.outer(sizes, sizes)
        if np.linalg.eigvalsh(left)[0] < -_ROUNDING:
            raise InputError("S", "of the row before is more than Q of this step and R allow")
    if S is not None:
        crosses = as_matrices("S", S, (n, m), rows)
        _check(Q[1 : rows + (not open_end)], matrices["R"], crosses)
        model = ModelRows(*(np.ascontiguousarray(matrices[name]) for name in ModelRows._fields))
        _take_out(
            model, crosses, y, np.ascontiguousarray(inputs), taken, np.empty(m),
            new_linear_work(n, m),
        )  # fmt: skip
    return {**matrices, "A": A - taken.transition, "Q": Q - taken.noise}, taken


def _check(Q: Array, R: Array, S: Array) -> None:
    """Refuse an S for which noise of this Q and R cannot exist."""
    count, n = len(Q), S.shape[1]
    joint = np.zeros((count, n + S.shape[2], n + S.shape[2]))
    joint[:, :n, :n], joint[:, n:, n:] = Q, R[:count]
    joint[:, :n, n:], joint[:, n:, :n] = S[:count], S[:count].transpose(0, 2, 1)
    sizes = np.sqrt(joint.diagonal(axis1=1, axis2=2))
    sizes[sizes == 0.0] = 1.0
    low = np.linalg.eigvalsh(joint / (sizes[:, :, None] * sizes[:, None, :]))[:, 0]
    if count and low.min() < -_ROUNDING:
        place = f"row {int(np.argmin(low))}" if count > 1 else "it"
        problem = f"is more than Q and R allow: with {place} [[Q, S], [S', R]] is no covariance"
        raise InputError("S", problem)


@kernel
def _take_out(
    model: ModelRows, S: Array, y: Array, inputs: Array, taken: TakenOut, left: Array,
    work: LinearWork,
) -> None:  # fmt: skip
    """Write J C, J S' and J (y - D u) of the step from each row to the next one."""
    n, m = S.shape[1], S.shape[2]
    cross, gain, factor = work.cross, work.gain, work.factor
    for k in range(len(y)):
        C, D = model.C[min(k, len(model.C) - 1)], model.D[min(k, len(model.D) - 1)]
        R, both = model.R[min(k, len(model.R) - 1)], S[min(k, len(S) - 1)]
        # y - D u
        for o in range(m):
            left[o] = y[k, o]
            for p in range(D.shape[1]):
                left[o] -= D[o, p] * inputs[k + 1, p]
            for q in range(m):
                factor[o, q] = R[o, q]
        # J = S R^-1
        factor_innovation(left, factor, work)
        for a in range(n):
            for o in range(m):
                cross[a, o] = 0.0 if math.isnan(left[o]) else both[a, o]
        kalman_gain(work)
        for a in range(n):
            for o in range(m):
                if not math.isnan(left[o]):
                    taken.known[k + 1, a] += gain[a, o] * left[o]
            for b in range(n):
                total, spread = 0.0, 0.0
                for o in range(m):
                    total += gain[a, o] * C[o, b]
                    spread += gain[a, o] * cross[b, o]
                taken.transition[k + 1, a, b] = total
                if b <= a:
                    taken.noise[k + 1, a, b] = taken.noise[k + 1, b, a] = spread

"""Filters and a bank written plainly, with all that filters of the library take by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Gain = Callable[[Array, Array, Array, Array], Array]  # of C, P C', e and the last e(k|k)


@dataclass(frozen=True)
class Plain:
    """Matrices by row, those of A, B, Q and S from it to the next one, and settings of a filter.

    ``weight`` is T / memory, 0 where R is known; ``periods`` are those of states and outputs.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    Q: Array
    R: Array
    S: Array
    gain: Gain | None = None
    gate: float = np.inf
    inflates: bool = False
    weight: float = 0.0
    periods: tuple[Array, Array] = (np.zeros(1), np.zeros(1))


class Corrected(NamedTuple):
    """A row after its correction; R and S as they were used, and what it says of R."""

    x: Array
    P: Array
    innovation: Array
    outlier: Array
    log_likelihood: float
    R: Array
    S: Array
    learnt: Array


def round_(value: Array, periods: Array) -> Array:
    """Angles the shortest way round."""
    turns = np.divide(value, periods, out=np.zeros_like(value), where=periods > 0)
    return np.asarray(value - periods * np.floor(turns + 0.5) * (periods > 0))


def correct(
    one: Plain, k: int, x: Array, P: Array, y: Array, u: Array, variances: Array, error: Array
) -> Corrected:
    """The measurement update of row k; ``error`` is the last e(k|k), and is moved."""
    C, R, S = one.C[k], one.R[k].copy(), one.S[k].copy()
    if one.weight:
        ratio = np.sqrt(variances / R.diagonal())
        R, S = R * np.outer(ratio, ratio), S * ratio
    e = round_(y - C @ x - one.D[k] @ u, one.periods[1])
    spread, outlier = (C @ P @ C.T + R).diagonal(), np.zeros(len(y))
    for o in np.flatnonzero(np.abs(e) > one.gate * np.sqrt(spread)):
        outlier[o] = e[o] / np.sqrt(spread[o])
        if one.inflates:
            R[o, o] += (e[o] / one.gate) ** 2 - spread[o]
        else:
            e[o] = np.nan
    seen = ~np.isnan(e)
    learnt = np.zeros(len(y))
    if not seen.any():
        return Corrected(x, P, e, outlier, 0.0, R, S, learnt)
    M, V = C[seen], R[np.ix_(seen, seen)]
    whole = M @ P @ M.T + V
    inverse = np.linalg.inv(whole)
    K = P @ M.T @ inverse if one.gain is None else one.gain(C, P @ C.T, e, error)[:, seen]
    x = round_(x + K @ e[seen], one.periods[0])
    I_KC = np.eye(len(x)) - K @ M
    W = V @ inverse
    learnt[seen] = (W @ (np.outer(e[seen], e[seen]) - whole) @ W.T).diagonal()
    learnt[outlier != 0] = 0.0
    distance = e[seen] @ inverse @ e[seen] + np.linalg.slogdet(2 * np.pi * whole)[1]
    P = I_KC @ P @ I_KC.T + K @ V @ K.T
    error[seen] = round_(y - C @ x - one.D[k] @ u, one.periods[1])[seen]
    return Corrected(x, P, e, outlier, -0.5 * distance, R, S, learnt)


def weight_of_row(one: Plain, k: int) -> float:
    return max(one.weight, 1 / (k + 20)) if one.weight else 0.0


def run(one: Plain, y: Array, u: Array, x: Array, P: Array) -> dict[str, Array]:
    """A filter whose step to the next row is made from the joint posterior of x and w."""
    n, variances, error = len(x), one.R[0].diagonal().copy(), np.zeros(y.shape[1])
    rows: list[tuple[Any, ...]] = []
    for k in range(len(y)):
        prior = P
        now = correct(one, k, x, P, y[k], u[k], variances, error)
        variances = variances + weight_of_row(one, k) * now.learnt
        rows.append((now.x, now.P, now.innovation, now.log_likelihood, now.outlier, variances))
        # x(k+1) = [A I] [x; w] + B u
        joint = np.zeros((2 * n, 2 * n))
        joint[:n, :n], joint[n:, n:] = now.P, one.Q[k]
        mean = np.concatenate([now.x, np.zeros(n)])
        seen = ~np.isnan(now.innovation)
        if now.S.any() and seen.any():
            C, R, S = one.C[k][seen], now.R[np.ix_(seen, seen)], now.S[:, seen]
            cross = np.vstack([prior @ C.T, S])
            whole = C @ prior @ C.T + R
            joint[:n, :n] = prior
            joint -= cross @ np.linalg.solve(whole, cross.T)
            mean[n:] = S @ np.linalg.solve(whole, now.innovation[seen])
        both = np.hstack([one.A[k], np.eye(n)])
        x = round_(both @ mean + one.B[k] @ u[k], one.periods[0])
        P = both @ joint @ both.T
    names = "state", "covariance", "innovation", "log_likelihood", "outlier", "noise_variance"
    return {name: np.array(part) for name, part in zip(names, zip(*rows, strict=True), strict=True)}


def run_bank(
    modes: Sequence[Plain], transition: Array, mu: Array, y: Array, u: Array, x: Array, P: Array
) -> dict[str, Array]:
    """An interacting multiple model, whose gate leaves out what all modes would leave out."""
    r, gate = len(modes), modes[0].gate
    open_ = [replace(one, gate=np.inf) for one in modes]
    xs, Ps = [x] * r, [P] * r
    variances, errors = modes[0].R[0].diagonal().copy(), np.zeros((r, y.shape[1]))
    turn = modes[0].periods[0]
    rows: list[tuple[Any, ...]] = []

    def mixed(weights: Array) -> tuple[Array, Array]:
        about = xs[int(np.argmax(weights))]
        mean = about + sum(
            w * round_(one - about, turn) for w, one in zip(weights, xs, strict=True)
        )
        off = [round_(one - mean, turn) for one in xs]
        spreads = zip(weights, Ps, off, strict=True)
        return round_(mean, turn), sum(w * (one + np.outer(d, d)) for w, one, d in spreads)

    after: list[Corrected] = []
    for k in range(len(y)):
        if k:
            weights = transition * mu[:, None]
            mu = weights.sum(axis=0)
            starts = [mixed(weights[:, j] / mu[j]) for j in range(r)]
            moved = []
            for j, one in enumerate(modes):
                # J = S R^-1 of what was seen: (A - J C) x + B u + J (y - D u)
                m, P_j = starts[j]
                now, seen, C = after[j], ~np.isnan(after[j].innovation), one.C[k - 1]
                J = np.zeros_like(now.S)
                J[:, seen] = now.S[:, seen] @ np.linalg.inv(now.R[np.ix_(seen, seen)])
                left = round_(y[k - 1] - one.D[k - 1] @ u[k - 1] - C @ m, one.periods[1])
                m = one.A[k - 1] @ m + one.B[k - 1] @ u[k - 1] + J[:, seen] @ left[seen]
                F = one.A[k - 1] - J @ C
                spread = F @ P_j @ F.T + one.Q[k - 1] - J @ now.S.T
                moved.append((round_(m, turn), spread))
            xs, Ps = [m for m, _ in moved], [spread for _, spread in moved]
        taken, outlier = y[k].copy(), np.zeros(y.shape[1])
        if gate < np.inf:
            tried = [
                correct(replace(one, gate=1e-300), k, x, P, y[k], u[k], variances, np.zeros(2))
                for one, x, P in zip(modes, xs, Ps, strict=True)
            ]
            off = np.array([each.outlier for each in tried])
            least = off[np.argmin(np.abs(off), axis=0), np.arange(off.shape[1])]
            outlier = np.where(np.abs(least) > gate, least, 0.0)
            taken[outlier != 0] = np.nan
        parts = zip(open_, xs, Ps, errors, strict=True)
        after = [correct(one, k, x, P, taken, u[k], variances, e) for one, x, P, e in parts]
        xs, Ps = [now.x for now in after], [now.P for now in after]
        densities = mu * np.exp([now.log_likelihood for now in after])
        mu = densities / densities.sum()
        learnt = sum(share * now.learnt for share, now in zip(mu, after, strict=True))
        variances = variances + weight_of_row(modes[0], k) * learnt
        seen = not np.isnan(taken).all()
        rows.append((
            *mixed(mu), mu, [now.innovation for now in after],
            np.log(densities.sum()) if seen else 0.0, outlier, variances,
        ))  # fmt: skip
    names = (
        "state", "covariance", "probability", "innovation", "log_likelihood", "outlier",
        "noise_variance",
    )  # fmt: skip
    return {name: np.array(part) for name, part in zip(names, zip(*rows, strict=True), strict=True)}


def assert_alike(
    found: Mapping[str, Array], wanted: Mapping[str, Array], periods: Array, rtol: float = 1e-8
) -> None:
    """All that both have is the same, angles round."""
    for name in found:
        if name in wanted:
            a, b = found[name], wanted[name][..., : found[name].shape[-1]]
            if name == "covariance":
                b = b[..., : a.shape[-2], :]
            if name == "state":
                a = b + round_(a - b, np.broadcast_to(periods[: a.shape[-1]], a.shape))
            np.testing.assert_allclose(a, b, rtol=rtol, atol=1e-10, err_msg=name)

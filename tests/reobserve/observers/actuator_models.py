"""Models of the actuator, deterministic records, and the bank in 50-digit arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.discretisation import zero_order_hold
from reobserve.observers.contract import Observer
from reobserve.observers.run import Run
from reobserve.systems.linear import LinearModel, ModelArrays

Array = NDArray[np.float64]
Law = Callable[..., Any]

# (24) to (26): numerator and denominator of velocity over input.
ACTUATOR = {
    "normal": ([27.03, 9577, 1.87e6, 1.65e8], [535.20, 7.38e4, 6.08e6, 1.813e8]),
    "friction": ([11.29, 1883, 1.77e5, 6.61e6], [151.80, 1.28e4, 6.14e5, 1.07e7]),
    "leakage": ([2.34, 910.60, 1.63e5, 1.32e7], [116, 2.70e4, 1.41e6, 3.521e7]),
}
SCALE = 200.0  # [1/s], scale of time: in units of 1 / SCALE the states have similar size
STICKY = np.array([[0.96, 0.02, 0.02], [0.01, 0.95, 0.04], [0.03, 0.03, 0.94]])


def continuous(mode: str) -> tuple[Array, Array]:
    """A and B of the states v, x2, x3, x4, with x_i of the size of v's derivative over SCALE^i."""
    numerator, denominator = ACTUATOR[mode]
    markov: list[float] = []
    for b in numerator:
        markov.append(b - sum(a * h for a, h in zip(denominator, markov[::-1], strict=False)))
    powers = SCALE ** np.arange(4)
    A = SCALE * np.eye(4, k=1)
    A[3] = -np.array(denominator[::-1]) * powers / SCALE**3
    return A, (np.array(markov) / powers)[:, None]


def velocity_model(mode: str, R: float = 1e-4, Q: ArrayLike = 1e-6) -> LinearModel:
    """Four states, the velocity measured every 1 ms."""
    A, B = zero_order_hold(*continuous(mode), 1e-3)
    return LinearModel(A, B, np.eye(1, 4), Q=Q, R=R, sampling_period=1e-3)


def motion_model(mode: str, feedthrough: bool = True) -> LinearModel:
    """Five states; position, velocity and acceleration measured every 5 ms."""
    A, B = np.zeros((5, 5)), np.zeros((5, 1))
    A[0, 1] = SCALE
    A[1:, 1:], B[1:] = continuous(mode)
    H = np.zeros((3, 5))
    H[[0, 1, 2], [0, 1, 2]] = 1 / SCALE, 1.0, SCALE
    D = np.array([[0.0], [0.0], [B[1, 0]]]) if feedthrough else None
    Q, R = [3.4e-6, 4.8e-5, 3.4e-4, 3.2e-4, 2.8e-4], [4.6e-5, 2.5e-2, 70.0]
    return LinearModel(*zero_order_hold(A, B, 5e-3), H, Q=Q, R=R, D=D, sampling_period=5e-3)


def left_limit(model: LinearModel) -> LinearModel:
    """The model whose measurements contain the input up to a row, as a second column of u."""
    B, D = np.pad(model.B, ((0, 0), (0, 1))), np.pad(model.D, ((0, 0), (1, 0)))
    return replace(model, B=B, D=D)


def moved(model: LinearModel, T: Array) -> LinearModel:
    """The same model with the states T x."""
    A, B, H, D, Q, R = model.arrays
    back = np.linalg.inv(T)
    period = model.sampling_period
    Q = symmetric(T @ Q @ T.T)
    return LinearModel(T @ A @ back, T @ B, H @ back, Q=Q, R=R, D=D, sampling_period=period)


def symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


def square_wave(rows: int, half: int) -> Array:
    return np.where(np.arange(rows) // half % 2 == 0, 1.5, -1.5)[:, None]


def ripple(rows: int, columns: int = 1) -> Array:
    """As irregular as noise, within 1, but reproducible."""
    k = np.arange(1, rows + 1)[:, None]
    return np.sin(k**2 + 2.0 * np.arange(columns))


def simulated(model: LinearModel, controls: Array, start: ArrayLike | None = None) -> Array:
    """Noise-free measurements, shape (k, m), of a model driven by inputs up to each row.

    A row's measurement contains the input from that row on.
    """
    A, B, C, D = model.arrays[:4]
    x = np.zeros(len(A)) if start is None else np.array(start, dtype=float)
    rows = []
    for u, now in zip(controls, from_rows_on(controls), strict=True):
        x = A @ x + B @ u
        rows.append(C @ x + D @ now)
    return np.array(rows)


def run_over(
    observer: Observer[Any], z: Array, u: Array | None, *start: Any, **how: Any
) -> Run[Any]:
    """A run over steps that end at the rows of z, u held over each, from before the first one."""
    held = np.empty((len(z), 0)) if u is None else u
    begin = dict(zip(("mean", "covariance", "probabilities"), start, strict=False))
    return observer.run(z, from_rows_on(held), start=observer.init(**begin, u=held[0]), **how)


def from_rows_on(held: Array) -> Array:
    """The inputs from each row on; the last one is never read."""
    return np.vstack([held[1:], held[-1:]])


# --- 50 digits ----------------------------------------------------------------------------------


@dataclass
class Reference:
    """The results of a bank, shapes (k, n), (k, n, n), (k, r) and (k, r)."""

    estimate: Array
    covariance: Array
    probability: Array
    log_probability: Array


def exact(array: ArrayLike) -> Any:
    """A matrix, or a column, with every bit of its floats."""
    return mpmath.matrix(np.asarray(array, dtype=float).tolist())


def rounded(matrix: Any) -> Array:
    return np.array(matrix.tolist(), dtype=float)


def kalman_law(model: Any, covariance: Any, S: Any, e: Any, last: Any) -> Any:
    return covariance * model.C.T * S**-1


def switching_law(psi: Sequence[float], gamma: float) -> Law:
    """Equation (15) with the pseudo-inverse that is missing in print."""

    def law(model: Any, covariance: Any, S: Any, e: Any, last: Any) -> Any:
        H = model.C
        share = mpmath.diag(
            [
                (abs(e[o]) + mpmath.mpf(gamma) * abs(last[o]))
                * max(min(e[o] / mpmath.mpf(width), 1), -1)
                / e[o]
                for o, width in enumerate(psi)
            ]
        )
        return H.T * (H * H.T) ** -1 * share

    return law


def reference(
    models: Sequence[LinearModel],
    laws: Sequence[Law],
    transition: ArrayLike,
    mean: ArrayLike,
    covariance: Array,
    measurements: Array,
    controls: Array,
    *,
    mixing: bool = True,
) -> Reference:
    """Equations (7) to (23), corrected, from equal initial modes, in 50-digit arithmetic."""
    found: list[tuple[Array, Array, Array, Array]] = []
    with mpmath.workdps(50):
        r, p = len(models), exact(transition)
        bank = [ModelArrays(*(exact(part) for part in one.arrays)) for one in models]
        n, m = bank[0].A.rows, bank[0].C.rows
        x, P = [exact(mean)] * r, [exact(covariance)] * r
        error, mu = [mpmath.zeros(m, 1)] * r, [mpmath.mpf(1) / r] * r
        rows = measurements, controls, from_rows_on(controls)
        for z, u, now in zip(*(map(exact, part) for part in rows), strict=True):
            c = [mpmath.fsum(p[i, j] * mu[i] for i in range(r)) for j in range(r)]
            if mixing:
                weights = [[p[i, j] * mu[i] / c[j] for i in range(r)] for j in range(r)]
                x, P = zip(*(mixture(weights[j], x, P) for j in range(r)), strict=True)
            x, P, error = list(x), list(P), list(error)
            for j, (one, law) in enumerate(zip(bank, laws, strict=True)):
                x[j] = one.A * x[j] + one.B * u
                P[j] = one.A * P[j] * one.A.T + one.Q
                e = z - one.C * x[j] - one.D * now
                S = one.C * P[j] * one.C.T + one.R
                K = law(one, P[j], S, e, error[j])
                M = mpmath.eye(n) - K * one.C
                x[j] = x[j] + K * e
                P[j] = M * P[j] * M.T + K * one.R * K.T
                error[j] = z - one.C * x[j] - one.D * now
                exponent = -0.5 * (e.T * S**-1 * e)[0]
                mu[j] = c[j] * mpmath.exp(exponent) / mpmath.sqrt(mpmath.det(2 * mpmath.pi * S))
            whole = mpmath.fsum(mu)
            mu = [value / whole for value in mu]
            mean_of_all, spread = mixture(mu, x, P)
            found.append(
                (
                    rounded(mean_of_all)[:, 0],
                    rounded(spread),
                    np.array(mu, dtype=float),
                    np.array([mpmath.log(value) for value in mu], dtype=float),
                )
            )
    return Reference(*(np.array(part) for part in zip(*found, strict=True)))


def mixture(weights: Sequence[Any], means: Sequence[Any], covariances: Sequence[Any]) -> Any:
    """Mean and covariance of a weighted sum of densities, (9) and (10), (22) and (23)."""
    mean = sum((w * x for w, x in zip(weights, means, strict=True)), 0 * means[0])
    spread = 0 * covariances[0]
    for w, x, P in zip(weights, means, covariances, strict=True):
        spread = spread + w * (P + (x - mean) * (x - mean).T)
    return mean, spread

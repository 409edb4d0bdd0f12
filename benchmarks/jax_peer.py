"""A Kalman filter as it is written in JAX, which is a peer where it is installed."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

INSTALLED = find_spec("jax") is not None


def correct_and_predict(model: LinearModel) -> Callable[[Any, Any], Any]:
    """The step from a predicted mean and covariance to the next, by a row (y, u)."""
    import jax

    jax.config.update("jax_enable_x64", True)
    A, B, C, _, Q, R = map(jax.numpy.asarray, model.arrays)

    def step(predicted: Any, row: Any) -> Any:
        (x, P), (y, u) = predicted, row
        factor = jax.scipy.linalg.cho_factor(C @ P @ C.T + R)
        K = jax.scipy.linalg.cho_solve(factor, C @ P).T
        M = jax.numpy.eye(len(x)) - K @ C
        x, P = x + K @ (y - C @ x), M @ P @ M.T + K @ R @ K.T
        return (A @ x + B @ u, A @ P @ A.T + Q), x

    return step


def by_jax(model: LinearModel, y: Array, u: Array) -> Callable[[], Array]:
    """The estimates of a record from zero, covariance 1, by one compiled loop."""
    import jax

    step, n = correct_and_predict(model), model.states
    loop = jax.jit(lambda y, u: jax.lax.scan(step, (np.zeros(n), np.eye(n)), (y, u))[1])
    return lambda: np.asarray(loop(y, u))


def one_call(model: LinearModel) -> Callable[[], None]:
    """One compiled step, which goes on from the last."""
    import jax

    step, n = jax.jit(correct_and_predict(model)), model.states
    latest: list[Any] = [(np.zeros(n), np.eye(n))]
    row = np.ones(1), np.ones(1)

    def call() -> None:
        latest[0] = jax.block_until_ready(step(latest[0], row))[0]

    return call

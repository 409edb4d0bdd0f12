"""The plants, and the observer as a plain linear system, that the benchmark of designs shares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve_papers.signals.random_streams import random_stream

Array = NDArray[np.float64]

PERIOD = 1e-3  # [s]

_OUTPUTS = 2
_SEED = 1  # the first whose plants, up to 24 states, all allow a gamma of 1.05 times its floor


def plant(states: int) -> AugmentedSystem:
    """A stable random plant, with a fault of its actuator and one of its first sensor."""
    stream = random_stream(_SEED, "benchmark", "designs", str(states))
    A = stream.standard_normal((states, states)) / np.sqrt(states)
    slowest = np.linalg.eigvals(A).real.max()
    actuator = np.eye(states, 1, 1 - states)
    return AugmentedSystem(
        A=A - (0.5 + slowest) * np.eye(states),
        B=actuator,
        C=stream.standard_normal((_OUTPUTS, states)),
        Dd=stream.standard_normal((states, 1)),
        Dw=stream.standard_normal((_OUTPUTS, 1)),
        Fa=actuator,
        Fs=np.eye(_OUTPUTS, 1),
    )


def linear_system(system: AugmentedSystem, gains: Gains) -> tuple[Array, Array, Array, Array]:
    """The observer from [y, u] to the estimate of x, fa and fs, as a peer would be given it.

    Its states are xz and zeta = Eo x^ - Ld xz, not those that the library samples:
    zeta' = Ao x^ + B~ u + L xz.
    """
    Ao, Eo = error_system(system, gains)
    p, m, size, n = system.outputs, system.B.shape[1], system.size, system.states
    rates = np.linalg.solve(Eo.T, Ao.T).T
    A = np.block([[-system.Az, np.zeros((p, size))], [gains.L + rates @ gains.Ld, rates]])
    B = np.zeros((p + size, p + m))
    B[:p, :p] = system.Az
    B[p : p + n + p, p:] = system.Ba
    estimate = np.linalg.solve(Eo, np.hstack([gains.Ld, np.eye(size)]))
    C = np.delete(estimate, np.s_[n : n + p], axis=0)  # without that of xz
    return A, B, C, np.zeros((len(C), p + m))


def record(samples: int) -> tuple[Array, Array]:
    """Measurements, shape (k, 2), and controls, shape (k, 1), of unit size."""
    stream = random_stream(_SEED, "benchmark", "designs", "record")
    return stream.standard_normal((samples, _OUTPUTS)), stream.standard_normal((samples, 1))

"""Models shared by several calls."""

from __future__ import annotations

import numpy as np

from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.systems.linear import LinearModel
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.polynomial import PolynomialSystem

INERTIA = np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
TRANSITION = np.array([[1.0, 0.01], [-0.01, 0.99]])
VAN_DER_POL = ["-w", "a - (1 - a**2)*w"]  # in reversed time, so that the origin is stable
HALF = np.linspace(0.0, 0.2, 41)  # two samples a step of 0.01 s


def linear_model() -> LinearModel:
    """Two states, one input, one output."""
    return LinearModel(TRANSITION, [[0.0], [0.01]], [[1.0, 0.0]], Q=1e-4, R=1e-2)


def swing() -> NonlinearModel:
    """A pendulum as text: two states, one input, one output."""
    return NonlinearModel.from_ode(
        ["rate", "torque - 9.81*sin(angle)"], "angle", Q=1e-4, R=1e-2,
        state_names=["angle", "rate"],
        input_names=["torque"], sampling_period=0.01,
    )  # fmt: skip


def van_der_pol(dynamics: list[str] = VAN_DER_POL) -> PolynomialSystem:
    """Van der Pol's equation."""
    return PolynomialSystem.from_expressions(dynamics, ["a"], ["a", "w"], 3)


def augmented() -> AugmentedSystem:
    """The motor of the README."""
    return AugmentedSystem(
        A=np.array([[-10.0, 1.0], [-0.02, -2.0]]), B=np.array([[0.0], [2.0]]), C=np.eye(2),
        Dd=np.diag([1.0, 2.0]), Dw=np.array([[1.0], [0.0]]), Fa=np.array([[0.0], [2.0]]),
        Fs=np.array([[1.0], [0.0]]),
    )  # fmt: skip


def gains() -> Gains:
    """Gains of a Riccati equation that make a PI observer of `augmented` stable."""
    from scipy.linalg import solve_continuous_are

    system = augmented()
    P = solve_continuous_are(system.A_tilde.T, system.C_tilde.T, np.eye(system.size), np.eye(2))
    return Gains(P @ system.C_tilde.T, np.zeros((system.size, 2)))

"""Numbers for which no design or result exists, each refused naming the argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cvxpy
import numpy as np
import pytest
import scipy.linalg

from reobserve.core.errors import InputError
from reobserve.observers.normal_form import normal_form_observer
from reobserve.synthesis.extended_state import central_path
from reobserve.synthesis.extended_state import pd_pi as extended
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.gamma_bound import as_gamma
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.system import Gains
from reobserve.synthesis.ilo_accuracy import error_transfer, predicted_rms_error
from reobserve.synthesis.ilo_certificate import bound18, certify
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain, sampled_map
from reobserve.synthesis.ilo_stability import continuous_stability
from reobserve.synthesis.linear_gain import steady_kalman_gain
from reobserve.systems.linear import LinearModel
from tests.reobserve.synthesis.plants import dc_motor

MOTOR = dc_motor()  # of six errors and two outputs
GAINS = Gains(np.zeros((6, 2)), np.zeros((6, 2)))
ONE_AXIS: dict[str, Any] = {
    "inertia": 1.0, "observer_gain": 1.0, "fault_matrix": 1.0, "K1": 0.5, "K2": 1.0,
}  # fmt: skip


def law(**changed: float) -> LearningLaw:
    return LearningLaw(**{**ONE_AXIS, "update_interval": 0.1, **changed})


def learned(**changed: float) -> Callable[[], Any]:
    """The certificate of Theorem 1 for three equal axes."""
    usual: dict[str, Any] = {"observer_gain": 1.0, "fault_matrix": 1.0, "K1": 0.5, "K2": 0.1}
    return lambda: certify(**{**usual, **changed})


DYNAMICS = "K1, K2: make error dynamics beyond floating-point numbers"
SQUARE = "is so large that its square is beyond floating-point numbers"
REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "gains of another shape": (
        lambda: error_system(MOTOR, Gains(np.zeros((2, 2)), GAINS.Ld)),
        "L: has shape (2, 2), must be (6, 2)",
    ),
    "gains of a derivative of another shape": (
        lambda: error_system(MOTOR, Gains(GAINS.L, np.zeros((6, 1)))),
        "Ld: has shape (6, 1), must be (6, 2)",
    ),
    "a large gamma": (
        lambda: as_gamma(MOTOR, 2.0, 1e150),
        "gamma: asks for a gamma of 1e+150, whose square is no float",
    ),
    "a small gamma": (
        lambda: as_gamma(MOTOR, 2.0, 1e-150),
        "gamma: asks for a gamma of 1e-150, whose square is no float",
    ),
    "a large factor": (
        lambda: as_gamma(MOTOR, 1e150),
        "factor: asks for a gamma of 1.00504e+150, whose square is no float",
    ),
    "phases of another shape": (
        lambda: predicted_rms_error([[1.0]], [1.0], law(), phases=[[0.0, 1.0]]),
        "phases: has shape (1, 2), must be one number or (1, 1)",
    ),
    "another variant": (
        lambda: predicted_rms_error([[1.0]], [1.0], law(), variant="held"),
        "variant: 'held' must be one of continuous, sampled",
    ),
    "a response beyond numbers": (lambda: error_transfer([0.0], law(K1=1e308, K2=1e308)), DYNAMICS),
    "a map beyond numbers": (lambda: sampled_map(law(fault_matrix=1e200, K2=1e200)), DYNAMICS),
    "an interval of very fast errors": (
        lambda: sampled_limit_gain(law(inertia=1e-300)),
        "inertia, observer_gain: make error dynamics too fast for floating-point numbers",
    ),
    "a pencil beyond numbers": (lambda: sampled_limit_gain(law(K1=1e300)), DYNAMICS),
    "a loop beyond numbers": (
        lambda: continuous_stability(law(fault_matrix=1e200, K2=1e200)), DYNAMICS,
    ),
    "a round trip beyond numbers": (
        lambda: continuous_stability(law(K1=1e308, K2=1e308)), DYNAMICS,
    ),
    "a large fault matrix of Theorem 1": (learned(fault_matrix=1e76), f"fault_matrix: {SQUARE}"),
    "a large K1 of Theorem 1": (learned(K1=1e150), f"K1: {SQUARE}"),
    "a large K2 of Theorem 1": (learned(K2=1e150), f"K2: {SQUARE}"),
    "an output that shows one of three states": (
        lambda: normal_form_observer(
            ["-x1", "-2*x2", "-3*x3"], ["x1"], ["x1", "x2", "x3"], order=1,
            sampling_period=0.1, poles=[-4, -5, -6],
        ),
        "poles: -6+0j, -5+0j, -4+0j cannot be placed, -2",
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("case", REFUSED)
def test_invalid_numbers_are_refused_naming_the_argument(case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(said)


def test_largest_numbers_of_theorem_1_and_gamma_are_accepted() -> None:
    assert learned(K1=0.99e150)().dc_error == pytest.approx(1.0)  # K1 / (K1 + K2 / Lambda)
    assert as_gamma(MOTOR, 2.0, 0.99e150) == 0.99e150
    with pytest.raises(InputError, match=r"^gamma: 1\.1e-150 must be above 1\.005"):
        as_gamma(MOTOR, 2.0, 1.1e-150)


def test_negative_mismatch_bound_is_refused() -> None:
    theorem = certify(3.0, 1.0, 0.5, 0.5).theorem
    assert theorem is not None
    with pytest.raises(InputError, match=r"^k_d: -1e-09 must not be below zero$"):
        bound18(theorem, np.ones((3, 3)), np.ones((3, 3)), -1e-9)
    assert bound18(theorem, np.ones((3, 3)), np.ones((3, 3)), 0.0)[1] == 0.0


def test_riccati_equation_without_a_float_solution_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: Any) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(scipy.linalg, "solve_discrete_are", fail)
    with pytest.raises(InputError, match=r"^model: has modes too near to the unit circle, or too"):
        steady_kalman_gain(LinearModel([[0.5]], [[1.0]], [[1.0]], Q=1.0, R=1.0))


def test_solver_failure_is_reported_as_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(_: Any) -> None:
        raise np.linalg.LinAlgError

    with monkeypatch.context() as changed:
        changed.setattr(PdPiVariables, "gains", singular)
        with pytest.raises(InputError, match=r"^solver: CLARABEL said optimal, but P has no inver"):
            extended.design(MOTOR)
    with monkeypatch.context() as changed:
        changed.setattr(central_path, "_centred", lambda *_: None)
        with pytest.raises(InputError, match=r"^solver: found matrices from which Newton's method"):
            extended.design(MOTOR)

    def fail(*_: Any, **__: Any) -> None:
        raise cvxpy.SolverError("Solver failed.\nTry another.")

    monkeypatch.setattr(cvxpy.Problem, "solve", fail)
    with pytest.raises(InputError, match=r"^solver: CLARABEL failed: Solver failed; a larger"):
        extended.design(MOTOR)

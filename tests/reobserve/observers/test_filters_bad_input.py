"""Invalid arguments are refused in one sentence that names the key and the value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.actuator_models import continuous, motion_model, velocity_model

NAN, INF = float("nan"), float("inf")
MODEL: dict[str, Any] = {
    "A": [[1.0, 0.1], [0.0, 0.9]],
    "B": [[0.0], [0.1]],
    "C": [[1.0, 0.0]],
    "Q": 0.01,
    "R": 0.1,
}
PLAIN = LinearModel(**MODEL)
NORMAL, MOTION = velocity_model("normal"), motion_model("normal")
NO_INPUT = LinearModel([[1.0]], np.empty((1, 0)), [[1.0]], Q=0.1, R=1.0)


def bank(size: int = 2) -> IMM:
    chain = np.full((size, size), 1 / size)
    return IMM([KalmanFilter(PLAIN)] * size, chain)


# --- Models -------------------------------------------------------------------------------------

DISCRETE = "it must be the transition over one sample"


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"A": [[1.0, 0.1]]}, r"A: has shape \(1, 2\), must be square"),
        ({"A": 0.5}, r"A: has shape \(\), must be square"),
        ({"A": np.empty((0, 0))}, r"A: has shape \(0, 0\), must be square"),
        ({"B": [0.0, 0.1]}, r"B: has shape \(2,\), must be \(2, p\), as A is \(2, 2\)"),
        ({"B": [[0.1]]}, r"B: has shape \(1, 1\), must be \(2, p\), as A is \(2, 2\)"),
        ({"C": [[1.0]]}, r"C: has shape \(1, 1\), must be \(m, 2\), as A is \(2, 2\)"),
        (
            {"C": np.empty((0, 2))},
            r"C: has shape \(0, 2\), must be \(m, 2\), as A is \(2, 2\)",
        ),
        ({"D": [1.0]}, r"D: has shape \(1,\), must be \(1, 1\), as C and B ask for"),
        ({"Q": [[1.0, 0.2], [0.1, 1.0]]}, r"Q: \[\[1.0, 0.2\], \[0.1, 1.0\]\] must be symmetric"),
        (
            {"Q": [[1.0, 2.0], [2.0, 1.0]]},
            "Q: must be positive semidefinite, its eigenvalues are -1, 3",
        ),
        ({"Q": -1e-9}, "Q: must be positive semidefinite, its eigenvalues are -1e-09, -1e-09"),
        ({"Q": [1.0, 2.0, 3.0]}, r"Q: has shape \(3,\), must be one number .*"),
        ({"R": -2.0}, "R: must be positive semidefinite, its eigenvalues are -2"),
        ({"R": INF}, "R: inf has an entry that is not finite"),
        ({"C": None}, "C: is missing: a linear model needs A, C, Q and R"),
        ({"Q": None}, "Q: is missing: a linear model needs A, C, Q and R"),
        ({"R": None}, "R: is missing: a linear model needs A, C, Q and R"),
        ({"sampling_period": 0.0}, "sampling_period: 0 must be greater than zero"),
    ],
)
def test_wrong_models_are_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        LinearModel(**{**MODEL, **changed})


def test_covariance_of_several_outputs_is_checked() -> None:
    A, B, H, D, Q, R = MOTION.arrays
    skew = R.copy()
    skew[0, 1] = 1e-6
    with pytest.raises(InputError, match=r"^R: .* must be symmetric$"):
        LinearModel(A, B, H, Q=Q, R=skew, D=D)
    with pytest.raises(InputError, match=r"^R: must be .* are -1, 1, 1"):
        LinearModel(A, B, H, Q=Q, R=[1.0, -1.0, 1.0], D=D)


def test_rounding_asymmetry_of_a_covariance_is_removed() -> None:
    turn = np.array([[0.3, 1.7], [-2.1, 0.6]])
    Q = turn @ np.diag([1.0, 1e-3]) @ turn.T
    Q[0, 1] = np.nextafter(Q[1, 0], np.inf)
    held = LinearModel(**{**MODEL, "Q": Q}).Q
    assert np.array_equal(held, held.T)
    assert held == pytest.approx(Q, rel=1e-15)
    Q[0, 1] += 1e-9
    with pytest.raises(InputError, match=r"^Q: .* must be symmetric$"):
        LinearModel(**{**MODEL, "Q": Q})


def test_matrices_of_a_model_are_read_only_copies() -> None:
    A = np.array(MODEL["A"])
    model = LinearModel(**{**MODEL, "A": A})
    A[0, 0] = 5.0
    assert model.A[0, 0] == 1.0
    for matrix in (model.A, model.B, model.C, model.D, model.Q, model.R):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 5.0


def test_semidefinite_covariance_is_accepted_up_to_rounding() -> None:
    direction = np.array([[0.1], [0.3]])
    Q = direction @ direction.T
    assert np.array_equal(LinearModel(**{**MODEL, "Q": Q}).arrays.Q, Q)
    assert not LinearModel(**{**MODEL, "Q": 0.0}).arrays.Q.any()


@pytest.mark.parametrize(
    ("A", "eigenvalue"),
    [
        ([[0.0, 1.0], [-2.0, -3.0]], "-2"),
        ([[0.0, 1.0], [0.0, 0.0]], "0"),
        ([[0.0, 1.0], [-4.0, 0.0]], r"-?0[+-]2j"),
        ([[0.5, 0.0], [0.0, -1.5]], "-1.5"),
        ([[-0.5, 1.0, 0.0], [-1.0, -0.5, 0.0], [0.0, 0.0, -0.8]], r"-0.5[+-]1j"),
        (continuous("normal")[0], r"-379.7"),
        (continuous("leakage")[0], r"-.*j"),
    ],
    ids=["stable", "integrators", "oscillator", "flips", "spirals", "normal", "leakage"],
)
def test_continuous_time_transition_is_refused(A: Any, eigenvalue: str) -> None:
    n = len(A)
    given = {"A": A, "B": np.zeros((n, 1)), "C": np.eye(1, n), "Q": 0.1, "R": 1.0}
    said = f"A: has the eigenvalue {eigenvalue}, as A of continuous time has; {DISCRETE}"
    with pytest.raises(InputError, match=rf"^{said} \(sample it by zero_order_hold, .*\)$"):
        LinearModel(**given)
    assert LinearModel(**given, check=False).states == n
    sampled = zero_order_hold(A, given["B"], 1e-3)[0]
    assert LinearModel(**{**given, "A": sampled}).states == n


def test_continuous_time_model_with_a_zero_eigenvalue_is_refused() -> None:
    A = np.zeros((5, 5))
    A[0, 1], A[1:, 1:] = 200.0, continuous("normal")[0]
    with pytest.raises(InputError, match=r"^A: has the eigenvalue -379.7, as"):
        LinearModel(A, np.zeros((5, 1)), np.eye(3, 5), Q=0.1, R=1.0)


@pytest.mark.parametrize(
    ("A", "B", "period", "said"),
    [
        ([[1.0, 2.0]], [[1.0]], 0.1, r"A: has shape \(1, 2\), must be square"),
        ([[1.0]], [1.0], 0.1, r"B: has shape \(1,\), must have 1 rows like A"),
        ([[1.0]], [[1.0], [2.0]], 0.1, r"B: has shape \(2, 1\), must have 1 rows like A"),
        ([[1.0]], [[1.0]], 0.0, "period: 0 must be greater than zero"),
        ([[1.0]], [[1.0]], -1.0, "period: -1 must be greater than zero"),
    ],
)
def test_model_that_cannot_be_sampled_is_refused(A: Any, B: Any, period: float, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        zero_order_hold(A, B, period)


# --- Filters ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"boundary_layer": 0.0}, r"boundary_layer: \[0.0, 0.0, 0.0\] must all be greater .*"),
        ({"boundary_layer": [1, -2, 3]}, r"boundary_layer: \[1.0, -2.0, 3.0\] must all be .* zero"),
        ({"boundary_layer": [1, 2]}, r"boundary_layer: has shape \(2,\), must be a list of 3 .*"),
        ({"convergence_rate": 1.0}, "convergence_rate: 1 must be from 0 to below 1"),
        ({"convergence_rate": -0.1}, "convergence_rate: -0.1 must be from 0 to below 1"),
        (
            {"convergence_rate": [0.1]},
            r"convergence_rate: \[0.1\] must be one number, not an array of shape \(1,\)",
        ),
    ],
)
def test_wrong_boundary_layer_or_convergence_rate_is_refused(
    changed: dict[str, Any], said: str
) -> None:
    given: dict[str, Any] = {"boundary_layer": 1.0, "convergence_rate": 0.1, **changed}
    with pytest.raises(InputError, match=f"^{said}$"):
        SmoothVariableStructureFilter(MOTION, **given)


def test_svsf_with_dependent_outputs_is_refused() -> None:
    twice = LinearModel(**{**MODEL, "C": [[1.0, 2.0], [2.0, 4.0]]})
    said = r"^model: C has 2 rows but rank 1: no gain corrects all outputs at once$"
    with pytest.raises(InputError, match=said):
        SmoothVariableStructureFilter(twice, boundary_layer=1.0, convergence_rate=0.1)
    more = LinearModel(**{**MODEL, "C": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]})
    with pytest.raises(InputError, match=r"^model: C has 3 rows but rank 2: "):
        SmoothVariableStructureFilter(more, boundary_layer=1.0, convergence_rate=0.1)


@pytest.mark.parametrize(
    ("mean", "covariance", "said"),
    [
        ([0.0], 1.0, r"mean: has shape \(1,\), must be a list of 2 numbers"),
        ([0.0, INF], 1.0, r"mean: \[0.0, inf\] has an entry that is not finite"),
        ([0.0, 0.0], -1.0, "covariance: must be positive semidefinite, its .* are -1, -1"),
        ([0.0, 0.0], [[1.0, 0.0], [0.5, 1.0]], r"covariance: \[\[.*\]\] must be symmetric"),
        ([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], "covariance: must be positive .* are -1, 3"),
    ],
)
def test_wrong_posteriors_are_refused(mean: Any, covariance: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        KalmanFilter(PLAIN).init(mean, covariance)


def test_wrong_samples_of_a_correction_are_refused() -> None:
    kalman = KalmanFilter(PLAIN)
    posterior = kalman.init([0.0, 0.0], 1.0).posterior
    with pytest.raises(InputError, match=r"^y: has shape \(1, 2\), must have"):
        kalman.correct(posterior, [1.0, 2.0], [0.0])
    with pytest.raises(InputError, match=r"^u: \[nan\] has an entry that is not finite$"):
        kalman.predict(posterior, [NAN])
    with pytest.raises(InputError, match=r"^u: has shape \(0,\), must be a list of 1 number"):
        kalman.correct(posterior, [1.0])


@pytest.mark.parametrize(
    ("u", "said"),
    [
        ([0.0, 1.0], r"u: has shape \(1, 2\), must have one row or more of 1 number"),
        ([NAN], r"u: sample 0 is \[nan\], must be finite"),
        ((), r"u: has shape \(1, 0\), must have one row or more of 1 number"),
        ("on", "u: 'on' is no array of numbers"),
    ],
)
def test_invalid_input_before_the_first_row_is_refused(u: Any, said: str) -> None:
    for one in (KalmanFilter(PLAIN), bank()):
        with pytest.raises(InputError, match=f"^{said}$"):
            one.init([0.0, 0.0], 1.0, u=u)


def test_missing_state_and_state_of_another_filter_are_refused() -> None:
    # A compiled loop would read and write out of bounds.
    kalman = KalmanFilter(PLAIN)
    with pytest.raises(InputError, match=r"^start: must be given: KalmanFilter.init says what it"):
        kalman.run([[1.0]], [[0.0]])
    other = KalmanFilter(NO_INPUT).init([0.0], 1.0)
    said = (
        r"posterior: has arrays of shapes \(\(1,\), \(1, 1\), \(1,\)\), "
        r"must be of 2 states, 1 outputs$"
    )
    with pytest.raises(InputError, match=rf"^start\.{said}"):
        kalman.run([[1.0]], [[0.0]], start=other)
    with pytest.raises(InputError, match=f"^{said}"):
        kalman.predict(other.posterior, [0.0])
    with pytest.raises(InputError, match=f"^{said}"):
        kalman.correct(other.posterior, [1.0], [0.0])
    state = bank(2).init([0.0, 0.0], 1.0)
    with pytest.raises(InputError, match=r"must be of 3 filters of 2 states and 1 outputs$"):
        bank(3).run([[1.0]], [[0.0]], start=state)
    filters = IMM([KalmanFilter(NO_INPUT)] * 2, np.eye(2))
    with pytest.raises(InputError, match=r"^start: has arrays of shapes \(2, 2\)"):
        filters.run([[1.0]], start=state)


# --- Banks --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("transition", "said"),
    [
        (
            [[0.9, 0.2], [0.1, 0.9]],
            r"\[0\]: \[0.9, 0.2\] must be 0 or more and sum to 1, not 1.1",
        ),
        (  # columns that sum to one: the transpose of what is asked for
            [[0.9, 0.3], [0.1, 0.7]],
            r"\[0\]: \[0.9, 0.3\] must be 0 or more and sum to 1, not 1.2",
        ),
        (
            [[0.9, 0.1], [-0.1, 1.1]],
            r"\[1\]: \[-0.1, 1.1\] must be 0 or more and sum to 1, not 1",
        ),
        ([[0.9, 0.1], [0.0, 0.0]], r"\[1\]: \[0.0, 0.0\] must be 0 or more and sum to 1, not 0"),
        ([[1.0]], r": has shape \(1, 1\), must be \(2, 2\)"),
        (0.95, r": has shape \(\), must be \(2, 2\)"),
    ],
)
def test_wrong_transitions_are_refused(transition: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^transition{said}$"):
        IMM([KalmanFilter(PLAIN)] * 2, transition)


def test_empty_bank_and_filters_of_different_sizes_are_refused() -> None:
    with pytest.raises(InputError, match=r"^filters: \[\] must be a list of one filter or more$"):
        IMM([], np.empty((0, 0)))
    said = (
        r"^filters\[1\]: has \(4, 1, 1\) states, inputs and outputs, the first filter \(2, 1, 1\)$"
    )
    with pytest.raises(InputError, match=said):
        IMM([KalmanFilter(PLAIN), KalmanFilter(NORMAL)], np.eye(2))
    said = r"^filters\[2\]: has \(1, 0, 1\) states, inputs and outputs, the first .* \(2, 1, 1\)$"
    filters = [KalmanFilter(PLAIN), KalmanFilter(PLAIN), KalmanFilter(NO_INPUT)]
    with pytest.raises(InputError, match=said):
        IMM(filters, np.eye(3))


def test_filters_of_different_sampling_periods_are_refused() -> None:
    filters = [KalmanFilter(PLAIN), KalmanFilter(LinearModel(**MODEL, sampling_period=0.1))]
    said = r"^filters\[1\]: has a sampling period of 0.1 s, the first 1 s$"
    with pytest.raises(InputError, match=said):
        IMM(filters, np.eye(2))
    assert IMM(filters[1:] * 2, np.eye(2)).sampling_period == 0.1


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (
            {"probabilities": [0.5, 0.6]},
            r"probabilities: \[0.5, 0.6\] must be 0 or more and sum to 1, not 1.1",
        ),
        ({"probabilities": [1.5, -0.5]}, r"probabilities: \[1.5, -0.5\] must be 0 or more .*"),
        ({"probabilities": [1.0]}, r"probabilities: has shape \(1,\), must be a list of 2 numbers"),
        ({"probabilities": [NAN, 1.0]}, r"probabilities: \[nan, 1.0\] has an entry .* not finite"),
        ({"mean": [0.0]}, r"mean: has shape \(1,\), must be \(2,\) or \(2, 2\)"),
        ({"mean": np.zeros((3, 2))}, r"mean: has shape \(3, 2\), must be \(2,\) or \(2, 2\)"),
        (
            {"covariance": np.ones((3, 2, 2))},
            r"covariance: has shape \(3, 2, 2\), must be one covariance or \(2, 2, 2\)",
        ),
        ({"covariance": [1.0, -1.0]}, "covariance: must be positive semidefinite, .* -1, 1"),
        ({"covariance": [[1.0, 0.2], [0.1, 1.0]]}, "covariance: .* must be symmetric"),
    ],
)
def test_wrong_initial_states_of_a_bank_are_refused(changed: dict[str, Any], said: str) -> None:
    given: dict[str, Any] = {"mean": [0.0, 0.0], "covariance": 1.0, **changed}
    with pytest.raises(InputError, match=f"^{said}$"):
        bank().init(**given)

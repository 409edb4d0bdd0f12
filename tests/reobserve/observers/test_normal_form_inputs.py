"""Normal-form observers with known inputs: the error stays linear for any input, or it is
refused."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from reobserve.core.errors import InputError
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form import FORMS, NormalFormObserver, normal_form_observer

Array = NDArray[np.float64]

STEP, STEPS = 0.01, 300
A = np.array([[-2.0, 1.0], [-5.0, 1.0]])  # of the error in z
START, ESTIMATE = np.array([0.8, -0.4]), np.array([0.3, 0.2])

# Van der Pol with the cubic injection for which S = (x1, x2 + x1^3 / 3) is exact: an input of the
# first state is injected as (u, y^2 u), as S' has x1^2 in its second row.
FIELD = ["x2 + u", "-x1 + x2 - x1**2*x2 - u/2"]


def observer(form: str = "identity", inputs: tuple[str, ...] = ("u",), **more: Any) -> Any:
    chosen = {
        "poles": np.linalg.eigvals(A), "order": 3, "higher": ["y1**3/3"] * 2, "form": form,
        "sampling_period": STEP, **more,
    }  # fmt: skip
    return normal_form_observer(FIELD, ["x1"], ["x1", "x2"], inputs=inputs, **chosen)


def z(x: Array) -> Array:
    return np.stack([x[..., 0], x[..., 1] + x[..., 0] ** 3 / 3], axis=-1)


def u(t: Any) -> Any:
    return 0.7 * np.cos(3.0 * t)


@cache
def plant() -> tuple[Array, Array]:
    """The states and inputs at the ends and in the middle of all steps."""

    def right(t: float, x: Array) -> list[float]:
        return [x[1] + u(t), -x[0] + x[1] - x[0] ** 2 * x[1] - u(t) / 2]

    times = 0.5 * STEP * np.arange(2 * STEPS + 1)
    found = solve_ivp(right, (0, times[-1]), START, "DOP853", times, rtol=1e-12, atol=1e-13)
    return found.y.T, u(times)


def errors(form: str, inputs: Array) -> Array:
    built: NormalFormObserver = observer(form)
    x, _ = plant()
    run = run_on_halves(built, x[:, 0], inputs, start=built.init(ESTIMATE))
    return z(x[::2]) - z(run["state"])


@pytest.mark.parametrize("form", FORMS)
def test_errors_follow_linear_dynamics_for_any_input(form: str) -> None:
    _, known = plant()
    found = errors(form, known)
    rows = STEP * np.arange(STEPS + 1)
    expected = np.array([expm(A * t) @ (z(START) - z(ESTIMATE)) for t in rows])
    assert np.abs(found - expected).max() < 2e-8  # of order 4 in the step
    assert (
        np.abs(errors(form, 0 * known)[-1]).max() > 0.1
    )  # without the input the error is 0.1 and more


def test_injection_agrees_with_theory() -> None:
    beta = observer().normal_form.known
    terms = {(c, powers): value for c, powers, value in beta.terms()}
    assert terms == pytest.approx({(0, (0, 1)): 1.0, (1, (0, 1)): -0.5, (1, (2, 1)): 1.0})


def test_power_of_an_input_is_injected_as_that_power() -> None:
    # S'(x) b has x1^2 u^4: of degree 2 in x, as S' is, and of 6 in all.
    built = normal_form_observer(
        ["x2 + u**4", "-x1 + x2 - x1**2*x2 - u/2"], ["x1"], ["x1", "x2"], inputs=["u"],
        poles=np.linalg.eigvals(A), order=2, expanded=4, higher=["y1**3/3"] * 2,
        sampling_period=STEP,
    )  # fmt: skip
    terms = {(c, powers): value for c, powers, value in built.normal_form.known.terms()}
    assert terms == pytest.approx({(0, (0, 4)): 1.0, (1, (0, 1)): -0.5, (1, (2, 4)): 1.0})


def test_steps_and_run_with_held_inputs_are_bitwise_identical() -> None:
    built = observer()
    x, known = plant()
    run = built.run(x[:40:2, 0], known[:40:2], start=built.init(ESTIMATE))
    state = built.init(ESTIMATE)
    for k, row in enumerate(run["state"]):
        state, estimate = built.step(state, x[2 * k, :1], known[2 * k : 2 * k + 1])
        assert np.array_equal(estimate["state"], row)


def test_injection_mixing_unobservable_states_into_the_input_is_refused() -> None:
    with pytest.raises(InputError, match=r"is a function of y and u, for .* has a term in") as no:
        observer(higher=None)  # the linear injection, whose S has terms in x2
    assert "x2" in str(no.value)


def test_input_acting_through_an_unmeasured_state_is_refused() -> None:
    with pytest.raises(InputError, match="component 2 has a term in x2 u that is none"):
        normal_form_observer(
            ["x2", "-x1 - x2 + x2*u"], ["x1"], ["x1", "x2"], inputs=["u"], poles=[-2, -3],
            order=0, sampling_period=STEP,
        )  # fmt: skip


def test_any_input_is_accepted_if_the_whole_state_is_measured() -> None:
    # Then every function of x is a function of y: here b_2 = x2 u + u/2.
    built = normal_form_observer(
        ["x2", "-x1 - x2 + x2*u + u/2 - x1**2/4"], ["x1", "x2"], ["x1", "x2"], inputs=["u"],
        poles=[-2.1, -3.3], order=4, sampling_period=STEP, higher=None,
    )  # fmt: skip
    times = 0.5 * STEP * np.arange(601)

    def right(t: float, x: Array) -> list[float]:
        return [x[1], -x[0] - x[1] + (x[1] + 0.5) * u(t) - x[0] ** 2 / 4]

    x = solve_ivp(right, (0, times[-1]), [0.3, 0.1], "DOP853", times, rtol=1e-11, atol=1e-12).y.T
    run = run_on_halves(built, x, u(times), start=built.init([0.2, 0.0]))
    # The slower pole leaves exp(-2.1 3) of the initial error of 0.1.
    assert np.abs(run["state"][-1] - x[-1]).max() < 3e-4
    blind = run_on_halves(built, x, 0 * times, start=built.init([0.2, 0.0]))
    assert np.abs(blind["state"][-1] - x[-1]).max() > 1e-2


def test_higher_terms_below_degree_two_are_refused() -> None:
    with pytest.raises(InputError, match=r"higher\[1\]: has terms below degree 2"):
        observer(higher=["y1**2", "y1"])
    with pytest.raises(InputError, match="higher: has 1 expressions, must have 2"):
        observer(higher=["y1**2"])

"""The largest and smallest numbers in designs give a finite result or a refusal, and no warning."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from reobserve import normal_form_observer
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.observers.fixed_gain import luenberger
from reobserve.synthesis.high_gain_design import high_gain_over_time
from reobserve.synthesis.ilo_certificate import certify
from reobserve.synthesis.linear_gain import place as place_poles
from reobserve.synthesis.linear_gain import steady_kalman_gain, unobservable_modes
from reobserve.systems.linear import LinearModel
from tests.reobserve.library.calls.models import linear_model

SIZES = (5e-324, 1e-200, 1.0, 1e200, 1e308)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("outputs", [[[1.0, 0.0]], [[1.0, 0.0], [0.5, 1.0]]])
def test_placed_gains_are_finite_or_refused(outputs: list[list[float]]) -> None:
    A, placed = np.array([[0.9, 0.1], [-0.1, 0.8]]), 0
    for a, c, pole in product(SIZES, repeat=3):
        with contextlib.suppress(InputError):
            gain = place_poles(a * A, c * np.array(outputs), [0.3 * pole, 0.5 * pole])
            assert np.isfinite(gain).all(), (a, c, pole)
            placed += 1
    assert placed > 10


@pytest.mark.parametrize("n", [2, 8, 13, 14, 16, 20])
def test_gain_of_a_chain_of_integrators_is_the_polynomial_of_the_poles(n: int) -> None:
    poles = -np.arange(1.0, n + 1)
    gain = place_poles(np.diag(np.ones(n - 1), 1), np.eye(1, n), poles)
    assert gain[:, 0] == pytest.approx(np.poly(poles)[1:], rel=1e-12)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", ["identity", "transformed"])
@pytest.mark.parametrize("term", ["a**2*exp(700*(a+1))", *(f"{size}*a**2" for size in SIZES)])
def test_series_and_starts_of_normal_forms_are_finite_or_refused(term: str, form: str) -> None:
    try:
        observer = normal_form_observer(
            ["w", f"-sin(a) - w/10 + {term}"], ["a"], ["a", "w"], order=2, sampling_period=0.01,
            poles=[-1.5, -2], expanded=3, form=form,
        )  # fmt: skip
    except InputError as error:
        assert term not in ("5e-324*a**2", "1e-200*a**2", "1.0*a**2"), error  # noqa: PT017
        return
    series = observer.normal_form
    for part in (series.S, series.T, series.gain):
        assert np.isfinite(part.coefficients).all()
    for start in (*SIZES, 1e150):
        with contextlib.suppress(InputError):
            assert np.isfinite(observer.init([start, 0]).values).all()


@pytest.mark.filterwarnings("error")
def test_poles_are_placed_while_their_product_is_a_number() -> None:
    model = linear_model()
    gain = place_poles(model.A, model.C, [1e150, 2e150])
    reached = np.linalg.eigvals(model.A - gain @ model.C)
    assert sorted(reached) == pytest.approx([1e150, 2e150], rel=1e-12)


@pytest.mark.filterwarnings("error")
def test_non_finite_results_are_refused_naming_the_argument() -> None:
    for function, argument in (
        (lambda x: np.float64(x) * x, 1e200),
        (lambda x: (x, np.array([1.0, x / 0.0])), np.float64(1.0)),
    ):
        with pytest.raises(InputError, match=r"^x: must keep results inside"):
            finite("x")(function)(argument)
    assert finite("x")(lambda x: x + 1)(2.0) == 3.0


HUGE = [[1e308, 1e308], [1e308, 1e308]]
STIFF = LinearModel([[1e300, 1.0], [0.0, 1e-300]], [[0.0], [1.0]], [[1.0, 0.0]], Q=1e-4, R=1e-2)
REFUSED: dict[str, Callable[[], object]] = {
    "poles: far from the eigenvalues": lambda: luenberger(linear_model(), [1e150, 2e150]),
    "poles: near the largest number": lambda: luenberger(linear_model(), [5e299, 6e299]),
    "poles: of both signs": lambda: luenberger(linear_model(), [1e308, -1e308]),
    "A, C: of huge matrices": lambda: unobservable_modes(HUGE, [[1.0, 0.0]]),
    "A, C: of huge matrices, placed": lambda: place_poles(HUGE, [[1.0, 0.0]], [0.5, 0.6]),
    "model: of eigenvalues far apart": lambda: steady_kalman_gain(STIFF),
    "rho: so small that S is singular": lambda: high_gain_over_time(2, 1e-300, 1.0, [0.0]),
    "size: whose factorial is no number": lambda: high_gain_over_time(200, 1.0, 1.0, [0.0]),
    "observer_gain: huge": lambda: certify(1e308, np.eye(3), 0.5, 50.0, 0.01),
    "observer_gain: huge, full": lambda: certify(
        np.full((3, 3), 1e308), np.eye(3), 0.5, 50.0, 0.01
    ),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("case", REFUSED)
def test_values_that_once_raised_other_errors_are_refused(case: str) -> None:
    with pytest.raises(InputError, match=f"^{case.partition(':')[0]}: "):
        REFUSED[case]()

"""The largest and smallest numbers in each argument give a finite result or a refusal.

Never another exception, and no numpy warning before a refusal.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np
import pytest

from reobserve import normal_form_observer
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.observers.fixed_gain import luenberger
from reobserve.synthesis.linear_gain import place as place_poles
from tests.reobserve.library.calls import Call, calls
from tests.reobserve.library.calls.models import linear_model

from .test_arguments import is_numeric

EXTREMES = (1e150, 5e299, 1e308, -1e308, 1e-300, 5e-324)
# Designs by matrix inequalities take a second each; their parts are tested among the others.
SLOW = ("extended_state.pi.", "extended_state.pd_pi.")
# Which may diverge.
ROWS = (".run", ".step", ".predict", ".correct", "rts_smoother", "simulate", "Gaussian")
NAMES = [
    name
    for name in calls()
    if name.startswith(
        ("core.discretisation.", "systems.", "synthesis.", "detection.", "observers.")
    )
    and not any(part in name for part in (*SLOW, *ROWS))
]


def replaced(valid: Any) -> Iterator[Any]:
    """The valid argument with one entry, all or every other, replaced by extreme numbers."""
    array = np.asarray(valid, dtype=None if np.iscomplexobj(valid) else np.float64)
    for extreme in EXTREMES:
        one = array.copy()
        one.flat[0] = extreme
        yield from (one, np.full_like(array, extreme)) if array.ndim else [extreme]
    if array.ndim:
        yield np.resize(np.array([1e150, 1e-300], array.dtype), array.shape)


def not_finite(found: Any, place: str = "") -> Iterator[str]:
    """Where a result has numbers that are not finite."""
    if isinstance(found, float | complex | np.ndarray) and np.asarray(found).dtype != object:
        if np.asarray(found).dtype.kind in "fc" and not np.isfinite(found).all():
            yield place
    elif isinstance(found, list | tuple | np.ndarray):
        for k, part in enumerate(found):
            yield from not_finite(part, f"{place}[{k}]")
    elif isinstance(found, Mapping):
        for name, part in found.items():
            yield from not_finite(part, f"{place}.{name}")
    elif type(found).__module__.startswith("reobserve."):
        yield from not_finite(vars(found), place)


def check_extremes(call: Call) -> None:
    """Make a call with each extreme number in the place of each number."""
    usual = set(not_finite(call.function(*call.arguments)))
    for place, valid in enumerate(call.arguments):
        for argument in replaced(valid) if is_numeric(valid) else ():
            arguments = (*call.arguments[:place], argument, *call.arguments[place + 1 :])
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                with contextlib.suppress(InputError):
                    found = call.function(*arguments)
                    if not call.name.startswith("detection."):  # infinite statistics raise alarms
                        assert set(not_finite(found)) <= usual, arguments


@pytest.mark.nightly_cases("detection.detectors.cusum_of_mean")
@pytest.mark.parametrize("name", NAMES)
def test_extreme_numbers_give_a_finite_result_or_one_sentence(name: str) -> None:
    check_extremes(calls()[name])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("poles", [[5e299, 6e299], [1e308, -1e308]])
def test_poles_far_from_all_eigenvalues_are_refused_without_a_warning(poles: list[float]) -> None:
    model = linear_model()
    with pytest.raises(InputError, match=r"^poles: .* are too far from the eigenvalues of A"):
        place_poles(model.A, model.C, poles)
    with pytest.raises(InputError, match=r"^poles: .* is not inside the unit circle"):
        luenberger(model, poles)


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

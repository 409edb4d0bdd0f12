"""The largest and smallest numbers in each argument of synthesis give a result or a refusal.

Never another exception, and no numpy warning before a refusal.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.observers.fixed_gain import luenberger
from reobserve.synthesis.linear import place as place_poles
from tests.reobserve.library.calls import Call, calls
from tests.reobserve.library.calls.models import linear_model

from .test_arguments import is_numeric

EXTREMES = (1e150, 5e299, 1e308, -1e308, 1e-300, 5e-324)
# Designs by matrix inequalities take a second each; their parts are tested among the others.
SLOW = ("extended_state.pi.", "extended_state.pd_pi.")
NAMES = [
    name
    for name in calls()
    if name.startswith(("synthesis.", "detection.")) and not any(part in name for part in SLOW)
]


def replaced(valid: Any) -> Iterator[Any]:
    """The valid argument with one entry, or all entries, replaced by an extreme number."""
    array = np.asarray(valid, dtype=None if np.iscomplexobj(valid) else np.float64)
    for extreme in EXTREMES:
        one = array.copy()
        one.flat[0] = extreme
        yield from (one, np.full_like(array, extreme)) if array.ndim else [extreme]


def check_extremes(call: Call) -> None:
    """Make a call with each extreme number in the place of each number."""
    for place, valid in enumerate(call.arguments):
        for argument in replaced(valid) if is_numeric(valid) else ():
            arguments = (*call.arguments[:place], argument, *call.arguments[place + 1 :])
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                with contextlib.suppress(InputError):
                    call.function(*arguments)


@pytest.mark.parametrize("name", NAMES)
def test_extreme_numbers_give_a_result_or_one_sentence(name: str) -> None:
    check_extremes(calls()[name])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("poles", [[5e299, 6e299], [1e308, -1e308]])
def test_poles_far_from_all_eigenvalues_are_refused_without_a_warning(poles: list[float]) -> None:
    model = linear_model()
    with pytest.raises(InputError, match=r"^poles: .* are too far from the eigenvalues of A"):
        place_poles(model.A, model.C, poles)
    with pytest.raises(InputError, match=r"^poles: .* is not inside the unit circle"):
        luenberger(model, poles)


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

"""Arguments of plants, signals and functions of the papers: other types, shapes and numbers."""

from __future__ import annotations

from hypothesis import given, settings

from tests.drawn.test_calls import Odd, check, odd_calls
from tests.reobserve_papers.library.calls import calls


@settings(max_examples=4 * settings().max_examples)
@given(odd_calls(calls))
def test_arguments_of_odd_type_shape_or_value_are_accepted_or_refused(odd: Odd) -> None:
    check(*odd)

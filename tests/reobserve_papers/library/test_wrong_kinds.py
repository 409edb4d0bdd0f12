"""A wrong type for any argument of plants, signals and papers is refused naming the argument."""

from __future__ import annotations

from tests.reobserve.library.test_wrong_kinds import not_refused

from .calls import calls

# Texts of the user that are only printed.
LABELS = {
    "signals.inputs.Signal.check_grid": "name",
    "plants.delayed_input.check_delay": "name",
}


def test_argument_of_wrong_type_is_refused_naming_it() -> None:
    assert not_refused(calls(), LABELS) == []

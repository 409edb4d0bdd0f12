"""Limits of models as text: at them, and one beyond."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve.systems import nonlinear_text
from reobserve.systems.nonlinear_text import Names, text_jacobian, text_rows

NAMES = Names(("a", "b"), (), ())


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Texts of thousands of operations take a second each to read."""
    assert nonlinear_text._MOST_OPERATIONS == 4000
    monkeypatch.setattr(nonlinear_text, "_MOST_OPERATIONS", 10)


def test_operations_of_all_texts_count_together() -> None:
    five, said = "sin(2*a) + cos(3*b)", r"operations, in all there must be 10 or fewer$"
    assert len(text_rows("f", [five, five], (2,), NAMES)) == 2
    for texts in ([f"{five} - 1", five], [five, f"{five} - 1"]):
        with pytest.raises(InputError, match=r"^f\[1\]: has [56] " + said):
            text_rows("f", texts, (2,), NAMES)
    with pytest.raises(InputError, match=r"^f\[0\]: has 11 " + said):
        text_rows("f", [f"{five} + sin(5*a)*cos(7*b)"], (1,), NAMES)


def test_operations_of_all_derivatives_count_together() -> None:
    """2 cos(2 a) has three, -3 sin(3 b) four."""
    text = "sin(2*a) + cos(3*b)"
    assert len(text_jacobian("f", (text, "sin(2*a)"), NAMES)) == 4
    with pytest.raises(InputError, match=r"^d f\[1\] / d b: has 4 operations, in all there must"):
        text_jacobian("f", (text, text), NAMES)

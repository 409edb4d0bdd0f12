"""Formulas in labels and titles."""

from __future__ import annotations

from matplotlib.cbook import is_math_text
from matplotlib.mathtext import MathTextParser

from reobserve.core.errors import InputError, shown


def check_formulas(place: str, text: str) -> None:
    """Refuse text with dollar signs around what matplotlib reads as no formula."""
    try:
        if is_math_text(text):
            MathTextParser("path").parse(text)
    except (ValueError, RecursionError):
        said = "holds, between dollar signs, no formula that can be drawn"
        raise InputError(place, f"{shown(text)} {said}") from None

"""Functions called from compiled loops by address."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError

from reobserve.core.direct_call import call
from reobserve.core.kernel import compiled_with_signature, kernel


def _scaled(x: Any, factor: float, out: Any) -> None:
    for i in range(len(x)):
        out[i] = factor * x[i]


def _sum(x: Any, factor: float, out: Any) -> float:
    return float(x[0] + factor + out[0])


@kernel
def _ask(function: Any, rows: Any, factor: float, out: Any) -> None:
    for k in range(len(rows)):
        call(function, (rows[k], factor, out[k]))


ROWS = np.array([[1.0, -2.0], [0.5, 3.0]])


def test_compiled_loop_passes_views_and_numbers_to_a_function() -> None:
    function = compiled_with_signature("void(float64[::1], float64, float64[::1])", _scaled)
    out = np.full_like(ROWS, np.nan)
    _ask(function, ROWS, 3.0, out)
    assert np.array_equal(out, 3.0 * ROWS)


def test_call_with_mismatched_types_does_not_compile() -> None:
    """An address carries no types: mismatched arguments would be misread."""
    function = compiled_with_signature("void(float64[::1], float64, float64[::1])", _scaled)
    with pytest.raises(TypingError):
        _ask(function, ROWS, 3, np.empty_like(ROWS))
    with pytest.raises(TypingError):
        _ask(function, np.asfortranarray(ROWS), 3.0, np.empty_like(ROWS))
    returning = compiled_with_signature("float64(float64[::1], float64, float64[::1])", _sum)
    with pytest.raises(TypingError):
        _ask(returning, ROWS, 3.0, np.empty_like(ROWS))
    with pytest.raises(TypingError):
        _ask(3.0, ROWS, 3.0, np.empty_like(ROWS))

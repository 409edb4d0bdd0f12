"""`step` on plain numbers: a compiled loop that is called with the same arrays again and again.

What a record costs beside its loop (lists of records, arrays for estimates, the search for the
loop's machine code by the types of its arguments) costs a step most of its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.loop_function import RaisedAfterLoop

Array = NDArray[np.float64]


class OneRow:
    """The arrays of one row, and the loop that is called with them.

    ``posterior`` and ``rows`` are what the loop reads and writes, y, shape (1, m), and ``inputs``,
    (2, p), of the row before and of the row, views of what it reads.
    """

    def __init__(
        self, loop: Callable[..., Any], arguments: tuple[Any, ...], posterior: Any, rows: Any,
        y: Array, inputs: Array,
    ) -> None:  # fmt: skip
        self._loop, self.arguments = loop, arguments
        self._entry: Any = None
        self.posterior, self.rows, self.y, self.inputs = posterior, rows, y, inputs

    def run(self) -> Any:
        """Call the loop, and return what it returns."""
        with RaisedAfterLoop():
            if self._entry is not None:
                return self._entry(*self.arguments)
            result = self._loop(*self.arguments)
        self._entry = _machine_code(self._loop, self.arguments)
        return result


def _machine_code(loop: Any, arguments: tuple[Any, ...]) -> Any:
    """The code that numba compiled for arguments of these types, None where it does not say."""
    try:
        return loop.overloads[tuple(map(loop.typeof_pyval, arguments))].entry_point
    except (AttributeError, KeyError):  # of Python, or of another numba
        return None


def is_plain(y: Any, u: Any, m: int, p: int) -> bool:
    """True for m and p finite numbers in arrays, which need no other check."""
    if type(y) is not np.ndarray or y.dtype != np.float64 or y.shape != (m,):
        return False
    if u is None:
        return p == 0 and all(map(math.isfinite, y.tolist()))
    if type(u) is not np.ndarray or u.dtype != np.float64 or u.shape != (p,):
        return False
    return all(map(math.isfinite, y.tolist())) and all(map(math.isfinite, u.tolist()))

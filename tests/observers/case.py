"""An observer with a record whose truth is known: what `test_contract` holds all of them to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """An observer, a record for it and where it starts from.

    ``truth`` are true values of estimates at the rows, ``bounds`` what their largest errors from
    row ``settled`` on stay below. With y, or u, a row late the worst of them, as a multiple of its
    bound, must be more than ``worse`` times as large. ``huge`` values in y and u make the observer
    diverge; None where none can. What looks at signs alone need not notice midpoints.
    """

    observer: Any
    y: Array
    u: Array | None
    state: Any
    truth: Mapping[str, Array]
    bounds: Mapping[str, float]
    settled: int
    worse: float
    huge: float | None = 1e300
    notices_midpoints: bool = True


def observe(case: Case, **changed: Any) -> Any:
    """The run of a case, some of its arguments changed."""
    return case.observer.run(**{"y": case.y, "u": case.u, "state": case.state, **changed})

"""An observer with a record whose truth is known, as required by `test_contract`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """An observer, its record and its initial state.

    ``truth`` are the true values of estimates at the rows; from row ``settled`` on their largest
    errors stay below ``bounds``. With y, or u, one row late, the largest error relative to its
    bound must be more than ``worse`` times as large. ``huge`` values in y and u make the observer
    diverge; None if none can. Observers that use only signs need not react to midpoints.
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
    """The run of a case, with some arguments changed."""
    return case.observer.run(**{"y": case.y, "u": case.u, "start": case.state, **changed})

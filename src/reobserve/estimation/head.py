"""The first rows of a record, kept to be looked at again."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reobserve.estimation.gaps import Stretch

Array = NDArray[np.float64]

MOST_ROWS = 4000


@dataclass
class Head:
    """The first rows of a record without a break, however it comes in blocks."""

    y: list[Array] = field(default_factory=list)
    u: list[Array] = field(default_factory=list)
    rows: int = 0
    closed: bool = False

    def take(self, stretch: Stretch) -> None:
        """Keep rows as long as they are the first ones."""
        if self.closed or (stretch.fresh and self.rows):
            self.closed = True
            return
        room = MOST_ROWS - self.rows
        self.y.append(stretch.y[:room])
        self.u.append(stretch.u[:room])
        self.rows += len(self.y[-1])
        self.closed = self.rows >= MOST_ROWS

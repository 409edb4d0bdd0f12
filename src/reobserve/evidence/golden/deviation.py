"""A number or a word beside the golden one."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Deviation:
    """A number beside the golden one, of the series ``column``."""

    figure: str
    what: str
    golden: float
    found: float
    tolerance: float
    column: str = ""

    @property
    def ratio(self) -> float:
        """How far it is off, in units of its tolerance; inf if one of the two is nan."""
        if self.found == self.golden or (math.isnan(self.found) and math.isnan(self.golden)):
            return 0.0
        off = abs(self.found - self.golden)
        return off / self.tolerance if self.tolerance and not math.isnan(off) else math.inf

    @property
    def exceeds(self) -> bool:
        """Whether it is not within its tolerance of the golden one."""
        return not self.ratio <= 1

    def __str__(self) -> str:
        """One line: where, what it was, what it is, what is allowed."""
        return (
            f"{self.figure}, {self.what}: golden {self.golden:.9g}, found {self.found:.9g}, "
            f"off by {abs(self.found - self.golden):.2g}, allowed {self.tolerance:.2g}"
        )


@dataclass(frozen=True)
class OtherCell:
    """A cell that is not what the golden table holds."""

    table: str
    what: str
    golden: str
    found: str
    ratio = math.inf
    exceeds = True

    @property
    def figure(self) -> str:
        """As of a number."""
        return self.table

    def __str__(self) -> str:
        """One line: where, what it was, what it is."""
        return f"{self.table}, {self.what}: golden {self.golden!r}, found {self.found!r}"

"""What the figure diff found: an item for each figure and table, a paper's theory and claims."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from reobserve.evidence.figure_diff.pixels import PixelDifference
from reobserve.evidence.golden.deviation import Deviation, OtherCell
from reobserve.evidence.golden.kept import PERIOD, Array


@dataclass(frozen=True)
class MovedSeries:
    """A series that left its tolerance: golden and new values, one each ``period`` [s]."""

    name: str
    unit: str
    golden: Array
    new: Array
    tolerance: float
    period: float = PERIOD


@dataclass
class Item:
    """A figure, a table, the theory or the claims of a paper, and what is different about it.

    ``reference`` and ``new`` are the drawings, None where there is none. ``gaps`` are sentences on
    what could not be compared, ``why_missing`` is one on why it was not built.
    """

    paper: str
    name: str
    kind: str = "figure"
    reference: Path | None = None
    new: Path | None = None
    why_missing: str = ""
    extra: bool = False
    pixels: PixelDifference | None = None
    deviations: list[Deviation | OtherCell] = field(default_factory=list)
    series: list[MovedSeries] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """In one word, the gravest first: missing, extra, gap, moved or agrees."""
        if self.why_missing:
            return "missing"
        if self.extra:
            return "extra"
        if self.gaps:
            return "gap"
        moved = self.deviations or (self.pixels is not None and self.pixels.exceeded)
        return "moved" if moved else "agrees"


@dataclass(frozen=True)
class Origin:
    """Under which processor, system and versions figures were made, by name; empty if unknown."""

    values: dict[str, str]

    def differing(self, other: Origin) -> list[tuple[str, str, str]]:
        """Name, value here and value there of all that is not the same."""
        names = dict.fromkeys([*self.values, *other.values])
        pairs = ((name, self.values.get(name, ""), other.values.get(name, "")) for name in names)
        return [(name, here, there) for name, here, there in pairs if here != there]


@dataclass(frozen=True)
class Diff:
    """All items, the origins of the reference and of the new figures, and gaps of the whole."""

    items: list[Item]
    reference: Origin
    new: Origin
    gaps: list[str]

    @property
    def failed(self) -> list[Item]:
        """The items that do not agree."""
        return [item for item in self.items if item.verdict != "agrees"]

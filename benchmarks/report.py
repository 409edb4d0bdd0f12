"""What a benchmark hands back, as a table for people and as JSON for machines."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))


@dataclass(frozen=True)
class Row:
    """One time [s] beside that of a peer that does the same.

    A ``speed`` is the peer's time over ours (more is better), a ``cost`` is ours over the
    peer's (less is better).
    """

    what: str
    time: float
    peer: str
    peer_time: float
    cost: bool = False
    aim: float | None = None

    @property
    def ratio(self) -> float:
        """Speed or cost relative to the peer."""
        return self.time / self.peer_time if self.cost else self.peer_time / self.time

    @property
    def met(self) -> bool | None:
        """Whether the aim is met; None without an aim."""
        if self.aim is None:
            return None
        return self.ratio <= self.aim if self.cost else self.ratio >= self.aim

    def cells(self) -> tuple[str, ...]:
        """The row as text, in the order of `_HEADER`."""
        return (
            self.what,
            seconds(self.time),
            self.peer,
            seconds(self.peer_time),
            f"{self.ratio:.2f} x" if self.cost else _share(self.ratio),
            self._aim(),
        )

    def _aim(self) -> str:
        if self.aim is None:
            return ""
        aim = f"<= {self.aim:g} x" if self.cost else f">= {_share(self.aim)}"
        return f"aim: {aim} of {self.peer}: {'met' if self.met else 'MISSED'}"


@dataclass(frozen=True)
class Check:
    """Whether two peers computed the same: their largest difference against what is allowed."""

    what: str
    difference: float
    tolerance: float

    @property
    def agrees(self) -> bool:
        """Whether the peers computed the same; not a number never does."""
        return self.difference <= self.tolerance


@dataclass
class Section:
    """One table with its checks; ``how`` says what a time is."""

    title: str
    how: str
    rows: list[Row] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def text(self) -> str:
        """The section as it is printed."""
        lines = [self.title, f"  ({self.how})", ""]
        if self.rows:
            lines += [*_columns([_HEADER, *(row.cells() for row in self.rows)]), ""]
        for check in self.checks:
            verdict = "agree" if check.agrees else "DISAGREE"
            lines.append(
                f"  {verdict}: {check.what}: {check.difference:.3g} (at most {check.tolerance:.3g})"
            )
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines) + "\n"

    def data(self) -> dict[str, Any]:
        """The section as values for JSON."""
        plain = asdict(self)
        for row, cells in zip(self.rows, plain["rows"], strict=True):
            cells.update(ratio=row.ratio, met=row.met)
        for check, cells in zip(self.checks, plain["checks"], strict=True):
            cells.update(agrees=check.agrees)
        return plain


_HEADER = ("what", "time", "peer", "peer's time", "ratio", "")


def seconds(time: float) -> str:
    """A time with three digits and a fitting unit."""
    scale, unit = next((u for u in _UNITS if abs(time) >= u[0]), _UNITS[-1])
    return f"{time / scale:.3g} {unit}"


def _share(ratio: float) -> str:
    return f"{ratio * 100:.0f} %" if ratio < 2 else f"{ratio:.3g} x"


def _columns(table: Sequence[Sequence[str]]) -> Iterable[str]:
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    numbers = {1, 3, 4}
    for row in table:
        cells = (
            cell.rjust(width) if index in numbers else cell.ljust(width)
            for index, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield "  " + "  ".join(cells).rstrip()


def write(path: Path, sections: dict[str, Section], quick: bool) -> None:
    """All sections as JSON, with the versions that decide the speed."""
    packages = ("numpy", "scipy", "numba", "llvmlite", "snakemake", "cvxpy", "clarabel", "scs")
    stored = {
        "quick": quick,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "packages": {name: metadata.version(name) for name in packages},
        "sections": {name: section.data() for name, section in sections.items()},
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")

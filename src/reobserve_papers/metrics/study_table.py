"""The rows of a study as a table: columns as arrays, and rows found by their coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import shown
from reobserve.core.files import GAP, NUMBER, SCORE, WHOLE, Kind
from reobserve_papers.metrics.metrics import Level


def _or_nan(cell: Any) -> float:
    return float("nan") if cell == "" else float(cell)


_Reader = Callable[[Any], float]

_READERS: Mapping[Kind, _Reader] = {NUMBER: float, SCORE: float, WHOLE: int, GAP: _or_nan}


@dataclass(frozen=True, eq=False)
class StudyTable:
    """Columns of equal length by name: numbers as numbers, all else as text.

    Without columns it is the table of a figure that has no study.
    """

    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, rows: Iterable[Mapping[str, Any]], kinds: Mapping[str, Kind]) -> StudyTable:
        """The table of rows as a study gives them or as its file holds them, in text."""
        cells = list(rows)
        columns = {}
        for name, kind in kinds.items():
            read = _READERS.get(kind)
            values = [row[name] if read is None else read(row[name]) for row in cells]
            columns[name] = np.array(values, dtype=object if read is None else None)
        return cls(columns)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, column: str) -> NDArray[Any]:
        """A column, one entry a row."""
        return self.columns[column]

    def where(self, **at: Level) -> StudyTable:
        """The rows at these coordinates, of which there may be none."""
        chosen = np.ones(len(self), dtype=bool)
        for name, level in at.items():
            chosen &= self[name] == level
        return self._rows(chosen)

    def value(self, column: str = "value", **at: Level) -> float:
        """The number in the one row at these coordinates."""
        values = self.where(**at)[column]
        if len(values) != 1:
            place = ", ".join(f"{name} {shown(level)}" for name, level in at.items())
            raise LookupError(f"{len(values)} rows with {place}")
        return float(values[0])

    def groups(self, *names: str) -> Iterator[tuple[tuple[Any, ...], StudyTable]]:
        """The rows that agree in some columns, by what these hold, in the order of the rows."""
        places: dict[tuple[Any, ...], list[int]] = {}
        for row, key in enumerate(zip(*(self[name].tolist() for name in names), strict=True)):
            places.setdefault(key, []).append(row)
        for key, rows in places.items():
            yield key, self._rows(np.array(rows))

    def levels(self, name: str) -> list[Any]:
        """The values in a column, each once, in the order of the rows."""
        return list(dict.fromkeys(self[name].tolist()))

    def by_level(self, name: str, column: str = "value") -> dict[Any, NDArray[np.float64]]:
        """The numbers at each level of a column, as a curve wants them: levels that rise."""
        curve = {level: rows[column] for (level,), rows in self.groups(name)}
        return dict(sorted(curve.items()))

    def _rows(self, chosen: NDArray[Any]) -> StudyTable:
        return StudyTable({name: column[chosen] for name, column in self.columns.items()})

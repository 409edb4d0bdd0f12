"""The rows to read of a record in which rows of several quantities are mixed, by `file.where`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dialect import bare

_MOST_SEEN = 20  # texts that a refusal lists


class RowChoice:
    """Takes rows of a ``header`` by texts in columns that are ``stated``, and counts the others.

    ``places`` of these columns in the header are rising. `InputError` is raised for a name of which
    there is no column, or of which there are two.
    """

    def __init__(
        self, stated: Mapping[str, Any], header: Sequence[str], place: str, report: DataReport
    ) -> None:
        from reobserve.estimation.layout import split_title  # which reads rows itself

        self.place, self.report, columns = place, report, dict[int, tuple[str, list[str], bool]]()
        for name, value in stated.items():
            found = [k for k, title in enumerate(header) if title.strip() == name]
            found = found or [k for k, t in enumerate(header) if split_title(t)[0] == name]
            if len(found) != 1:
                problem = "has two columns" if found else "has no column"
                ending = "" if found else nearest(name, header)
                raise InputError(f"file.where.{name}", f"{place} {problem} {shown(name)}{ending}")
            negated = isinstance(value, Mapping)
            texts = value["not"] if negated else value
            columns[found[0]] = (name, [texts] if isinstance(texts, str) else texts, negated)
        self.places = sorted(columns)
        self.choices = [columns[k] for k in self.places]
        self.some = False  # row was taken
        self.seen: dict[str, dict[str, None]] = {}  # texts by which rows were left out

    def leaves_out(self, cells: Sequence[Any]) -> bool:
        """True if a row is not taken, which is counted, by its cells of these columns."""
        for (name, texts, negated), cell in zip(self.choices, cells, strict=False):
            text = bare("" if cell is None else str(cell))
            if (text in texts) == negated:
                self.report.count(self.report.left_out, f"by {name}", 1)
                seen = self.seen.setdefault(name, {})
                if len(seen) < _MOST_SEEN:
                    seen[text[:80]] = None
                return True
        self.some = True
        return False

    def check_some(self) -> None:
        """Refuse a choice by which all rows were left out."""
        for name, texts, negated in self.choices:
            if name in self.seen and not (self.some or self.report.rows):
                stated = "not " * negated + " or ".join(map(shown, texts))
                hint = nearest(texts[0], self.seen[name])
                problem = f"{stated} takes no row of {self.place}{hint}"
                raise InputError(f"file.where.{name}", problem)

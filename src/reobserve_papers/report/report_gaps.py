"""Gaps of a report: files that cannot be read, shown in place and listed at the top."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from reobserve.core.errors import ReobserveError

Read = TypeVar("Read")


@dataclass(frozen=True)
class Gap:
    """Something that should be here and is not: ``sentence`` says what, ``place`` is an anchor."""

    number: int
    place: str
    sentence: str


@dataclass
class ReportGaps:
    """All gaps of a page about the project in ``folder``, in the order in which they were found."""

    folder: Path
    entries: list[Gap] = field(default_factory=list)

    def add(self, place: str, problem: object) -> Gap:
        """Add a gap, whose sentence has paths relative to the project."""
        sentence = line(problem).replace(f"{self.folder}{os.sep}", "")
        self.entries.append(Gap(len(self.entries) + 1, place, sentence))
        return self.entries[-1]

    def attempt(self, place: str, read: Callable[..., Read], *arguments: Any) -> Read | Gap:
        """Call ``read``, and add a gap for an error of this package's."""
        try:
            return read(*arguments)
        except ReobserveError as error:
            return self.add(place, error)


def line(text: object) -> str:
    """Text on one line."""
    return " ".join(str(text).split())

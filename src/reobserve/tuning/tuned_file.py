"""The file of tuned settings of a method.

A folder has METHOD.json for each method of a task. It has for each training set the digest of what
decides the search, and for each repeat the best settings, their objective on the training records,
settings at an edge of their range, and errors on held-out records over evaluations.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, shown
from reobserve.core.files import WHOLE, write_text
from reobserve.core.validation import checked, items, parse
from reobserve.tuning.search import Settings
from reobserve.tuning.task import Task


def _over_evaluations(place: str, errors: dict[str, float]) -> None:
    """Refuse keys that are no rising numbers of evaluations."""
    if not errors or not all(map(WHOLE.allows, errors)):
        raise InputError(place, f"{shown(list(errors))} must be numbers of evaluations")
    numbers = [int(key) for key in errors]
    if numbers[0] < 1 or any(before >= after for before, after in pairwise(numbers)):
        raise InputError(place, f"{shown(numbers)} must be 1 or more, rising")


@dataclass(frozen=True)
class Repeat:
    """One tuning.

    ``held_out`` has the errors of the best settings after so many evaluations, on the first
    held-out records in the conditions of the training set.
    """

    settings: Settings
    objective: float
    edges: dict[str, str]
    held_out: Annotated[dict[str, float], checked(_over_evaluations)]

    @property
    def error(self) -> float:
        """The held-out error of the settings."""
        return list(self.held_out.values())[-1]


@dataclass(frozen=True)
class TunedOn:
    """The tunings on a training set."""

    digest: str
    repeats: Annotated[list[Repeat], items()]


@dataclass(frozen=True)
class Cost:
    """Cost of the tuned method on the machine that tuned it: construction [ms], a sample [us]."""

    construction: float
    sample: float


@dataclass(frozen=True)
class TunedMethod:
    """A file of tuned settings."""

    training: dict[str, TunedOn]
    cost: Cost

    @classmethod
    def read(cls, path: Path) -> TunedMethod:
        """Read a file, or `InputError` if it is missing or damaged."""
        return parse(cls, read_json(path), str(path))

    def write(self, path: Path) -> None:
        """Write the file."""
        write_text(path, json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n")


def read_tuned(task: Task, folder: Path) -> dict[str, TunedMethod]:
    """The tuned settings of all methods of a task.

    Training sets other than the main one may be missing.
    """
    tuned = {}
    for method in task.methods:
        path = folder / f"{method}.json"
        tuned[method] = TunedMethod.read(path)
        for name in task.training:
            stored = tuned[method].training.get(name)
            if stored is None and name != task.main:
                continue
            if stored is None or stored.digest != task.digest(method, name):
                problem = f"training.{name} is not of what {task.file} states now: tune it again"
                raise InputError(str(path), problem)
    return tuned

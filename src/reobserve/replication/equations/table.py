"""The table of a paper's equations: what each says, what implements it and what shows that.

``config/equations/NAME.yaml`` has all that a paper numbers, equations, theorems, remarks, tables,
and what it leaves without a number though the code follows it. Docstrings cite in one form, the
name that ``cited_as`` gives and the places after a comma:

    Chen & Saif 2007, (1) and (2)
    Lechappe et al. 2018, (9) to (11), Lemma 1

A class or function that does so is one that the table names, and the other way round. Formulas
stand in the table as they are implemented; a note names the errata of how they are printed.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.files import reason
from reobserve.core.validation import Count, Text, checked, parse

_NUMBER = re.compile(r"[1-9][0-9]{0,3}")
_NAME = re.compile(r"reobserve(\.[A-Za-z]\w*)+")
_TEST = re.compile(r"tests/[\w/]+\.py::test_\w+")


def _name(place: str, text: str) -> None:
    if not _NAME.fullmatch(text):
        problem = "must be the dotted name of a class or function, as reobserve.observers.imm.IMM"
        raise InputError(place, f"{shown(text)} {problem}")


def _test(place: str, text: str) -> None:
    if not _TEST.fullmatch(text):
        problem = "must be a test, as tests/observers/test_imm.py::test_it"
        raise InputError(place, f"{shown(text)} {problem}")


@dataclass(frozen=True)
class Equation:
    """An equation, or a theorem, a definition, a table: what has a place of its own in a paper.

    ``number`` is that place: `9`, `Theorem 1`, `after (12)`. ``implemented`` has the dotted names
    of the classes and functions that are it, ``tests`` what shows that they are.
    """

    number: Text
    statement: Text
    implemented: tuple[Annotated[str, checked(_name)], ...]
    tests: tuple[Annotated[str, checked(_test)], ...]
    note: str = ""

    def __post_init__(self) -> None:
        if not self.implemented and not self.note.strip():
            raise InputError("note", f"is missing: say why nothing implements {self.place}")
        if self.implemented and not self.tests:
            raise InputError("tests", f"is empty: name a test that shows {self.place}")

    @property
    def place(self) -> str:
        """As a text cites it: numbers in parentheses."""
        return f"({self.number})" if self.numbered else self.number

    @property
    def numbered(self) -> bool:
        """Whether it is an equation with a number, and not some other place."""
        return bool(_NUMBER.fullmatch(self.number))


@dataclass(frozen=True)
class EquationTable:
    """All of a paper's, in its order; ``last`` is the number of its last equation."""

    cited_as: Text
    last: Count
    equations: tuple[Equation, ...]

    def __post_init__(self) -> None:
        counted = Counter(_plain(one.number) for one in self.equations)
        for one in self.equations:
            if counted[_plain(one.number)] > 1:
                raise InputError("equations", f"{one.place} stands there twice")
        numbers = [int(one.number) for one in self.equations if one.numbered]
        for expected, found in zip(range(1, self.last + 1), numbers, strict=False):
            if found != expected:
                problem = f"({found}) stands where ({expected}) must: all, in their order"
                raise InputError("equations", problem)
        if len(numbers) != self.last:
            problem = f"has {len(numbers)} numbers, must have (1) to ({self.last}), as `last` says"
            raise InputError("equations", problem)

    def find(self, number: str) -> Equation:
        """The one of a number, with or without parentheses, or of a place.

        Raises
        ------
        InputError
            If there is none.
        """
        for one in self.equations:
            if _plain(one.number) == _plain(number):
                return one
        known = [one.number for one in self.equations]
        raise InputError("number", f"there is no {shown(number)}{nearest(number, known)}")


def equations_file(project: Path, paper: str) -> Path:
    """Where the table of a paper is."""
    return project / "config" / "equations" / f"{paper}.yaml"


def papers_with_equations(project: Path) -> Sequence[str]:
    """The papers that have a table.

    Raises
    ------
    InputError
        If the folder cannot be read, or none has.
    """
    folder = equations_file(project, "x").parent
    try:
        papers = sorted(path.stem for path in folder.glob("*.yaml"))
    except (OSError, ValueError) as error:  # ValueError: a path that the system cannot spell
        raise InputError(str(folder), f"cannot be read ({reason(error)})") from None
    if not papers:
        raise InputError(str(folder), "has no table of equations; --project names another project")
    return papers


def read_equations(project: Path, paper: str) -> EquationTable:
    """The table of a paper.

    Raises
    ------
    InputError
        If the file is missing or no YAML, or an entry is not what it must be, with its key.
    """
    return parse(EquationTable, read_yaml(equations_file(project, paper)), f"equations.{paper}")


def _plain(number: str) -> str:
    """A number as it is compared."""
    words = " ".join(number.split()).casefold()
    inner = words.removeprefix("(").removesuffix(")")
    return inner if _NUMBER.fullmatch(inner) else words

"""`reobserve equations`: where an equation of a paper is implemented, and which test shows it."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path

from reobserve.errors import InputError
from reobserve.evidence.equations.sources import find_source
from reobserve.evidence.equations.table import (
    Equation,
    EquationTable,
    papers_with_equations,
    read_equations,
)
from reobserve.ledger.config import named_papers

_LABEL = 13  # letters of a line's label and the blanks after it


def show_equations(project: Path, paper: str, number: Sequence[str]) -> None:
    """Print one equation in full, or those of a paper, or how many each paper has."""
    known = papers_with_equations(project)
    if not paper:
        for one in known:
            _print_summary(one, read_equations(project, one))
        print("\nreobserve equations PAPER lists them, reobserve equations PAPER 9 shows one.")
        return
    named_papers(known, [paper])
    table = read_equations(project, paper)
    if number:
        _print_equation(project, table, table.find(" ".join(number)))
        return
    _print_summary(paper, table)
    width = max(len(one.place) for one in table.equations)
    for one in table.equations:
        where = ", ".join(name.removeprefix("reobserve.") for name in one.implemented)
        print(f"  {one.place:<{width}}  {where or '-'}")
    print(f"\nreobserve equations {paper} NUMBER says more of one.")


def _print_summary(paper: str, table: EquationTable) -> None:
    implemented = sum(bool(one.implemented) for one in table.equations)
    print(
        f"{paper}  {table.cited_as}: (1) to ({table.last}) and {len(table.equations) - table.last} "
        f"other places, {implemented} of all implemented"
    )


def _print_equation(project: Path, table: EquationTable, one: Equation) -> None:
    width = min(shutil.get_terminal_size((100, 40)).columns, 100)
    print(f"{table.cited_as}, {one.place}")
    _print_labelled("says", one.says, width)
    for name in one.implemented:
        try:
            source = find_source(name)
        except InputError as error:
            raise InputError(f"{table.cited_as}, {one.place}", f"implemented: {error}") from None
        file = source.file.resolve()
        inside = file.is_relative_to(project.resolve())
        shown = file.relative_to(project.resolve()) if inside else file
        _print_labelled("implemented", f"{name}\n{shown}:{source.line}")
    for test in one.tests:
        _print_labelled("shown by", test)
    if one.note:
        _print_labelled("note", one.note, width)


def _print_labelled(label: str, text: str, width: int = 0) -> None:
    """A label and text beside it; of a ``width`` it is filled, else its lines are kept."""
    filled = textwrap.fill(" ".join(text.split()), width - _LABEL - 2) if width else text
    print(textwrap.indent(filled, " " * (_LABEL + 2)).replace(" " * _LABEL, f"{label:<{_LABEL}}", 1))

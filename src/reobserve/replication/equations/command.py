"""`reobserve equations`: where an equation of a paper is implemented, and which test shows it."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path

from reobserve.replication.equations.sources import find_source
from reobserve.replication.equations.table import (
    Equation,
    EquationTable,
    papers_with_equations,
    read_equations,
)
from reobserve.replication.parameters.config import named_papers

_LABELS = 15  # letters of a line that are its label and the blanks after it
_WIDEST = 100


def show_equations(project: Path, paper: str, number: Sequence[str]) -> None:
    """Print one equation in full, or those of a paper, or how many each paper has."""
    known = papers_with_equations(project)
    if not paper:
        for name in known:
            print(_summary(name, read_equations(project, name)))
        print("\nreobserve equations PAPER lists them, reobserve equations PAPER 9 shows one.")
        return
    named_papers(known, [paper])
    table = read_equations(project, paper)
    if number:
        _print_equation(project, table, table.find(" ".join(number)))
        return
    print(_summary(paper, table))
    width = max(len(one.place) for one in table.equations)
    for one in table.equations:
        where = ", ".join(name.removeprefix("reobserve.") for name in one.implemented)
        print(f"  {one.place:<{width}}  {where or '-'}")
    print(f"\nreobserve equations {paper} NUMBER says more of one, and why where there is a dash.")


def _summary(paper: str, table: EquationTable) -> str:
    others = len(table.equations) - table.last
    implemented = sum(bool(one.implemented) for one in table.equations)
    return (
        f"{paper}  {table.cited_as}: (1) to ({table.last}) and {others} other places, "
        f"{implemented} of them implemented"
    )


def _print_equation(project: Path, table: EquationTable, one: Equation) -> None:
    sources = [find_source(name) for name in one.implemented]
    print(f"{table.cited_as}, {one.place}")
    _print_labelled("statement", _filled(one.statement))
    for name, source in zip(one.implemented, sources, strict=True):
        file, folder = source.file.resolve(), project.resolve()
        shown = file.relative_to(folder) if file.is_relative_to(folder) else file
        _print_labelled("implemented", [name, f"{shown}:{source.line}"])
    if not sources:
        _print_labelled("implemented", ["nowhere"])
    for test in one.tests:
        _print_labelled("shown by", [test])
    if one.note:
        _print_labelled("note", _filled(one.note))


def _filled(text: str) -> Sequence[str]:
    width = min(shutil.get_terminal_size((_WIDEST, 40)).columns, _WIDEST)
    return textwrap.wrap(" ".join(text.split()), max(width - _LABELS, _LABELS))


def _print_labelled(label: str, lines: Sequence[str]) -> None:
    for begin, line in zip([label, *[""] * len(lines)], lines, strict=False):
        print(f"{begin:<{_LABELS}}{line}")

"""Where is equation (9)? For each paper its equations, what implements them and what shows that."""

from __future__ import annotations

from collections.abc import Sequence

from docs.generate.api import is_shown
from docs.generate.evidence import Paper
from docs.generate.markdown import code, heading, plain, prose, table
from reobserve.replication.equations.table import Equation, equations_file, read_equations


def equations(papers: Sequence[Paper]) -> str:
    """The tables of those papers that have one."""
    parts = []
    for paper in papers:
        if not equations_file(paper.root, paper.name).is_file():
            continue
        found = read_equations(paper.root, paper.name)
        rows = [_row(paper.name, one) for one in found.equations]
        listed = table(("place", "what it says", "where it is"), rows)
        title = f"[*{plain(paper.about['title'])}*](../findings/{paper.name}.md)"
        cited = f"{title}, cited in docstrings as {code(found.cited_as)}."
        parts.append(f"{heading(2, code(paper.name), paper.name)}\n\n{cited}\n\n{listed}")
    return "\n".join(parts)


def anchor(paper: str, one: Equation) -> str:
    """Where an equation stands on the page."""
    return f"{paper}-{''.join(c if c.isalnum() else '-' for c in one.number.lower())}"


def _row(paper: str, one: Equation) -> tuple[str, ...]:
    place = f'<a id="{anchor(paper, one)}"></a>{plain(one.place)}'
    note = f"<br>*{prose(one.note).strip()}*" if one.note else ""
    places = [_implemented(name) for name in one.implemented]
    tests = [f"*shown by* {code(test.removeprefix('tests/'))}" for test in one.tests]
    return place, prose(one.statement) + note, "<br>".join([*places, *tests])


def _implemented(name: str) -> str:
    short = code(name.removeprefix("reobserve."))
    return f"[{short}][{name}]" if is_shown(name) else short

"""Parameters: every number of a paper with its unit, its source or its range, and the reason."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from docs.generate.evidence import Paper
from docs.generate.markdown import code, heading, plain, table, ticks
from reobserve_papers.report.assumptions import AssumptionRow

_NO_UNIT = ("1", "word", "file")


def counts(papers: Sequence[Paper]) -> str:
    """How many values each paper's parameter file has, and how many of them are assumed."""
    rows = []
    for paper in papers:
        keys = [entry for entry in paper.entries for _ in entry.keys]
        assumed = sum(entry.status == "assumed" for entry in keys)
        name = f"[`{paper.name}`]({paper.name}.md)"
        rows.append((name, plain(paper.about["title"]), f"{len(keys)}", f"{assumed}"))
    return table(("paper", "title", "values", "assumed"), rows, "llrr")


def parameters(paper: Paper) -> str:
    """All parameters of a paper, by section."""
    parts = [
        f"*{plain(paper.about['title'])}*. [What was found](../../findings/{paper.name}.md)\n",
        "Values that the paper states are listed with their place in it. The others are assumed, "
        "with the reason and the range from which another reader could have chosen. Keys with the "
        f"same entry share one row. {code(f'reobserve-papers params {paper.name} --why')} prints "
        "this in a terminal.\n",
    ]
    for section, found in groupby(paper.entries, lambda entry: entry.section):
        rows = [_row(paper, entry) for entry in found]
        head = ("key", "value", "range", "source or reason")
        parts.append(f"{heading(2, code(section), f'section-{section}')}\n\n{table(head, rows)}")
    return "\n".join(parts)


def _row(paper: Paper, entry: AssumptionRow) -> tuple[str, ...]:
    keys = "<br>".join(f'<a id="{key}"></a>{code(key)}' for key in entry.keys)
    unit = "" if entry.unit in _NO_UNIT else f" {plain(entry.unit)}"
    value = "<br>".join(map(plain, entry.value)) + unit
    text = ticks(entry.why or entry.source)
    if entry.numerical:
        text += " *Numerical: a resolution of the computation.*"
    if entry.chosen_for:
        text += f" **Chosen so that a claim holds.** {ticks(entry.chosen_for)}"
    return keys, value, "<br>".join(map(plain, entry.range)), text

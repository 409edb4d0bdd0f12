"""Parameter files: every number of a paper with its unit, its source or range, and the reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from docs.generate.evidence import Paper
from docs.generate.markdown import Page, code, plain, table, ticks
from reobserve.replication.report.assumptions import Entry

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


def pages(papers: Sequence[Paper]) -> Iterator[Page]:
    """The parameter file of each paper."""
    return map(_page, papers)


def _page(paper: Paper) -> Page:
    parts = [
        f"# Parameters of {code(paper.name)}\n\n*{plain(paper.about['title'])}*. "
        f"[What was found](../../findings/{paper.name}.md)\n",
        "What the paper gives is listed with its place there. What it does not give is assumed, "
        "with the reason and the range in which another reader could have chosen. Keys with the "
        f"same entry stand together. {code(f'reobserve params {paper.name} --why')} prints this "
        "in a terminal.\n",
    ]
    for section, found in groupby(paper.entries, lambda entry: entry.section):
        rows = [_row(paper, entry) for entry in found]
        head = ("key", "value", "range", "source or reason")
        parts.append(f"## {code(section)} {{ #section-{section} }}\n\n{table(head, rows)}")
    return Page(
        f"reference/parameters/{paper.name}.md", f"Parameters of {paper.name}", "\n".join(parts)
    )


def _row(paper: Paper, entry: Entry) -> tuple[str, ...]:
    keys = "<br>".join(f'<span id="{key}">{code(key)}</span>' for key in entry.keys)
    unit = "" if entry.unit in _NO_UNIT else f" {plain(entry.unit)}"
    value = "<br>".join(map(plain, entry.value)) + unit
    told = ticks(entry.why or entry.source)
    if entry.numerical:
        told += " *Numerical: a resolution, no physics.*"
    if entry.chosen_for:
        told += f" **Chosen so that a claim holds.** {ticks(entry.chosen_for)}"
    if entry.claims:
        links = ", ".join(
            f"[{plain(name.replace('_', ' '))}](../../findings/{paper.name}.md#claim-{name})"
            for name in entry.claims
        )
        told += f" *Claims that depend on it:* {links}."
    return keys, value, "<br>".join(map(plain, entry.range)), told

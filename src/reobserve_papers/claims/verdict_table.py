"""Results in Markdown: titles, which the README holds, too, counts of verdicts, and dissent."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import read_text, write_text
from reobserve_papers.claims.entries import Result
from reobserve_papers.claims.title import Title
from reobserve_papers.claims.verdict_rules import CONTRADICTED, REPRODUCED, VERDICTS, count

# Who set the thresholds of a claim: the paper, or we, before or after their numbers were known.
THRESHOLDS = ("stated", "before", "after")


def titles_table(titles: Mapping[str, Title], results: Mapping[str, Result | None]) -> str:
    """Papers, their titles in the manner of ReScience, main claims counted, and the result.

    The sentence of a result that was written for another title or other counts is left out.
    """
    lines = [
        "| paper | replication | main claims reproduced | contradicted | result |",
        "|---|---|---:|---:|---|",
    ]
    for paper, title in titles.items():
        reproduced = f"{title.count(REPRODUCED)} of {len(title.mains)}"
        cells = (title.word, reproduced, str(title.count(CONTRADICTED)))
        cells = cells if title.mains else ("no main claim", "", "")
        said = sentence(title, results.get(paper))
        lines.append(f"| `{paper}` | {' | '.join(cells)} | {said} |")
    return "\n".join(lines) + "\n"


def sentence(title: Title, result: Result | None) -> str:
    """The sentence of a result, empty if it was written for another title."""
    return result.sentence if result and result.written_for == title.in_words else ""


def counts_table(rows: Sequence[Mapping[str, str]]) -> str:
    """The number of claims of each paper with each verdict.

    In the last column stands how many claims have thresholds that the paper states, that were set
    here before their numbers were known, and after.
    """
    lines = [
        f"| paper | claims | {' | '.join(VERDICTS)} | thresholds |",
        f"|---|{'---:|' * (len(VERDICTS) + 1)}---|",
    ]
    for paper, counts in count(rows).items():
        cells = [str(counts[word]) for word in VERDICTS]
        who = [row["threshold"] for row in _of(rows, paper)]
        cells.append(", ".join(f"{who.count(kind)} {kind}" for kind in THRESHOLDS))
        lines.append(f"| `{paper}` | {sum(counts.values())} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def dissent(title: Title) -> str:
    """The readings that would give another title, and how many were tried."""
    if not title.mains:
        return "No claim is a main claim.\n"
    changing, lacking = len(title.dissent) or "none", title.lacking or "none"
    lines = [
        f"Of {title.tried} readings of main claims, {changing} would give another title, and "
        f"{lacking} lack samples.\n",
        *(f"- {said}" for said in title.dissent),
        *(f"- Undecided: {said}." for said in title.undecided),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _of(rows: Sequence[Mapping[str, str]], paper: str) -> list[Mapping[str, str]]:
    return [row for row in rows if row["paper"] == paper]


# Between these the README holds the table that `reobserve-papers stage verdicts` writes.
_BEGIN, _END = "<!-- verdicts -->\n", "<!-- end -->\n"


def put_into(readme: Path, verdicts: str, papers: Sequence[str]) -> None:
    """Put the first table that `reobserve-papers stage verdicts` wrote in its place in the README.

    Rows of the README on other ones of the project's ``papers`` stay.
    """
    text, table = read_text(readme), verdicts.partition("\n\n")[0].rstrip() + "\n"
    before, begin, rest = text.partition(_BEGIN)
    old, end, after = rest.partition(_END)
    if not begin or not end:
        raise InputError(str(readme), f"must have the lines {_BEGIN.strip()} and {_END.strip()}")
    head = "".join(table.splitlines(keepends=True)[:2])
    rows = (_rows(old) if head in old else {}) | _rows(table)
    table = head + "".join(rows[paper] for paper in papers if paper in rows)
    write_text(readme, f"{before}{begin}\n{table}\n{end}{after}")


def _rows(text: str) -> dict[str, str]:
    """The rows of a table by paper."""
    return {match[1]: match[0] for match in re.finditer(r"^\| `(\w+)` .*\n", text, re.MULTILINE)}

"""Verdicts in Markdown: a table of counts, which the README holds, too."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import read_text, write_text
from reobserve_papers.claims.verdicts import (
    CONTRADICTED,
    MAIN_CLAIMS,
    REPRODUCED,
    VERDICTS,
    count,
    main_claims,
    replicated,
)

# Who set the thresholds of a claim: the paper, or we, before or after their numbers were known.
THRESHOLDS = ("stated", "before", "after")


def table(rows: Sequence[Mapping[str, str]]) -> str:
    """Papers, their titles in the manner of ReScience, and how many claims got which verdict.

    In the last column stands how many claims have thresholds that the paper states, that were set
    here before their numbers were known, and after.
    """
    lines = [
        f"| paper | replication | claims | {' | '.join(VERDICTS)} | thresholds |",
        f"|---|---|{'---:|' * (len(VERDICTS) + 1)}---|",
    ]
    for paper, found in count(rows).items():
        cells = [str(found[word]) for word in VERDICTS]
        title = _title(replicated(_of(rows, paper)))
        who = [row["threshold"] for row in _of(rows, paper)]
        cells.append(", ".join(f"{who.count(one)} {one}" for one in THRESHOLDS))
        lines.append(f"| `{paper}` | {title} | {sum(found.values())} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def titles(rows: Sequence[Mapping[str, str]]) -> str:
    """The titles under the rule for main_claims and under others, in Markdown."""
    lines = [f"| paper | {' | '.join(MAIN_CLAIMS)} |", f"|---|{'---|' * len(MAIN_CLAIMS)}"]
    for paper in count(rows):
        cells = []
        for rule in MAIN_CLAIMS:
            found = main_claims(_of(rows, paper), rule)
            good, bad = (found.count(word) for word in (REPRODUCED, CONTRADICTED))
            title = _title(replicated(_of(rows, paper), rule))
            cells.append(f"{title} {good} of {len(found)}, {bad} contradicted" if found else "none")
        lines.append(f"| `{paper}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _of(rows: Sequence[Mapping[str, str]], paper: str) -> list[Mapping[str, str]]:
    return [row for row in rows if row["paper"] == paper]


def _title(good: bool) -> str:
    return "[Re]" if good else "[¬Re]"


# Between these the README holds what `reobserve-papers stage verdicts` writes.
_BEGIN, _END = "<!-- verdicts -->\n", "<!-- end -->\n"


def put_into(readme: Path, verdicts: Path, papers: Sequence[str] = ()) -> None:
    """Put what `reobserve-papers stage verdicts` wrote in its place in the README.

    With ``papers``, all that there are, what the README tells of those that the verdicts are not
    about stays.

    Raises
    ------
    InputError
        If the README has no such place, or a file cannot be read.
    """
    text, table = read_text(readme), read_text(verdicts)
    before, begin, rest = text.partition(_BEGIN)
    old, end, after = rest.partition(_END)
    if not begin or not end:
        raise InputError(str(readme), f"must have the lines {_BEGIN.strip()} and {_END.strip()}")
    table = _merged(old, table, papers) if papers else table
    write_text(readme, f"{before}{begin}\n{table}\n{end}{after}")


def _merged(old: str, new: str, papers: Sequence[str]) -> str:
    """The rows of ``papers``: in ``new``, or else in ``old``."""
    rows = _rows(new)
    head = new.partition(next(iter(rows.values())))[0] if rows else new
    merged = _rows(old) | rows
    return head + "".join(merged[one] for one in papers if one in merged)


def _rows(text: str) -> dict[str, str]:
    """The rows of a table of `table` by paper."""
    return {found[1]: found[0] for found in re.finditer(r"^\| `(\w+)` \|.*\n", text, re.M)}

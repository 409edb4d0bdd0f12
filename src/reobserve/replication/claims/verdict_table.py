"""Verdicts in Markdown: a table of counts, which the README holds, too."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import read_text, write_text
from reobserve.replication.claims.verdicts import VERDICTS, count, replicated


def table(rows: Sequence[Mapping[str, str]]) -> str:
    """Papers, their titles in the manner of ReScience, and how many claims got which verdict."""
    lines = [
        f"| paper | replication | claims | {' | '.join(VERDICTS)} |",
        f"|---|---|{'---:|' * (len(VERDICTS) + 1)}",
    ]
    for paper, found in count(rows).items():
        title = "[Re]" if replicated([row for row in rows if row["paper"] == paper]) else "[¬Re]"
        cells = [str(found[word]) for word in VERDICTS]
        total = sum(found.values())
        lines.append(f"| `{paper}` | {title} | {total} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


# Between these the README holds what `reobserve stage verdicts` writes.
_BEGIN, _END = "<!-- verdicts -->\n", "<!-- end -->\n"


def put_into(readme: Path, verdicts: Path, papers: Sequence[str] = ()) -> None:
    """Put what `reobserve stage verdicts` wrote in its place in the README.

    With ``papers``, all that there are, what the README tells of those that the verdicts are not
    about stays.

    Raises
    ------
    InputError
        If the README has no such place, or a file cannot be read.
    """
    text, told = read_text(readme), read_text(verdicts)
    before, begin, rest = text.partition(_BEGIN)
    old, end, after = rest.partition(_END)
    if not begin or not end:
        raise InputError(str(readme), f"must have the lines {_BEGIN.strip()} and {_END.strip()}")
    told = _merged(old, told, papers) if papers else told
    write_text(readme, f"{before}{begin}\n{told}\n{end}{after}")


def _merged(old: str, new: str, papers: Sequence[str]) -> str:
    """What is told of ``papers``: in ``new``, or else in ``old``."""
    rows = _rows(new)
    head = new.partition(next(iter(rows.values())))[0] if rows else new
    told = _rows(old) | rows
    return head + "".join(told[one] for one in papers if one in told)


def _rows(told: str) -> dict[str, str]:
    """The rows of a table of `table` by paper."""
    return {found[1]: found[0] for found in re.finditer(r"^\| `(\w+)` \|.*\n", told, re.M)}

"""Verdicts in Markdown: a table of counts, and the papers' figures with what they decide."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.errors import InputError
from reobserve.evidence.claims.verdicts import BROKEN, VERDICTS, count, replicated
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.files import read_text, write_text

Rows = Sequence[Mapping[str, str]]

REFERENCES = "tests/reference"  # where the pictures are


def table(rows: Rows) -> str:
    """Papers, their titles in the way of ReScience, and how many claims got which verdict."""
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


def gallery(rows: Rows, ledgers: Sequence[Ledger]) -> str:
    """The figures that the papers themselves have, with the verdicts on the claims they decide."""
    return "\n".join(_of_paper(rows, ledger) for ledger in ledgers)


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
    head, rows, galleries = _by_paper(new)
    _, old_rows, old_galleries = _by_paper(old)
    order = [one for one in papers if one in (old_rows | rows)]
    table = "".join((old_rows | rows)[one] for one in order)
    return f"{head}{table}\n" + "\n".join((old_galleries | galleries)[one] for one in order)


def _by_paper(told: str) -> tuple[str, dict[str, str], dict[str, str]]:
    """The head of the table of `table`, its rows and the parts of `gallery` by paper."""
    rows = {found[1]: found[0] for found in re.finditer(r"^\| `(\w+)` \|.*\n", told, re.M)}
    _, *parts = re.split(r"^`(\w+)`$", told, flags=re.M)
    galleries = {
        one: f"`{one}`{text.rstrip()}\n" for one, text in zip(parts[::2], parts[1::2], strict=True)
    }
    head = told.partition(next(iter(rows.values())))[0] if rows else told
    return head, rows, galleries


def _of_paper(rows: Rows, ledger: Ledger) -> str:
    # A name with more behind the number is a variant, or beyond the paper.
    figures = {
        name: body["source"]
        for name, body in ledger.tree["figures"].items()
        if name.removeprefix("fig").isdigit() and body["source"].startswith("Fig.")
    }
    pictures, told = [], []
    for name, source in figures.items():
        path = f"{REFERENCES}/{ledger.paper}/{name}.png"
        pictures.append(f"[![{source} of {ledger.paper}]({path})]({path})")
        told.append(f"`{name}`: {_verdicts(rows, ledger.paper, name)}")
    return "\n".join(
        [
            f"`{ledger.paper}`",
            "",
            f"| {' | '.join(pictures)} |",
            f"|{'---|' * len(figures)}",
            f"| {' | '.join(told)} |",
            "",
        ]
    )


def _verdicts(rows: Rows, paper: str, figure: str) -> str:
    words = [
        row["verdict"] for row in rows if row["paper"] == paper and figure in row["figures"].split()
    ]
    counts = [f"{words.count(word)} {word}" for word in (*VERDICTS, BROKEN) if word in words]
    return ", ".join(counts) or "decides no claim"

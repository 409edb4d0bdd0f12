"""Verdicts in Markdown: a table of counts, which the README holds, too."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import read_text, write_text
from reobserve_papers.claims.decider import Title
from reobserve_papers.claims.verdict_rules import VERDICTS, count

# Who set the thresholds of a claim: the paper, or we, before or after their numbers were known.
THRESHOLDS = ("stated", "before", "after")


def table(rows: Sequence[Mapping[str, str]], titles: Mapping[str, Title]) -> str:
    """Papers, their titles in the manner of ReScience, and how many claims got which verdict.

    In the last column stands how many claims have thresholds that the paper states, that were set
    here before their numbers were known, and after. Below stand the reasons of each title.
    """
    lines = [
        f"| paper | replication | claims | {' | '.join(VERDICTS)} | thresholds |",
        f"|---|---|{'---:|' * (len(VERDICTS) + 1)}---|",
    ]
    for paper, counts in count(rows).items():
        cells = [str(counts[word]) for word in VERDICTS]
        who = [row["threshold"] for row in _of(rows, paper)]
        cells.append(", ".join(f"{who.count(kind)} {kind}" for kind in THRESHOLDS))
        word = titles[paper].word
        lines.append(f"| `{paper}` | {word} | {sum(counts.values())} | {' | '.join(cells)} |")
    lines.append("")
    lines += [f"- `{paper}` {in_words(titles[paper])}" for paper in count(rows)]
    return "\n".join(lines) + "\n"


def in_words(title: Title, most: int = 3) -> str:
    """A title and its reasons, of each list of names the first ones."""
    said = []
    for reason in title.reasons:
        head, joint, names = reason.partition(" with ")
        listed = names.split("; ")
        more = f" and {len(listed) - most} more" if len(listed) > most else ""
        said.append(f"{head}{joint}{'; '.join(listed[:most])}{more}" if joint else reason)
    return (
        f"{title.word}: {'. '.join(said)}." if said else f"{title.word}: nothing tried changes it."
    )


def _of(rows: Sequence[Mapping[str, str]], paper: str) -> list[Mapping[str, str]]:
    return [row for row in rows if row["paper"] == paper]


# Between these the README holds the table that `reobserve-papers stage verdicts` writes.
_BEGIN, _END = "<!-- verdicts -->\n", "<!-- end -->\n"


def put_into(readme: Path, verdicts: str, papers: Sequence[str] = ()) -> None:
    """Put the table that `reobserve-papers stage verdicts` wrote in its place in the README.

    With ``papers``, all that there are, rows of the README on papers that the verdicts are not
    about stay.
    """
    text, table = read_text(readme), verdicts.partition("\n\n")[0].rstrip() + "\n"
    before, begin, rest = text.partition(_BEGIN)
    old, end, after = rest.partition(_END)
    if not begin or not end:
        raise InputError(str(readme), f"must have the lines {_BEGIN.strip()} and {_END.strip()}")
    if papers and (new := _rows(table)):
        rows = _rows(old) | new
        head = table.partition(next(iter(new.values())))[0]
        table = head + "".join(rows[paper] for paper in papers if paper in rows)
    write_text(readme, f"{before}{begin}\n{table}\n{end}{after}")


def title_in(readme: Path, paper: str) -> Title:
    """The title of a paper in the README's table, without reasons."""
    cells = _rows(read_text(readme)).get(paper, "||?").split("|")
    return Title(cells[2].strip())


def _rows(text: str) -> dict[str, str]:
    """The rows of `table` by paper."""
    return {match[1]: match[0] for match in re.finditer(r"^\| `(\w+)` .*\n", text, re.MULTILINE)}

"""The title of a replication, and the table of what alternatives change of it.

The title is the one by the conventions as stated. Beside it stands the dissent: the readings that
are decided and would give another title, each with its reason and the numbers it rests on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import NAME, Kind, read_table, write_table
from reobserve_papers.claims.verdict_rules import CONTRADICTED, REPRODUCED, then

Row = Mapping[str, str]  # what an alternative changes of a claim

HEADER = (
    "alternative", "kind", "change", "why", "chosen", "touches", "claim", "verdict", "held",
    "other", "other_held", "title", "other_title", "mains", "note",
)  # fmt: skip
TITLE, CLAIMS = "title", "claims"  # what an alternative touches
_KINDS = {
    "alternative": Kind(bool, "a name"), "kind": NAME,
    "touches": Kind((TITLE, CLAIMS).__contains__, f"{TITLE} or {CLAIMS}"),
}  # fmt: skip

STATED = "as stated"
MAIN, INTERVAL = "main", "interval"  # kinds: a main claim as it is, one that is not decided
LACKS = "lacks samples"  # of a verdict that no more than a lack of samples leaves open
NOT_COMPUTED = "not computed"  # of one whose numbers the samples do not have
NO_MAIN, NEW_MAIN = "no main claim", "a main claim"  # of a claim that no longer is, or becomes one

# When the reading that is taken was chosen.
_CHOSEN = {
    "": "",
    "stated": "The reading taken is the paper's own.",
    "before": "The reading taken was chosen before its numbers were known.",
    "after": "The reading taken was chosen after its numbers were known.",
}


@dataclass(frozen=True)
class Title:
    """The title of a replication by the conventions as stated.

    ``mains`` are the verdicts on the main claims, ``dissent`` says in words which decided readings
    would change the title, ``undecided`` which verdicts that samples still allow would. ``tried``
    is the number of readings of main claims, ``lacking`` how many of them lack samples.
    """

    word: str
    mains: Mapping[str, str] = field(default_factory=dict)
    dissent: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    tried: int = 0
    lacking: int = 0

    def count(self, verdict: str) -> int:
        """The number of main claims with a verdict."""
        return [*self.mains.values()].count(verdict)

    @property
    def counted(self) -> str:
        """The number of main claims that are reproduced and contradicted, in words."""
        return counts_of(list(self.mains.values()))

    @property
    def in_words(self) -> str:
        """The title, and how many main claims are reproduced and contradicted."""
        return f"{self.word}, {self.counted}"


def counts_of(verdicts: Sequence[str]) -> str:
    """The number of main claims that are reproduced and contradicted, from their verdicts."""
    return (
        f"{verdicts.count(REPRODUCED)} of {len(verdicts)} main claims reproduced, "
        f"{verdicts.count(CONTRADICTED)} contradicted"
    )


def title_from(rows: Sequence[Row]) -> Title:
    """The title, from the rows of `write_alternatives`."""
    mains = {row["claim"]: row["verdict"] for row in rows if row["kind"] == MAIN}
    changing = [row for row in rows if row["other_title"] != row["title"]]
    tried = [row for row in _readings(rows) if row["touches"] == TITLE]
    lacking = {
        row["alternative"]
        for row in tried
        if row["note"] in (LACKS, NOT_COMPUTED) and row["claim"] in row["mains"].split()
    }
    by_name = groupby(_readings(changing), lambda row: row["alternative"])
    return Title(
        rows[0]["title"],
        mains,
        tuple(_dissent(list(group)) for _, group in by_name),
        tuple(
            f"{row['other_title']} if `{row['claim']}` is {row['other']}, which its samples allow: "
            f"it holds in {row['held']}"
            for row in changing
            if row["kind"] == INTERVAL
        ),
        len({row["alternative"] for row in tried}),
        len(lacking),
    )


def _readings(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["kind"] not in (MAIN, INTERVAL, TITLE)]


def _dissent(rows: Sequence[Row]) -> str:
    """Say what a reading changes, and why one could read it so."""
    first = rows[0]
    said = []
    for row in rows:
        if row["note"] == NO_MAIN:
            said.append(f"`{row['claim']}` is then no main claim")
        elif row["note"] == NEW_MAIN:
            said.append(f"`{row['claim']}` is then a main claim, {row['other']}")
        elif row["claim"] in row["mains"].split() and row["other"] not in ("", row["verdict"]):
            stated = f"{row['held']} as stated" if row["held"] else ""
            numbers = ", ".join(filter(None, [row["other_held"], stated]))
            listed = f" ({numbers})" if numbers else ""
            said.append(f"`{row['claim']}` {then(row['other'])}{listed}")
    if not said:
        said = [f"Then {first['other_held']}; as stated {first['held']}"]
    changes = f"{first['other_title']}: {first['why']} {'; '.join(said)}."
    return f"{changes} {_CHOSEN[first['chosen']]}".rstrip()


def row_as_stated(title: str, mains: Iterable[str] = ()) -> dict[str, str]:
    """The first row of a table of alternatives, of which the others have parts."""
    return {
        **dict.fromkeys(HEADER, ""), "alternative": STATED, "kind": TITLE, "touches": TITLE,
        "title": title, "other_title": title, "mains": " ".join(mains),
    }  # fmt: skip


def write_alternatives(path: Path, rows: Iterable[Row]) -> None:
    """Write what alternatives change: the title, main claims as stated, then the alternatives."""
    write_table(path, rows, HEADER, seal=True)


def read_alternatives(path: Path) -> tuple[Title, list[dict[str, str]]]:
    """The title, and the rows of `write_alternatives` that are about alternatives."""
    rows = read_table(path, HEADER, _KINDS, ("alternative", "claim"))
    if not rows or rows[0]["kind"] != TITLE:
        raise InputError(str(path), "has no title in its first row")
    return title_from(rows), [dict(row) for row in _readings(rows)]

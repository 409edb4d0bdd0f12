"""Golden verdicts: what was accepted of each claim, compared with a build.

A verdict needs many Monte Carlo samples. A build with few samples can compare ``holds`` alone:
whether a claim holds with the parameters as they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from reobserve.errors import InputError
from reobserve.evidence.claims.table import HEADER, KINDS
from reobserve.evidence.golden.comparison import Moved
from reobserve.plain_data.files import read_table, write_table

_COMPARED = ("verdict", "holds")
_KEY = ("paper", "claim")
_HEADER = (*_KEY, *_COMPARED)
_KINDS = {name: KINDS[name] for name in (*_KEY, "verdict")}
_NONE = "none"

Verdicts = dict[str, dict[str, dict[str, str]]]  # by paper and claim: verdict, and holds


def golden_file(project: Path) -> Path:
    """Where the golden verdicts are."""
    return project / "tests" / "golden" / "claims.csv"


def read_golden(project: Path) -> Verdicts:
    """The accepted verdicts; `InputError` if the file is missing or damaged."""
    return _by_paper(read_table(golden_file(project), _HEADER, _KINDS, _KEY))


def read_built(results: Path) -> Verdicts:
    """The verdicts of a build; `InputError` if there are none, or the file is damaged."""
    return _by_paper(read_table(results / "claims.csv", HEADER, KINDS, _KEY))


def compare(
    golden: Verdicts, found: Verdicts, paper: str, columns: Sequence[str] = _COMPARED
) -> Iterator[Moved]:
    """The claims of a paper that differ in one of these columns, that are new, or that are gone."""
    before, now = golden.get(paper, {}), found.get(paper, {})
    for claim in dict.fromkeys([*before, *now]):
        for column in columns:
            old, new = (side.get(claim, {}).get(column, _NONE) for side in (before, now))
            if old != new:
                yield Moved(f"{paper} {claim}, {column}", old, new)


def renew(project: Path, results: Path, papers: Sequence[str] = ()) -> list[str]:
    """Accept the verdicts of a build, of all or of some papers; what moved, a line each.

    Raises
    ------
    InputError
        If the build has no verdicts.
    """
    found = read_built(results)
    try:
        golden = read_golden(project)
    except InputError as error:
        golden, moved = {}, [f"claims: all verdicts are new ({error})"]
    else:
        chosen = dict.fromkeys(papers or [*golden, *found])
        moved = [str(cell) for paper in chosen for cell in compare(golden, found, paper)]
    others = {paper: claims for paper, claims in golden.items() if papers and paper not in papers}
    kept = found | others
    order = filter(kept.__contains__, dict.fromkeys([*golden, *found]))
    rows = (
        {"paper": paper, "claim": claim, **row}
        for paper in order
        for claim, row in kept[paper].items()
    )
    write_table(golden_file(project), rows, _HEADER)
    return moved


def _by_paper(rows: list[dict[str, str]]) -> Verdicts:
    verdicts: Verdicts = {}
    for row in rows:
        kept = {column: row[column] for column in _COMPARED}
        verdicts.setdefault(row["paper"], {})[row["claim"]] = kept
    return verdicts

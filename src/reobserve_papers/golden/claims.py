"""Golden verdicts: what was accepted of each claim, compared with a build."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from reobserve.core.files import Kind, read_table, write_table
from reobserve_papers.claims.table import HEADER, KINDS
from reobserve_papers.golden.comparison import Moved

_KEY = ("paper", "claim")
_COMPARED = ("verdict", "holds")
_KINDS = {name: KINDS[name] for name in (*_KEY, "verdict")}
_KINDS["holds"] = Kind(("", "yes", "no").__contains__, "yes, no or empty")

Verdicts = dict[str, dict[str, dict[str, str]]]  # verdict and holds, by paper and claim


def golden_file(project: Path) -> Path:
    """The file of the golden verdicts."""
    return project / "tests" / "golden" / "claims.csv"


def read_golden(project: Path) -> Verdicts:
    """The accepted verdicts, or `InputError` if the file is missing or damaged."""
    return _read(golden_file(project), (*_KEY, *_COMPARED))


def read_built(results: Path) -> Verdicts:
    """The verdicts of a build, or `InputError` if there are none, or the file is damaged."""
    return _read(results / "claims.csv", HEADER)


def _read(path: Path, header: Sequence[str]) -> Verdicts:
    verdicts: Verdicts = {}
    for row in read_table(path, header, _KINDS, _KEY):
        verdict = {column: row[column] for column in _COMPARED}
        verdicts.setdefault(row["paper"], {})[row["claim"]] = verdict
    return verdicts


def compare(golden: Verdicts, built: Verdicts, paper: str) -> Iterator[Moved]:
    """The claims of a paper that differ, that are new, or that are gone."""
    before, now = golden.get(paper, {}), built.get(paper, {})
    for claim in dict.fromkeys([*before, *now]):
        for column in _COMPARED:
            old, new = (side.get(claim, {}).get(column, "none") for side in (before, now))
            if old != new:
                yield Moved(f"{paper} {claim}, {column}", old, new)


def renew(project: Path, results: Path, papers: Sequence[str] = ()) -> list[str]:
    """Accept the verdicts of a build, of all or of some papers, and return what moved."""
    built = read_built(results)
    golden = read_golden(project) if golden_file(project).exists() else {}
    chosen = papers or list(dict.fromkeys([*golden, *built]))
    moved = [str(move) for paper in chosen for move in compare(golden, built, paper)]
    accepted = golden | {paper: built.get(paper, {}) for paper in chosen}
    rows = (
        {"paper": paper, "claim": claim, **row}
        for paper, claims in accepted.items()
        for claim, row in claims.items()
    )
    write_table(golden_file(project), rows, (*_KEY, *_COMPARED))
    return moved

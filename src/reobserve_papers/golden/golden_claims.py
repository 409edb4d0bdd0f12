"""Golden verdicts: what was accepted of each claim, compared with a build."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from reobserve.core.files import Kind, read_table, write_table
from reobserve_papers.claims.claims_table import HEADER, KINDS
from reobserve_papers.claims.conventions import read_conventions
from reobserve_papers.claims.registry import read_claims
from reobserve_papers.claims.title import read_alternatives
from reobserve_papers.claims.verdict_rules import BROKEN, NOT_TESTABLE, UNDECIDED, VERDICTS
from reobserve_papers.claims.verdict_table import titles_table
from reobserve_papers.golden.comparison import Moved

_KEY = ("paper", "claim")
_COMPARED = ("verdict", "holds")
_KINDS = {name: KINDS[name] for name in _KEY}
# What accepting adds to the verdict on a claim whose samples of now do not decide it.
NOT_SAMPLED = ", not sampled since"
_MARKED = (*VERDICTS, *(verdict + NOT_SAMPLED for verdict in VERDICTS))
_KINDS["verdict"] = Kind((*_MARKED, BROKEN).__contains__, "a verdict")
_KINDS["holds"] = Kind(("", "yes", "no").__contains__, "yes, no or empty")

Verdicts = dict[str, dict[str, dict[str, str]]]  # verdict and holds, by paper and claim


def golden_file(project: Path) -> Path:
    """The file of the golden verdicts."""
    return project / "tests" / "golden" / "claims.csv"


def read_golden(project: Path) -> Verdicts:
    """The accepted verdicts, or `InputError` if the file is missing or damaged."""
    return _read(golden_file(project), (*_KEY, *_COMPARED))


def read_built(results: Path) -> Verdicts:
    """The verdicts of a build, or `InputError` if there are none, or the file is damaged.

    A claim that is undecided with fewer samples than are enough `lacks` some.
    """
    enough = read_conventions(results.parent).values["samples"]
    return _read(results / "claims.csv", HEADER, enough)


def _read(path: Path, header: Sequence[str], enough: int = 0) -> Verdicts:
    verdicts: Verdicts = {}
    for row in read_table(path, header, _KINDS, _KEY):
        verdict = {column: row[column] for column in _COMPARED}
        if verdict["verdict"] == UNDECIDED and int(row.get("samples") or 0) < enough:
            verdict["lacks"] = "yes"
        verdicts.setdefault(row["paper"], {})[row["claim"]] = verdict
    return verdicts


def compare(golden: Verdicts, built: Verdicts, paper: str) -> Iterator[Moved]:
    """The claims of a paper that differ, that are new, or that are gone, but those of `lacking`."""
    before, now = golden.get(paper, {}), built.get(paper, {})
    lack = lacking(golden, built, paper)
    for claim in dict.fromkeys([*before, *now]):
        for column in _COMPARED:
            old, new = (side.get(claim, {}).get(column, "none") for side in (before, now))
            if old.removesuffix(NOT_SAMPLED) != new and (claim, column) not in lack:
                yield Moved(f"{paper} {claim}, {column}", old, new)


def lacking(golden: Verdicts, built: Verdicts, paper: str) -> dict[tuple[str, str], str]:
    """The accepted verdicts that the samples of a build neither confirm nor overturn, by place."""
    accepted = golden.get(paper, {})
    return {
        (claim, "verdict"): accepted[claim]["verdict"].removesuffix(NOT_SAMPLED)
        for claim, row in built.get(paper, {}).items()
        if "lacks" in row
        and accepted.get(claim, row)["verdict"] not in (UNDECIDED, NOT_TESTABLE, BROKEN)
    }


def read_accepted(project: Path) -> Verdicts:
    """The accepted verdicts, or none if nothing was accepted yet."""
    return read_golden(project) if golden_file(project).exists() else {}


def accepted_table(project: Path, results: Path) -> str:
    """The table of titles of a build, without papers whose main claims lack samples now."""
    rows, golden = read_table(results / "claims.csv", HEADER, KINDS, _KEY), read_golden(project)
    titles, lacking = {}, set()
    for row in rows:
        paper, accepted = row["paper"], golden.get(row["paper"], {}).get(row["claim"], row)
        if paper not in titles:
            titles[paper] = read_alternatives(results / paper / "alternatives.csv")[0]
        if accepted["verdict"].endswith(NOT_SAMPLED) and row["promised"]:
            lacking.add(paper)
    sampled = {paper: title for paper, title in titles.items() if paper not in lacking}
    return titles_table(sampled, {paper: read_claims(project, paper).result for paper in sampled})


def renew(project: Path, results: Path, papers: Sequence[str] = ()) -> list[str]:
    """Accept the verdicts of a build, of all or of some papers, and return what moved.

    A verdict that its samples do not decide any more stays, and is marked.
    """
    built, golden = read_built(results), read_accepted(project)
    chosen = papers or list(dict.fromkeys([*golden, *built]))
    moved = [str(move) for paper in chosen for move in compare(golden, built, paper)]
    for paper in chosen:
        for (claim, column), verdict in lacking(golden, built, paper).items():
            built[paper][claim][column] = verdict + NOT_SAMPLED
            moved.append(f"{paper} {claim}: {verdict}{NOT_SAMPLED}")
    accepted = golden | {paper: built.get(paper, {}) for paper in chosen}
    rows = (
        {"paper": paper, "claim": claim, **{column: row[column] for column in _COMPARED}}
        for paper, claims in accepted.items()
        for claim, row in claims.items()
    )
    write_table(golden_file(project), rows, (*_KEY, *_COMPARED))
    return moved

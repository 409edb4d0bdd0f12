"""Claims with their verdicts as the build computed them, and what they add up to."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from reobserve.errors import InputError
from reobserve.evidence.claims.robustness import Robustness as Drawn
from reobserve.evidence.claims.robustness_file import read_robustness
from reobserve.evidence.claims.table import HEADER, NOT_LOOKED_FOR
from reobserve.evidence.claims.verdicts import BROKEN, VERDICTS
from reobserve.evidence.claims.verdicts import replicated as rows_replicated
from reobserve.evidence.claims.verdicts import title_margin as rows_margin
from reobserve.evidence.report.model import Claim, Gap, Robustness
from reobserve.evidence.report.reading import Project

CLAIMS_FILE = "results/claims.csv"

# In the order in which the page counts them.
ALL_VERDICTS = (*VERDICTS, BROKEN)


def read_claims(project: Project) -> list[dict[str, str]] | Gap:
    """The rows of all papers' claims, or why there are none."""
    try:
        return project.table(CLAIMS_FILE, HEADER)
    except InputError as error:
        return project.gaps.add("summary", error)


def paper_claims(
    project: Project, paper: str, rows: list[dict[str, str]] | Gap
) -> tuple[tuple[Claim, ...] | Gap, Gap | None]:
    """The claims of a paper or why there are none, and why their robustness is not told in full."""
    if isinstance(rows, Gap):
        return rows, None
    own = [row for row in rows if row["paper"] == paper]
    if not own:
        return project.gaps.add(f"{paper}-claims", f"{CLAIMS_FILE}: has no claim of {paper}"), None
    path = f"results/{paper}/robustness.json"
    missing = None
    draws: Mapping[str, Drawn] = {}
    try:
        draws = project.named(path, lambda file: read_robustness(file, paper))
    except InputError as error:
        missing = project.gaps.add(f"{paper}-claims", error)
    claims: list[Claim] = []
    for row in own:
        try:
            claims.append(_claim(project, row, draws.get(row["claim"], Drawn())))
        except ValueError as error:
            problem = f"{CLAIMS_FILE}: {paper}.{row['claim']} cannot be read ({error})"
            damaged = {**row, "draws": "", "verdict": BROKEN, "problem": problem}
            claims.append(_claim(project, damaged, Drawn()))
    return tuple(claims), missing


def _claim(project: Project, row: Mapping[str, str], draws: Drawn) -> Claim:
    if row["verdict"] not in ALL_VERDICTS:
        raise ValueError(f"{row['verdict']!r} is no verdict")
    problem = None
    if row["verdict"] == BROKEN:
        sentence = row["problem"] or f"{row['paper']}.{row['claim']}: cannot be decided"
        problem = project.gaps.add(f"{row['paper']}-claim-{row['claim']}", sentence)
    return claim_of_row(row, draws, problem)


def claim_of_row(row: Mapping[str, str], draws: Drawn, problem: Gap | None = None) -> Claim:
    """A claim from its row of the table, all cells as text, and from its draws."""
    return Claim(
        name=row["claim"],
        headline=row["headline"] == "yes",
        place=row["place"],
        says=row["says"],
        verdict=row["verdict"],
        holds=row["holds"],
        measured=_checks(row["measured"]),
        why=row["why"],
        threshold=row["threshold"],
        room=row["room"],
        figures=tuple(row["figures"].split()),
        depends_on=tuple(row["depends_on"].split()),
        robustness=_robustness(row, draws),
        problem=problem,
    )


def _checks(measured: str) -> tuple[str, ...]:
    """What was measured, check by check: each begins with the figure or the theory it names."""
    return tuple(filter(None, re.split(r"; (?=(?:fig\w+|theory) )", measured)))


def _robustness(row: Mapping[str, str], draws: Drawn) -> Robustness | None:
    if not row["draws"] or int(row["draws"]) == 0:
        return None
    looked = row["flip"] != NOT_LOOKED_FOR
    key, _, moved = row["flip"].partition(" ") if looked else ("", "", "")
    return Robustness(
        draws=int(row["draws"]),
        held=int(row["held"]),
        share=float(row["share"]),
        low=float(row["low"]),
        high=float(row["high"]),
        flip_key=key,
        flip=moved,
        looked=looked,
        diverged=draws.diverged,
        refused=len(draws.refused),
        kept=draws.kept,
    )


def counts(claims: Sequence[Claim]) -> dict[str, int]:
    """How many claims have each verdict."""
    return {verdict: sum(c.verdict == verdict for c in claims) for verdict in ALL_VERDICTS}


def replicated(claims: Sequence[Claim]) -> bool | None:
    """Whether a replication succeeded, [Re] or [¬Re]; None without claims."""
    return rows_replicated(_rows(claims)) if claims else None


def title_margin(claims: Sequence[Claim]) -> str:
    """How near that is to the other; see `claims.verdicts.title_margin`."""
    return rows_margin(_rows(claims))


def _rows(claims: Sequence[Claim]) -> list[dict[str, str]]:
    return [
        {"headline": "yes" if claim.headline else "", "verdict": claim.verdict} for claim in claims
    ]

"""The word for what was found of a claim."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping

from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.robustness import Robustness, finding
from reobserve_papers.parameters.parameters import Parameters

REPRODUCED = "reproduced"
CALIBRATED = "reproduced only by calibration"
DEPENDS = "depends on unstated choices"
CONTRADICTED = "contradicted"
UNDECIDED = "undecided"
NOT_TESTABLE = "not testable"
BROKEN = "broken"
VERDICTS = (REPRODUCED, CALIBRATED, DEPENDS, CONTRADICTED, UNDECIDED, NOT_TESTABLE)

Row = Mapping[str, str]  # of the table of claims


def verdict(claim: Claim, parameters: Parameters, held: bool, robustness: Robustness | None) -> str:
    """The verdict on a claim.

    Parameters
    ----------
    claim
        Of the paper of the parameter file.
    parameters
        Says which of the values that the claim depends on were chosen for a claim.
    held
        Whether its checks hold with the parameter file.
    robustness
        Over samples of what it depends on; None if that is nothing. What they decide is in
        `reobserve_papers.claims.robustness.finding`.
    """
    if not claim.testable:
        return NOT_TESTABLE
    if claim.quantifier == "is" and held and chosen_keys(claim, parameters):
        return CALIBRATED
    number, true = (robustness.samples, robustness.held) if robustness is not None else (0, 0)
    found, firm = finding(claim.quantifier, held, true, number)
    if firm is None:
        return UNDECIDED
    if not firm:
        return DEPENDS
    return REPRODUCED if found else CONTRADICTED


def chosen_keys(claim: Claim, parameters: Parameters) -> list[str]:
    """The keys that a claim depends on whose values were chosen for a claim."""
    entries = dict(parameters.entries())
    return [key for key in claim.keys if "chosen_for" in entries.get(key, {})]


def count(rows: Iterable[Row]) -> dict[str, dict[str, int]]:
    """Claims by paper and verdict, from the rows of the table of claims."""
    counts: dict[str, dict[str, int]] = {}
    for row in rows:
        paper = counts.setdefault(row["paper"], dict.fromkeys((*VERDICTS, BROKEN), 0))
        paper[row["verdict"]] += 1
    return counts


# Which claims are main_claims: the rule, and what else one might have chosen.
MAIN_CLAIMS: Mapping[str, Callable[[Row], bool]] = {
    "abstract and conclusions": lambda row: bool(row["promised"]),
    "abstract": lambda row: "abstract" in row["promised"],
    "conclusions": lambda row: "conclusions" in row["promised"],
    "figures": lambda row: re.search(r"\bFigs?\b", row["place"]) is not None,
    "all claims": lambda row: True,
}
RULE = "abstract and conclusions"


def main_claims(rows: Iterable[Row], rule: str = RULE) -> list[str]:
    """The verdicts on the main claims of a paper, without claims that nothing can test."""
    found = [row["verdict"] for row in rows if MAIN_CLAIMS[rule](row)]
    return [word for word in found if word != NOT_TESTABLE]


def replicated(rows: Iterable[Row], rule: str = RULE) -> bool:
    """True if a paper's replication is titled [Re], from the rows of its claims.

    That is so if no main claim is contradicted or broken, and more than half are reproduced.
    """
    found = main_claims(rows, rule)
    failed = sum(word in (CONTRADICTED, BROKEN) for word in found)
    return not failed and 2 * found.count(REPRODUCED) > len(found)


def title_margin(rows: Iterable[Row]) -> str:
    """The distance of a replication's title from the other one, or nothing without main claims."""
    rows = list(rows)
    found = main_claims(rows)
    if not found:
        return ""
    good = found.count(REPRODUCED)
    failed = sum(word in (CONTRADICTED, BROKEN) for word in found)
    needed = len(found) // 2 + 1
    counts = f"{good} of {len(found)} main claims are reproduced and {failed} contradicted"
    if replicated(rows):
        lost = good - needed + 1
        return f"{counts}; it would be [¬Re] with one contradicted or {lost} fewer reproduced"
    wanted = [f"{failed} fewer contradicted"] if failed else []
    # One that is no longer contradicted may be one that is reproduced.
    wanted += [f"{needed - good} more reproduced"] if needed > good else []
    return f"{counts}; it would be [Re] with {' and '.join(wanted)}"

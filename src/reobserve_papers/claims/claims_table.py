"""The table of all claims: what was measured, what was asked, the verdict and how firm it is."""

from __future__ import annotations

from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.files import COUNT, GAP, NAME, Kind
from reobserve_papers.claims.checks import Numbers
from reobserve_papers.claims.decider import Decider
from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.margins import format_margins, margins
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.separation import SEPARATED, separation
from reobserve_papers.claims.verdict_rules import BROKEN, CALIBRATED, CONTRADICTED, VERDICTS

HEADER = (
    "paper", "claim", "promised", "quantifier", "place", "statement", "verdict", "holds",
    "measured", "why", "threshold", "margin", "figures", "depends_on", "samples", "held", "tied",
    "opposed", "void", "share", "low", "high", "null", "choice",
    "explained", "separation", "setting", "problem",
)  # fmt: skip


# A broken claim has a problem and nothing else; what depends on nothing was not sampled.
KINDS = {
    "paper": NAME, "claim": NAME, "verdict": Kind((*VERDICTS, BROKEN).__contains__, "a verdict"),
    "samples": COUNT, "held": COUNT, "tied": COUNT, "opposed": COUNT, "void": COUNT,
    "share": GAP, "low": GAP, "high": GAP, "null": GAP, "explained": GAP,
}  # fmt: skip


def row(
    claim: Claim, decider: Decider, numbers: Numbers, samples: Robustness | None
) -> dict[str, Any]:
    """The row of a claim, which is broken if it names a number that nobody has."""
    cells: dict[str, Any] = {
        "paper": claim.paper,
        "claim": claim.name,
        "promised": " ".join(claim.promised),
        "quantifier": claim.quantifier,
        "place": claim.place,
        "statement": claim.statement,
        "why": claim.why,
        "threshold": claim.threshold,
        "figures": " ".join(claim.figures),
        "depends_on": " ".join(claim.keys),
    }
    if not claim.testable:
        return cells | {"verdict": decider.judged[claim.name].verdict}
    place = f"claims.{claim.paper}.{claim.name}"
    try:
        measured = "; ".join(check.measured(numbers) for check in claim.checks)
    except InputError as error:
        return cells | {"verdict": BROKEN, "problem": f"{place}: {error}"}
    if samples is not None and samples.alike(claim):
        problem = (
            f"{place}: all {samples.samples} samples give the same "
            "numbers, must name a choice that reaches them or depend on nothing"
        )
        return cells | {"verdict": BROKEN, "problem": problem}
    if samples is None and claim.choices:
        problem = f"{place}: has no samples, must be sampled again"
        return cells | {"verdict": BROKEN, "problem": problem}
    share = decider.conventions.values["share"]
    outcomes = decider.outcomes(claim)
    counted = decider.counted(claim, outcomes)
    sampled = [trial.numbers for trial in samples.trials] if samples else [decider.nominal(claim)]
    cases = [one for one, word in zip(sampled, outcomes, strict=True) if word != "no case"]
    word = decider.judged[claim.name].verdict
    cells |= {
        "verdict": word,
        "holds": "yes" if decider.holds(claim) else "no",
        "measured": measured,
        "margin": format_margins(margins(claim, cases, counted.whole, share)),
    }
    if word in (CALIBRATED, CONTRADICTED) and (setting := decider.setting(claim)):
        cells["setting"] = setting
    if samples is not None:
        low, high = counted.interval()
        cells |= {
            "samples": counted.samples,
            "held": counted.held,
            "tied": outcomes.count("tie"),
            "opposed": outcomes.count("opposed"),
            "void": outcomes.count("no case"),
            "share": f"{counted.held / max(counted.samples, 1):.4g}",
            "low": f"{low:.4g}",
            "high": f"{high:.4g}",
        }
        if word in SEPARATED:
            found = separation(claim, samples, outcomes)
            cells |= {"choice": found.choice, "separation": found.sentence}
            if found.explained is not None:
                cells["explained"] = f"{found.explained:.3f}"
    if claim.null:
        nulls = decider.counted(claim.with_null, decider.outcomes(claim.with_null))
        cells["null"] = f"{nulls.held / max(nulls.samples, 1):.4g}"
    return cells


def broken_row(paper: str, problem: str) -> dict[str, Any]:
    """The row in place of the claims of a paper whose registry cannot be read."""
    return {"paper": paper, "claim": "all", "verdict": BROKEN, "problem": problem}

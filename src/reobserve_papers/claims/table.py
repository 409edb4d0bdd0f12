"""The table of all claims: what was measured, what was asked, the verdict and how firm it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.files import COUNT, GAP, NAME, Kind
from reobserve_papers.claims.checks import Numbers
from reobserve_papers.claims.margins import format_margins, margins
from reobserve_papers.claims.outcomes import outcome
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.reversals import Reversal, is_number
from reobserve_papers.claims.robustness import Robustness
from reobserve_papers.claims.verdicts import BROKEN, VERDICTS, verdict
from reobserve_papers.parameters.parameters import Parameters, leaves

HEADER = (
    "paper", "claim", "promised", "quantifier", "place", "statement", "verdict", "holds",
    "measured", "why", "threshold", "margin", "figures", "depends_on", "samples", "held", "share",
    "low", "high", "reversal", "problem",
)  # fmt: skip

NOT_LOOKED_FOR = "not looked for"  # in place of a reversal


# A broken claim has a problem and nothing else; what depends on nothing was not sampled.
KINDS = {
    "paper": NAME, "claim": NAME, "verdict": Kind((*VERDICTS, BROKEN).__contains__, "a verdict"),
    "samples": COUNT, "held": COUNT, "share": GAP, "low": GAP, "high": GAP,
}  # fmt: skip


def row(
    claim: Claim, parameters: Parameters, numbers: Numbers, robustness: Robustness | None
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
    try:
        stated = outcome(claim, numbers)
        measured = "; ".join(check.measured(numbers) for check in claim.checks)
    except InputError as error:
        problem = f"claims.{claim.paper}.{claim.name}: {error}"
        return cells | {"verdict": BROKEN, "problem": problem}
    if robustness is not None and robustness.alike:
        problem = (
            f"claims.{claim.paper}.{claim.name}: all {robustness.samples} samples give the same "
            "numbers, must name a choice that reaches them or depend on nothing"
        )
        return cells | {"verdict": BROKEN, "problem": problem}
    cells["verdict"] = verdict(claim, parameters, stated.held, robustness)
    if not claim.testable:
        return cells
    drawn = [trial.outcome for trial in robustness.trials] if robustness else []
    cells |= {
        "holds": "yes" if stated.held else "no",
        "measured": measured,
        "margin": format_margins(margins(claim, stated, drawn)),
    }
    if robustness is not None and robustness.samples:
        low, high = robustness.interval()
        cells |= {
            "samples": robustness.samples,
            "held": robustness.held,
            "share": f"{robustness.share:.4g}",
            "low": f"{low:.4g}",
            "high": f"{high:.4g}",
            "reversal": format_reversal(robustness.reversal)
            if robustness.looked
            else NOT_LOOKED_FOR,
        }
    return cells


def broken_row(paper: str, problem: str) -> dict[str, Any]:
    """The row in place of the claims of a paper whose registry cannot be read."""
    return {"paper": paper, "claim": "all", "verdict": BROKEN, "problem": problem}


def format_reversal(reversal: Reversal | None) -> str:
    """A change of the parameter file in words, or nothing if none reverses the claim."""
    if reversal is None:
        return ""
    if is_number(reversal.start):
        unit = _unit(reversal)
        return (
            f"{reversal.key} from {reversal.start:.4g} to {reversal.end:.4g}{unit and ' '}{unit} "
            f"({100 * reversal.size:.2g} % of its range)"
        )
    before, after = dict(leaves(reversal.start)), dict(leaves(reversal.end))
    if before.keys() != after.keys():
        return f"{reversal.key} from {_spelled(before)} to {_spelled(after)}"
    # Of a signal only what is different.
    moved = [path for path in before if before[path] != after[path]]
    place = f" {', '.join(str(path[-1]) for path in moved)}" if moved[0] else ""
    start, end = (", ".join(str(side[path]) for path in moved) for side in (before, after))
    return f"{reversal.key}{place} from {start} to {end}"


def _unit(reversal: Reversal) -> str:
    """The unit of one number, or of an entry with several that of its place, if it has a place."""
    units = reversal.unit.split(", ")
    if len(units) == 1:
        return "" if reversal.unit == "1" else reversal.unit
    place = reversal.key.rpartition(".")[2]
    return units[int(place)] if place.isdigit() and int(place) < len(units) else ""


def _spelled(found: Mapping[tuple[str | int, ...], Any]) -> str:
    return " ".join(str(value) for value in found.values())

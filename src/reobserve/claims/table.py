"""The table of all claims: what was measured, what was asked, the verdict and how firm it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.claims.checks import Numbers
from reobserve.claims.registry import Claim
from reobserve.claims.robustness import Flip, Robustness, holds
from reobserve.claims.verdicts import BROKEN, verdict
from reobserve.errors import InputError
from reobserve.ledger import Ledger

HEADER = (
    "paper", "claim", "headline", "place", "says", "verdict", "holds", "measured", "why",
    "figures", "hangs_on", "draws", "held", "share", "low", "high", "flip", "problem",
)  # fmt: skip


def row(
    claim: Claim, ledger: Ledger, numbers: Numbers, robustness: Robustness | None
) -> dict[str, Any]:
    """What is known of a claim; a number that it names and nobody has makes it broken."""
    told: dict[str, Any] = {
        "paper": claim.paper,
        "claim": claim.name,
        "headline": "yes" if claim.headline else "",
        "place": claim.place,
        "says": claim.says,
        "why": claim.why,
        "figures": " ".join(claim.figures),
        "hangs_on": " ".join(claim.keys),
    }
    try:
        held = holds(claim, numbers)
        measured = "; ".join(check.told(numbers) for check in claim.checks)
    except InputError as error:
        problem = f"claims.{claim.paper}.{claim.name}: {error}"
        return told | {"verdict": BROKEN, "problem": problem}
    told["verdict"] = verdict(claim, ledger, held, robustness)
    if claim.problem or not claim.testable:
        return told | {"problem": claim.problem}
    told |= {"holds": "yes" if held else "no", "measured": measured}
    if robustness is not None and robustness.draws:
        low, high = robustness.interval()
        told |= {
            "draws": robustness.draws,
            "held": robustness.held,
            "share": f"{robustness.share:.4g}",
            "low": f"{low:.4g}",
            "high": f"{high:.4g}",
            "flip": tell_flip(robustness.flip),
        }
    return told


def broken_row(paper: str, problem: str) -> dict[str, Any]:
    """In place of the claims of a paper whose registry cannot be read."""
    return {"paper": paper, "claim": "all", "verdict": BROKEN, "problem": problem}


def tell_flip(flip: Flip | None) -> str:
    """A change of the ledger in words; nothing if none flips the claim."""
    if flip is None:
        return ""
    start, end = (_told(value) for value in (flip.start, flip.end))
    if not isinstance(flip.start, int | float) or isinstance(flip.start, bool):
        return f"{flip.key} from {start} to {end}"
    return f"{flip.key} from {start} to {end} {flip.unit} ({flip.size:.2g} of its range)"


def _told(value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:.4g}"
    return str(value)


def robustness_data(robustness: Robustness, claim: Claim) -> dict[str, Any]:
    """As JSON keeps it."""
    low, high = robustness.interval()
    flip = robustness.flip
    return {
        "draws": robustness.draws,
        "held": robustness.held,
        "diverged": robustness.diverged,
        "refused": robustness.refused,
        "share": robustness.share if robustness.draws else None,
        "low": low,
        "high": high,
        "flip": flip
        and {
            "key": flip.key,
            "unit": flip.unit,
            "from": flip.start,
            "to": flip.end,
            "size": flip.size,
        },
        "choices": claim.keys,
    }


def read_robustness(stored: Mapping[str, Any]) -> Robustness:
    """From what `robustness_data` made; `KeyError` or `TypeError` if it is nothing of the kind."""
    flip = stored["flip"]
    return Robustness(
        draws=int(stored["draws"]),
        held=int(stored["held"]),
        diverged=int(stored["diverged"]),
        refused=int(stored["refused"]),
        flip=flip and Flip(flip["key"], flip["unit"], flip["from"], flip["to"], flip["size"]),
    )

"""The robustness of claims as it is kept between two stages: plain data for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.claims.registry import Claim
from reobserve.claims.robustness import Flip, Robustness


def to_data(robustness: Robustness, claim: Claim) -> dict[str, Any]:
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
        "looked": robustness.looked,
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


def from_data(stored: Mapping[str, Any]) -> Robustness:
    """From what `to_data` made; `KeyError` or `TypeError` if it is nothing of the kind."""
    flip = stored["flip"]
    return Robustness(
        draws=int(stored["draws"]),
        held=int(stored["held"]),
        diverged=int(stored["diverged"]),
        refused=int(stored["refused"]),
        looked=bool(stored["looked"]),
        flip=flip and Flip(flip["key"], flip["unit"], flip["from"], flip["to"], flip["size"]),
    )

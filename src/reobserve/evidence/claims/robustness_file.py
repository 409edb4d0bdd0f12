"""The robustness of claims as it is kept between two stages: plain data for JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.claims.registry import Claim
from reobserve.evidence.claims.robustness import Flip, Robustness
from reobserve.plain_data.json_data import read_json
from reobserve.plain_data.typed_tree import parse


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
            "start": flip.start,
            "end": flip.end,
            "size": flip.size,
        },
        "choices": claim.keys,
    }


@dataclass(frozen=True)
class StoredRobustness:
    """What `to_data` makes of one claim."""

    draws: int
    held: int
    diverged: int
    refused: int
    share: float | None
    low: float
    high: float
    looked: bool
    flip: Flip | None
    choices: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("draws", "held", "diverged", "refused"):
            if getattr(self, name) < 0:
                raise InputError(name, f"{getattr(self, name)} must not be negative")
        if self.held + self.diverged > self.draws:
            raise InputError("held", f"and diverged are more than the {self.draws} draws")


@dataclass(frozen=True)
class _Stored:
    """The file of a paper."""

    paper: str
    seed: int
    draws: int
    claims: dict[str, StoredRobustness]


def read_robustness(path: Path, paper: str) -> dict[str, Robustness]:
    """The robustness of a paper's claims by name, from the file that its stage wrote.

    Raises
    ------
    InputError
        If the file is missing or damaged, or of another paper.
    """
    stored = parse(_Stored, read_json(path), str(path))
    if stored.paper != paper:
        raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
    return {
        name: Robustness(one.draws, one.held, one.diverged, one.refused, one.flip, one.looked)
        for name, one in stored.claims.items()
    }

"""The samples of claims as they are kept between two stages, in JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve_papers.claims.cached_samples import as_text, from_text
from reobserve_papers.claims.checks import Reference
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.robustness import Robustness, Trial


def to_data(claim: Claim, robustness: Robustness) -> dict[str, Any]:
    """The samples as JSON keeps them, with what was chosen and the numbers that came out."""
    kept = robustness.to_keep(claim)
    stated = {one: robustness.stated[one] for one in kept.references if one in robustness.stated}
    return {
        "names": list(robustness.names),
        "metrics": list(kept.metrics),
        "stated": as_text(kept.references, stated),
        "values": [list(trial.values) for trial in robustness.trials],
        "samples": list(kept.samples),
        "whole": robustness.whole,
        "basis": robustness.basis,
        "cached": robustness.cached,
    }


@dataclass(frozen=True)
class _StoredRobustness:
    """Entry that `to_data` makes of one claim."""

    names: tuple[str, ...]
    metrics: tuple[str, ...]
    stated: str
    values: tuple[tuple[Any, ...], ...]
    samples: tuple[str | None, ...]
    whole: int | None
    basis: str
    cached: int

    def __post_init__(self) -> None:
        if not 0 <= self.cached <= len(self.samples):
            raise InputError("cached", f"{self.cached} must be a number of samples")
        if len(self.values) != len(self.samples):
            raise InputError("values", f"{len(self.values)} must be {len(self.samples)}")
        for k, values in enumerate(self.values):
            if len(values) != len(self.names):
                problem = f"has {len(values)} values, must have {len(self.names)}"
                raise InputError(f"values.{k}", problem)
        self.robustness()

    def robustness(self) -> Robustness:
        """The samples that were stored, or `InputError` for what is no number."""
        references = tuple(map(Reference.parse, self.metrics))
        try:
            found = [from_text(references, text) for text in (self.stated, *self.samples)]
        except ValueError as error:
            raise InputError("samples", f"must be numbers ({error})") from None
        trials = [Trial(*one) for one in zip(self.values, found[1:], strict=True)]
        return Robustness(found[0] or {}, self.names, trials, self.whole, self.basis, self.cached)


@dataclass(frozen=True)
class _Stored:
    """The file of a paper."""

    paper: str
    seed: int
    samples: int
    claims: dict[str, _StoredRobustness]


def read_robustness(path: Path, paper: str) -> dict[str, Robustness]:
    """The samples of a paper's claims by name, from the file that their stage wrote."""
    stored = parse(_Stored, read_json(path), str(path))
    if stored.paper != paper:
        raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
    return {name: one.robustness() for name, one in stored.claims.items()}

"""Cached samples of claims in ``config/samples``, so that a build need not repeat them all.

Kept are the numbers that checks name, those of all alternatives included; what a sample chooses
follows from its place in the list. They are those of a claim as long as nothing in the parameter
file has moved that its samples depend on. Code may have: so each build repeats some of them, see
`repeated_samples`, and where one comes out otherwise the rest of the claim is not used.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.files import write_text
from reobserve.core.validation import parse
from reobserve_papers.claims.checks import Reference
from reobserve_papers.claims.outcomes import Found
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.provenance import versions

# Of a number; what is chaotic differs by more, and is sampled again on other processors.
_ROUNDING = 1e-6

_LOST = "-"  # in place of a number whose figure diverged
_DIGITS = 10  # of a number that is kept


@dataclass(frozen=True)
class CachedSamples:
    """Cached samples of one claim: the numbers of each, in order.

    ``basis`` is a digest of what they depend on, ``metrics`` are the references of the numbers. A
    sample is text, its numbers with spaces between, and None where the code refused the sample.
    """

    basis: str
    metrics: tuple[str, ...]
    samples: tuple[str | None, ...]

    def __post_init__(self) -> None:
        for number, sample in enumerate(self.samples):
            try:
                self.found(number)
            except ValueError:
                allowed = f"{len(self.metrics)} numbers"
                raise InputError(f"samples.{number}", f"{sample!r} must be {allowed}") from None

    @property
    def references(self) -> tuple[Reference, ...]:
        """The places of the numbers."""
        return tuple(map(Reference.parse, self.metrics))

    def found(self, number: int) -> Found | None:
        """The numbers of a sample, or None where it was refused."""
        return from_text(self.references, self.samples[number])


def from_text(references: Sequence[Reference], sample: str | None) -> Found | None:
    """The numbers of a sample as it is cached, or `ValueError` if it holds anything else."""
    if sample is None:
        return None
    words = zip(references, sample.split(), strict=True)
    return {one: float(word) for one, word in words if word != _LOST}


def as_text(references: Sequence[Reference], found: Found | None) -> str | None:
    """A sample as it is cached."""
    if found is None:
        return None
    return " ".join(f"{found[one]:.{_DIGITS}g}" if one in found else _LOST for one in references)


def alike(found: Found | None, other: Found | None, both: Collection[Reference]) -> bool:
    """True if two samples came out the same, but for rounding elsewhere, where ``both`` looked."""
    if found is None or other is None:
        return found is other is None
    if not both or any((one in found) != (one in other) for one in both):
        return False
    one, two = ([side[name] for name in both if name in side] for side in (found, other))
    return np.allclose(one, two, rtol=_ROUNDING, atol=0.0, equal_nan=True)


@dataclass(frozen=True)
class _Stored:
    paper: str
    packages: dict[str, str]
    keys: tuple[str, ...]
    claims: dict[str, CachedSamples]


@dataclass(frozen=True)
class Cache:
    """Cached samples of a paper's claims, and the keys of its parameters when they were made."""

    keys: tuple[str, ...] = ()
    claims: Mapping[str, CachedSamples] | None = None

    def get(self, name: str) -> CachedSamples | None:
        """The samples of a claim."""
        return (self.claims or {}).get(name)


def read_cached(path: Path, paper: str) -> Cache:
    """The cached samples of a paper's claims."""
    stored = parse(_Stored, read_json(path), str(path))
    if stored.paper != paper:
        raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
    return Cache(stored.keys, stored.claims)


def write_cached(
    project: Path, parameters: Parameters, claims: Mapping[str, CachedSamples]
) -> None:
    """Keep the samples of a paper's claims, a line each, with the versions that made them."""
    paper = parameters.paper
    stored: dict[str, Any] = {
        "paper": paper, "packages": versions(), "keys": list(parameters.by_key),
    }  # fmt: skip
    head = json.dumps(stored, indent=1)[:-2]
    lines = (f"  {json.dumps(name)}: {json.dumps(vars(one))}" for name, one in claims.items())
    text = f'{head},\n "claims": {{\n' + ",\n".join(lines) + "\n }\n}\n"
    write_text(project / samples_path(paper), text)

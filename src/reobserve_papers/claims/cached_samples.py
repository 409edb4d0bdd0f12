"""Cached samples of claims in ``config/samples``, so that a build need not repeat them all.

Kept are numbers that came out; what a sample chooses follows from its place in the list. They are
those of a claim as long as nothing in the parameter file or the registry has moved that its samples
depend on. Code may have: so each build makes the first of them again, and where one comes out
otherwise the rest is not used.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.files import write_text
from reobserve.core.validation import parse
from reobserve_papers.claims.reversals import Reversal
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.steps.provenance import versions

# Of a number; what is chaotic differs by more, and is sampled again on other processors.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class CachedSamples:
    """Cached samples of one claim: the deciding numbers of each, in order, and the smallest change.

    ``basis`` is a digest of what they depend on. A sample is text, its numbers with spaces between:
    none where something diverged, and None in place of the text where the code refused the sample.
    """

    basis: str
    samples: tuple[str | None, ...]
    looked: bool
    reversal: Reversal | None

    def __post_init__(self) -> None:
        for number, sample in enumerate(self.samples):
            try:
                self.numbers(number)
            except ValueError:
                raise InputError(f"samples.{number}", f"{sample!r} must be numbers") from None

    def numbers(self, number: int) -> tuple[float, ...] | None:
        """The numbers of a sample, or None where it was refused."""
        return numbers_in(self.samples[number])


def numbers_in(sample: str | None) -> tuple[float, ...] | None:
    """The numbers of a sample as it is cached, or `ValueError` if it holds anything else."""
    return None if sample is None else tuple(map(float, sample.split()))


def as_text(numbers: tuple[float, ...] | None) -> str | None:
    """A sample as it is cached."""
    return None if numbers is None else " ".join(map(repr, numbers))


def alike(numbers: tuple[float, ...] | None, others: tuple[float, ...] | None) -> bool:
    """True if two samples came out the same, but for rounding on another machine."""
    if numbers is None or others is None or len(numbers) != len(others):
        return numbers is others is None
    return np.allclose(numbers, others, rtol=_ROUNDING, atol=0.0, equal_nan=True)


@dataclass(frozen=True)
class _Stored:
    paper: str
    packages: dict[str, str]
    claims: dict[str, CachedSamples]


def read_cached(path: Path, paper: str) -> dict[str, CachedSamples]:
    """The cached samples of a paper's claims, by name.

    Raises
    ------
    InputError
        If the file is missing or damaged, or of another paper.
    """
    stored = parse(_Stored, read_json(path), str(path))
    if stored.paper != paper:
        raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
    return stored.claims


def write_cached(project: Path, paper: str, claims: Mapping[str, CachedSamples]) -> None:
    """Keep the samples of a paper's claims, a line each, with the versions that made them."""
    stored: dict[str, Any] = {"paper": paper, "packages": versions()}
    head = json.dumps(stored, indent=1)[:-2]
    lines = (
        f"  {json.dumps(name)}: "
        f"{json.dumps(vars(one) | {'reversal': one.reversal and vars(one.reversal)})}"
        for name, one in claims.items()
    )
    text = f'{head},\n "claims": {{\n' + ",\n".join(lines) + "\n }\n}\n"
    write_text(project / samples_path(paper), text)

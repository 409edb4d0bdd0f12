"""Samples of claims that need not be made: cached from earlier builds, or made ahead in chunks.

The number of a sample, the seed and a choice say what is chosen. So a sample comes out the same in
whatever process it is made: a chunk is nothing but samples that others need not make. They take
those that are there and make those that are not; neither how samples are cut into chunks, nor the
order in which these are made, nor one that is missing changes what is found.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.files import write_text
from reobserve.core.seals import sealed
from reobserve.core.validation import parse
from reobserve_papers.claims.cached_samples import CachedSamples, alike, as_text, from_text
from reobserve_papers.claims.checks import Reference
from reobserve_papers.claims.outcomes import Found

# Samples that were made ahead: by claim, by the digest of what they depend on, and by number. None
# is where the code refuses a sample.
MadeSamples = Mapping[str, Mapping[str, Mapping[int, Found | None]]]


@dataclass
class KnownSamples:
    """Samples of one claim: those that are ``cached``, and those that this build has ``made``.

    ``wanted`` are the numbers that are taken of one.
    """

    wanted: tuple[Reference, ...] = ()
    cached: CachedSamples | None = None
    made: dict[int, Found | None] = field(default_factory=dict)

    @staticmethod
    def of(
        wanted: tuple[Reference, ...],
        cached: CachedSamples | None,
        made: Mapping[int, Found | None],
    ) -> KnownSamples:
        """The samples of a claim, of which some are cached and others were made ahead."""
        known = KnownSamples(wanted, cached)
        for number, found in sorted(made.items()):
            known.take(number, found)
        return known

    @property
    def length(self) -> int:
        """The number up to which samples are cached."""
        return len(self.cached.samples) if self.cached else 0

    def is_cached(self, number: int) -> bool:
        """True if a sample is cached, and was not made again."""
        return number < self.length and number not in self.made

    def __contains__(self, number: int) -> bool:
        return number in self.made or self.is_cached(number)

    def __getitem__(self, number: int) -> Found | None:
        if self.cached and self.is_cached(number):
            return self.cached.found(number)
        return self.made[number]

    def take(self, number: int, found: Found | None) -> None:
        """Add a new result of a sample, and drop the cached samples if it differs from theirs."""
        self.made[number] = found
        if self.cached and number < self.length:
            both = set(self.wanted).intersection(self.cached.references)
            if not alike(found, self.cached.found(number), both):
                self.cached = None


@dataclass(frozen=True)
class _StoredSamples:
    """Samples of one claim in a chunk, by number, as in `CachedSamples`."""

    basis: str
    metrics: tuple[str, ...]
    numbers: tuple[int, ...]
    samples: tuple[str | None, ...]

    def __post_init__(self) -> None:
        if list(self.numbers) != sorted({n for n in self.numbers if n >= 0}):
            raise InputError("numbers", "must be numbers of samples, rising")
        if len(self.samples) != len(self.numbers):
            raise InputError("samples", f"{len(self.samples)} must be {len(self.numbers)}")
        self.made()

    def made(self) -> dict[int, Found | None]:
        """The samples by number, or `InputError` for what is no sample."""
        references = tuple(map(Reference.parse, self.metrics))
        try:
            found = [from_text(references, sample) for sample in self.samples]
        except ValueError as error:
            raise InputError("samples", f"must be numbers ({error})") from None
        return dict(zip(self.numbers, found, strict=True))


@dataclass(frozen=True)
class _Stored:
    paper: str
    claims: dict[str, _StoredSamples]


def write_chunk(
    path: Path,
    paper: str,
    bases: Mapping[str, str],
    wanted: Mapping[str, tuple[Reference, ...]],
    made: Mapping[str, Mapping[int, Found | None]],
) -> None:
    """Write the samples of a chunk by claim, each with the digest of what it depends on."""
    claims = {
        name: {
            "basis": bases[name], "metrics": list(map(str, wanted[name])),
            "numbers": sorted(samples),
            "samples": [as_text(wanted[name], samples[number]) for number in sorted(samples)],
        }
        for name, samples in made.items()
    }  # fmt: skip
    write_text(path, json.dumps(sealed({"paper": paper, "claims": claims})) + "\n")


def read_chunks(paths: Iterable[Path], paper: str) -> MadeSamples:
    """The samples in chunks of a paper, in whatever order."""
    found: dict[str, dict[str, dict[int, Found | None]]] = {}
    for path in paths:
        stored = parse(_Stored, read_json(path), str(path))
        if stored.paper != paper:
            raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
        for name, one in stored.claims.items():
            found.setdefault(name, {}).setdefault(one.basis, {}).update(one.made())
    return found

"""Tables of Monte Carlo samples of claims, all in one file format.

A sample is determined by its number, the seed and the choices, so it is the same in any process.
The samples cached in ``config/samples`` and those that decide the claims of a build are such
tables: each has the numbers that checks and alternatives name. They are valid as long as nothing
in the parameter file has changed that they depend on. Code may have changed, so each build repeats
some cached samples; if one of them differs, the rest of its claim is not used.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.files import write_text
from reobserve.core.seals import sealed
from reobserve.core.validation import parse
from reobserve_papers.claims.checks import THEORY, Reference
from reobserve_papers.claims.choices import chosen, with_values
from reobserve_papers.claims.outcomes import Sample, basis_of
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import Step, behind
from reobserve_papers.steps.evaluation import Evaluator
from reobserve_papers.steps.provenance import versions

# Of a number; what is chaotic differs by more, and is sampled again on other processors.
_ROUNDING = 1e-6

_LOST = "-"  # in place of a number whose figure diverged
_DIGITS = 10  # of a number that is kept
_TRIED = 2  # first samples of a claim: one may be refused, or the parameter file as it is


@dataclass(frozen=True)
class Samples:
    """Samples of one claim: the numbers of each, in order.

    ``basis`` is a digest of what they depend on, ``metrics`` are the references of the numbers. A
    sample is text, its numbers with spaces between, and None where the code refused the sample.
    ``cached`` is how many of them an earlier build computed.
    """

    basis: str
    metrics: tuple[str, ...]
    samples: tuple[str | None, ...]
    cached: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.cached <= len(self.samples):
            allowed = f"a number of samples, up to {len(self.samples)}"
            raise InputError("cached", f"{self.cached} must be {allowed}")
        references = self.references
        for place, sample in enumerate(self.samples):
            try:
                from_text(references, sample)
            except ValueError:
                allowed = f"{len(self.metrics)} numbers"
                raise InputError(f"samples.{place}", f"{sample!r} must be {allowed}") from None

    @property
    def references(self) -> tuple[Reference, ...]:
        """The places of the numbers."""
        return tuple(map(Reference.parse, self.metrics))

    def at(self, number: int) -> Sample | None:
        """The numbers of a sample, or None where it was refused."""
        return from_text(self.references, self.samples[number])


def from_text(references: Sequence[Reference], text: str | None) -> Sample | None:
    """The numbers of a sample as it is stored, or `ValueError` if it holds anything else."""
    if text is None:
        return None
    words = zip(references, text.split(), strict=True)
    return {ref: float(word) for ref, word in words if word != _LOST}


def as_text(references: Sequence[Reference], sample: Sample | None) -> str | None:
    """A sample as it is stored."""
    if sample is None:
        return None
    return " ".join(f"{sample[ref]:.{_DIGITS}g}" if ref in sample else _LOST for ref in references)


def alike(sample: Sample | None, other: Sample | None, both: Collection[Reference]) -> bool:
    """True if two samples came out the same, but for rounding elsewhere, where ``both`` looked."""
    if sample is None or other is None:
        return sample is other is None
    if not both or any((ref in sample) != (ref in other) for ref in both):
        return False
    values, others = ([x[ref] for ref in both if ref in x] for x in (sample, other))
    return np.allclose(values, others, rtol=_ROUNDING, atol=0.0, equal_nan=True)


@dataclass(frozen=True)
class SampleTable:
    """Samples of a paper's claims, and the keys of its parameters when they were made."""

    keys: tuple[str, ...] = ()
    claims: Mapping[str, Samples] = field(default_factory=dict)

    def of(self, claim: Claim) -> Samples | None:
        """The samples of a claim, or `InputError` if they are more than all its settings."""
        samples = self.claims.get(claim.name)
        if samples and claim.cells is not None and len(samples.samples) > len(claim.cells):
            allowed = f"at most {len(claim.cells)}, which are all settings"
            place = f"samples.{claim.paper}.{claim.name}"
            raise InputError(place, f"there are {len(samples.samples)}, must be {allowed}")
        return samples

    def current(
        self, evaluator: Evaluator, claim: Claim, needed: Iterable[Reference] = ()
    ) -> Samples | None:
        """The samples of a claim, if they are of its present parameters and have these numbers."""
        past = self.of(claim)
        if past is None or not set(needed) <= set(past.references):
            return None
        return past if past.basis == basis_of(evaluator, claim, self.keys) else None


@dataclass(frozen=True)
class _Stored:
    paper: str
    packages: dict[str, str]
    keys: tuple[str, ...]
    claims: dict[str, Samples]


def read_samples(path: Path, paper: str) -> SampleTable:
    """The samples of a paper's claims in a file."""
    stored = parse(_Stored, read_json(path), str(path))
    if stored.paper != paper:
        raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
    return SampleTable(stored.keys, stored.claims)


def write_samples(
    path: Path, parameters: Parameters, claims: Mapping[str, Samples], *, seal: bool = True
) -> None:
    """Write samples of a paper's claims, a line each, with the versions that made them."""
    rows = {
        name: {key: value for key, value in vars(samples).items() if value != 0}
        for name, samples in claims.items()
    }
    tree = {
        "paper": parameters.paper, "packages": versions(), "keys": list(parameters.by_key),
        "claims": rows,
    }  # fmt: skip
    head = {key: part for key, part in (sealed(tree) if seal else tree).items() if key != "claims"}
    lines = (f"  {json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items())
    text = json.dumps(head, indent=1)[:-2] + ',\n "claims": {\n' + ",\n".join(lines) + "\n }\n}\n"
    write_text(path, text)


def read_cached(project: Path, paper: str) -> SampleTable:
    """The samples in ``config/samples``, none if a paper has no file there."""
    path = project / samples_path(paper)
    return read_samples(path, paper) if path.exists() else SampleTable()


def keep(project: Path, parameters: Parameters, samples: Mapping[str, Samples]) -> None:
    """Cache samples of a paper's claims in ``config/samples``, with those there of other claims."""
    cached, evaluator = read_cached(project, parameters.paper), Evaluator(parameters)
    kept = {}
    for claim in read_registry(project, parameters).claims:
        if claim.name in samples:
            kept[claim.name] = replace(samples[claim.name], cached=0)
        elif cached.current(evaluator, claim):
            # They are kept with the keys that there are now.
            past = cached.claims[claim.name]
            kept[claim.name] = replace(past, basis=basis_of(evaluator, claim))
        elif claim.name in cached.claims:
            kept[claim.name] = cached.claims[claim.name]
    write_samples(project / samples_path(parameters.paper), parameters, kept, seal=False)


@dataclass
class KnownSamples:
    """Samples of one claim: those that are ``cached``, and those that this build has ``made``.

    ``wanted`` are the numbers that are taken of one.
    """

    wanted: tuple[Reference, ...] = ()
    cached: Samples | None = None
    made: dict[int, Sample | None] = field(default_factory=dict)

    @property
    def length(self) -> int:
        """The number up to which samples are cached."""
        return len(self.cached.samples) if self.cached else 0

    def is_cached(self, number: int) -> bool:
        """True if a sample is cached, and was not made again."""
        return number < self.length and number not in self.made

    def __contains__(self, number: int) -> bool:
        return number in self.made or self.is_cached(number)

    def __getitem__(self, number: int) -> Sample | None:
        if self.cached and self.is_cached(number):
            return self.cached.at(number)
        return self.made[number]

    def take(self, number: int, sample: Sample | None) -> None:
        """Add a new result of a sample, and drop the cached samples if it differs from theirs."""
        self.made[number] = sample
        if self.cached and number < self.length:
            both = set(self.wanted).intersection(self.cached.references)
            if not alike(sample, self.cached.at(number), both):
                self.cached = None


def to_repeat(
    evaluator: Evaluator, claims: Iterable[Claim], cached: Mapping[str, Samples]
) -> tuple[dict[str, int], dict[str, int]]:
    """The samples to repeat, and those to repeat if one of them differs, each by its claim's name.

    Each step that the first two samples of a claim run, and each number that they take, is repeated
    in one sample. Studies take seconds, so numbers of a figure whose study runs again count as one:
    golden numbers, and the nightly comparison of all samples, notice a change of one number alone.
    """
    best = {}
    for claim in claims:
        if (past := cached.get(claim.name)) and past.samples:
            tried = range(min(_TRIED, len(past.samples)))
            coverage = {number: _coverage(evaluator, claim, past, number) for number in tried}
            best[claim.name] = max(coverage.items(), key=lambda item: len(item[1]))
    covered: set[Step | Reference] = set()
    needed: dict[str, int] = {}
    others: dict[str, int] = {}
    for name, (number, parts) in sorted(best.items(), key=lambda item: -len(item[1][1])):
        (others if parts and parts <= covered else needed)[name] = number
        covered |= parts
    return needed, others


def _coverage(
    evaluator: Evaluator, claim: Claim, cached: Samples, number: int
) -> set[Step | Reference]:
    """The steps that a sample runs again and the numbers that it takes, except those of studies."""
    parameters = evaluator.parameters
    values = chosen(parameters, claim.choices, number)
    sample = evaluator.sibling(with_values(parameters, claim.choices, values))
    taken = set(claim.wanted).intersection(cached.at(number) or ())
    parts: set[Step | Reference] = set()
    for figure in {ref.figure for ref in taken}:
        last = (THEORY,) if figure == THEORY else ("metrics", figure)
        steps = behind(sample.parameters, *last)
        again = {step for step in steps if sample.key(*step) != evaluator.key(*step)}
        parts |= again
        if not any(step[0] == "study" for step in again):
            parts |= {ref for ref in taken if ref.figure == figure}
    return parts

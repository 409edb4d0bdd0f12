"""Samples of claims: their numbers with other settings of what a paper leaves open."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from reobserve.core.errors import InputError
from reobserve_papers.claims.cached_samples import (
    Cache,
    CachedSamples,
    as_text,
    from_text,
)
from reobserve_papers.claims.choices import chosen, with_values
from reobserve_papers.claims.known_samples import KnownSamples, MadeSamples
from reobserve_papers.claims.outcomes import Found, Outcome, Outcomes, nested, outcome
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.repeated_samples import to_repeat
from reobserve_papers.claims.verdicts import Counted, possible
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator

# No claim is decided by fewer samples, if it may have as many: which choice decides can only be
# seen from some. It does not weaken the decision, which may be taken at any number of samples.
_LEAST = 20

# So many samples with the same numbers show that what a claim depends on does not reach them.
_ALIKE = 8


@dataclass(frozen=True)
class Trial:
    """One sample: the values that were chosen, and what came out, None where it was refused."""

    values: tuple[Any, ...]
    found: Found | None


@dataclass
class Robustness:
    """The samples of one claim.

    ``stated`` is what came out with the parameter file as it is, ``names`` are those of the
    choices, ``whole`` is the number of all their combinations if these are counted and not sampled.
    ``basis`` is a digest of what the samples depend on, ``cached`` says how many were made earlier.
    """

    stated: Found = field(default_factory=dict)
    names: tuple[str, ...] = ()
    trials: list[Trial] = field(default_factory=list)
    whole: int | None = None
    basis: str = ""
    cached: int = 0

    @property
    def samples(self) -> int:
        """The number of samples."""
        return len(self.trials)

    @property
    def refused(self) -> int:
        """The number of samples that the code refused, as it refuses gains that are unstable."""
        return sum(trial.found is None for trial in self.trials)

    def diverged(self, claim: Claim) -> int:
        """The number of samples in which something diverged that decides a claim."""
        return self.outcomes(claim).count("diverged")

    def outcomes(self, claim: Claim) -> list[Outcome]:
        """The outcome of a claim in each sample, as it is or as an alternative reads it."""
        return [
            outcome(claim, None if trial.found is None else nested(trial.found))
            for trial in self.trials
        ]

    def counted(self, outcomes: Sequence[Outcome]) -> Counted:
        """The number of samples in which a claim holds."""
        return counted(outcomes, whole=len(outcomes) == self.whole)

    def alike(self, claim: Claim) -> bool:
        """True if many samples gave the same numbers, all of them: no choice reaches these."""
        named = list(dict.fromkeys(one for check in claim.checks for one in check.references))
        seen = {
            None if trial.found is None else tuple(repr(trial.found.get(one)) for one in named)
            for trial in self.trials
        }
        return self.samples >= _ALIKE and len(seen) == 1 and None not in seen

    def to_keep(self, claim: Claim) -> CachedSamples:
        """The part that another build needs of it: numbers that all of its samples have."""
        looked = [
            one
            for one in claim.wanted
            if all(
                trial.found is None or one in trial.found or _has_lost(trial.found, one)
                for trial in self.trials
            )
        ]
        samples = tuple(as_text(looked, trial.found) for trial in self.trials)
        return CachedSamples(self.basis, tuple(map(str, looked)), samples)


def counted(outcomes: Sequence[Outcome], whole: bool = False) -> Counted:
    """Outcomes, counted."""
    return Counted(outcomes.count("holds"), len(outcomes), whole, outcomes.count("refused"))


def _has_lost(found: Found, one: Any) -> bool:
    """True if nothing of the figure is in a sample: it diverged."""
    return all(other.figure != one.figure for other in found)


@dataclass(frozen=True)
class Inquiry:
    """Claims of which samples are made, and by name what is found and what was known of each."""

    parameters: Parameters
    outcomes: Outcomes
    claims: Sequence[Claim]
    found: dict[str, Robustness]
    known: dict[str, KnownSamples]
    share: float
    _held: dict[str, list[Outcome]] = field(default_factory=lambda: defaultdict(list), repr=False)

    @staticmethod
    def begin(
        evaluator: Evaluator,
        claims: Sequence[Claim],
        share: float,
        cached: Cache | None = None,
        made: MadeSamples | None = None,
    ) -> Inquiry:
        """Begin with no samples, leaving out claims that are broken or depend on nothing.

        Of cached samples, those that the code does not give any more are dropped.
        """
        cached = cached or Cache()
        outcomes = Outcomes(
            evaluator, [claim for claim in claims if claim.checks and claim.choices]
        )
        asked, found, known = [], {}, {}
        for claim in claims:
            if not (claim.checks and claim.choices) or (stated := outcomes.stated(claim)) is None:
                continue
            for one in claim.wanted:
                if one not in stated:
                    place = f"claims.{claim.paper}.{claim.name}"
                    raise InputError(place, f"an alternative names {one}, which there is not")
            basis = outcomes.basis(claim)
            past = cached.get(claim.name)
            if past and not _fits(claim, past, outcomes.basis(claim, cached.keys)):
                past = None
            asked.append(claim)
            cells = claim.cells
            found[claim.name] = Robustness(
                stated, claim.knob_names, whole=None if cells is None else len(cells), basis=basis
            )
            ahead = (made or {}).get(claim.name, {}).get(basis, {})
            known[claim.name] = KnownSamples.of(claim.wanted, past, ahead)
        inquiry = Inquiry(evaluator.parameters, outcomes, asked, found, known, share)
        inquiry._verify(evaluator)
        return inquiry

    def _verify(self, evaluator: Evaluator) -> None:
        """Repeat a cached sample of some claims, and of all others if one of these differs."""
        cached = {name: one.cached for name, one in self.known.items() if one.cached}
        for numbers in to_repeat(evaluator, self.claims, cached):
            for number in sorted({*numbers.values()}):
                named = [one for one in self.claims if numbers.get(one.name) == number]
                self.ask(number, [one for one in named if number not in self.known[one.name].made])
            if all(self.known[name].cached for name in numbers):
                return

    def limit(self, claim: Claim, samples: Callable[[Claim], int]) -> int:
        """The number of samples of a claim at which sampling ends, decided or not."""
        whole = self.found[claim.name].whole
        return whole if whole is not None else max(samples(claim), self.known[claim.name].length)

    def decided(self, claim: Claim) -> bool:
        """True if no more samples of a claim are needed."""
        one, outcomes = self.found[claim.name], self._held[claim.name]
        if one.whole is not None:
            return one.samples == one.whole
        found = counted(outcomes)
        return one.samples >= _LEAST and len(possible(claim.quantifier, found, self.share)) == 1

    def ask(self, number: int, claims: Iterable[Claim]) -> None:
        """Make a sample of some claims, whose outcome is known from then on."""
        together = defaultdict(list)
        for claim in claims:
            whole = self.found[claim.name].whole
            if whole is None or number < whole:
                together[tuple(claim.keys)].append(claim)
        here = self.outcomes.apart()  # claims that depend on the same choices share what they need
        for members in together.values():
            choices = members[0].choices
            drawn = with_values(self.parameters, choices, chosen(self.parameters, choices, number))
            try:
                there = here.at(drawn, members)
            except InputError:
                there = {}
            for claim in members:
                self.known[claim.name].take(number, _rounded(claim, there.get(claim.name)))

    def add(self, number: int, claim: Claim) -> None:
        """Take the next sample of a claim, which must be known, for what is found."""
        known, values = self.known[claim.name], chosen(self.parameters, claim.choices, number)
        one, found = self.found[claim.name], known[number]
        one.trials.append(Trial(values, found))
        one.cached += known.is_cached(number)
        self._held[claim.name].append(outcome(claim, None if found is None else nested(found)))


def _fits(claim: Claim, past: CachedSamples, basis: str) -> bool:
    """True if cached samples are of the claim, and have the numbers that it and its null name."""
    return past.basis == basis and set(claim.references_of_all).issubset(past.references)


def _rounded(claim: Claim, found: Found | None) -> Found | None:
    """The numbers with as many digits as are kept, so that it does not matter who made them."""
    return from_text(claim.wanted, as_text(claim.wanted, found))


def assess(
    evaluator: Evaluator,
    claims: Sequence[Claim],
    samples: Callable[[Claim], int],
    share: float,
    cached: Cache | None = None,
    made: MadeSamples | None = None,
) -> dict[str, Robustness]:
    """The samples of every claim that depends on something, by name.

    Parameters
    ----------
    evaluator
        Samples start from its parameter file, and from what it has made of that.
    claims
        Of the same paper; left out are those that are broken or depend on nothing.
    samples
        The maximum for a claim, if fewer do not decide and no more are cached.
    share
        The share of settings that decides (see `verdicts.possible`).
    cached
        Samples that need not be made again.
    made
        Samples that were made ahead, see `known_samples.read_chunks`.
    """
    inquiry = Inquiry.begin(evaluator, claims, share, cached, made)
    longest = max((inquiry.limit(claim, samples) for claim in inquiry.claims), default=0)
    for number in range(longest):
        going = [
            claim
            for claim in inquiry.claims
            if not inquiry.decided(claim) and number < inquiry.limit(claim, samples)
        ]
        if not going:
            break
        inquiry.ask(number, [one for one in going if number not in inquiry.known[one.name]])
        for claim in going:
            inquiry.add(number, claim)
    return inquiry.found

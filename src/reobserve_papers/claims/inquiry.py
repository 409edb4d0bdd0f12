"""Samples of claims: their numbers with other settings of what a paper leaves open."""

from __future__ import annotations

import itertools
import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError
from reobserve_papers.claims.choices import chosen, with_values
from reobserve_papers.claims.outcomes import Outcome, Outcomes, Sample, basis_of, nested, outcome
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.sample_table import (
    KnownSamples,
    Samples,
    SampleTable,
    as_text,
    from_text,
    read_samples,
    to_repeat,
)
from reobserve_papers.claims.verdict_rules import DEPENDS, Counted, possible
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator

# No claim is decided by fewer samples, if it may have as many: which choice decides can only be
# seen from some. It does not weaken the decision, which may be taken at any number of samples.
_LEAST = 20

# So many samples with the same numbers show that what a claim depends on does not reach them.
_ALIKE = 8


@dataclass(frozen=True)
class Trial:
    """One sample: how its values are chosen, and what came out, None where it was refused."""

    choose: Callable[[], tuple[Any, ...]] = field(compare=False, repr=False)
    numbers: Sample | None

    @cached_property
    def values(self) -> tuple[Any, ...]:
        """The values that were chosen, which takes longer than reading what came out."""
        return self.choose()


@dataclass
class Robustness:
    """The samples of one claim.

    ``names`` are those of the choices, ``whole`` is the number of all their combinations if these
    are counted and not sampled. ``basis`` is a digest of what the samples depend on, ``cached``
    says how many were made earlier.
    """

    names: tuple[str, ...] = ()
    trials: list[Trial] = field(default_factory=list)
    whole: int | None = None
    basis: str = ""
    cached: int = 0

    @staticmethod
    def begin(claim: Claim, basis: str = "") -> Robustness:
        """No samples of a claim yet."""
        whole = None if claim.cells is None else len(claim.cells)
        return Robustness(claim.knob_names, whole=whole, basis=basis)

    @property
    def samples(self) -> int:
        """The number of samples."""
        return len(self.trials)

    def outcomes(self, claim: Claim) -> list[Outcome]:
        """The outcome of a claim in each sample, as it is or as an alternative reads it."""
        return [
            outcome(claim, None if trial.numbers is None else nested(trial.numbers))
            for trial in self.trials
        ]

    def counted(self, outcomes: Sequence[Outcome]) -> Counted:
        """The number of samples in which a claim holds."""
        return counted(outcomes, whole=len(outcomes) == self.whole)

    def alike(self, claim: Claim) -> bool:
        """True if many samples gave the same numbers, all of them: no choice reaches these."""
        named = list(dict.fromkeys(ref for check in claim.checks for ref in check.references))
        seen = {
            None if trial.numbers is None else tuple(repr(trial.numbers.get(ref)) for ref in named)
            for trial in self.trials
        }
        return self.samples >= _ALIKE and len(seen) == 1 and None not in seen

    def to_keep(self, claim: Claim) -> Samples:
        """The samples as a table holds them, with the numbers that all of them have."""
        looked = [
            ref
            for ref in claim.wanted
            if all(
                trial.numbers is None or ref in trial.numbers or _has_lost(trial.numbers, ref)
                for trial in self.trials
            )
        ]
        samples = tuple(as_text(looked, trial.numbers) for trial in self.trials)
        return Samples(self.basis, tuple(map(str, looked)), samples, cached=self.cached)


def read_robustness(
    path: Path, parameters: Parameters, claims: Iterable[Claim]
) -> dict[str, Robustness]:
    """The samples of claims by name, from a table of all of them."""
    table = read_samples(path, parameters.paper)
    samples = {}
    for claim in claims:
        if (stored := table.of(claim)) is not None:
            robustness = samples[claim.name] = Robustness.begin(claim, stored.basis)
            for number in range(len(stored.samples)):
                choose = partial(chosen, parameters, claim.choices, number)
                robustness.trials.append(Trial(choose, stored.at(number)))
    return samples


def counted(outcomes: Sequence[Outcome], whole: bool = False) -> Counted:
    """Outcomes, counted, without those that are no case."""
    cases = len(outcomes) - outcomes.count("no case")
    return Counted(outcomes.count("holds"), cases, whole, outcomes.count("refused"))


def _has_lost(sample: Sample, ref: Any) -> bool:
    """True if nothing of the figure is in a sample: it diverged."""
    return all(other.figure != ref.figure for other in sample)


@dataclass(frozen=True)
class Inquiry:
    """Claims of which samples are made, and by name the samples and what was known of each."""

    parameters: Parameters
    outcomes: Outcomes
    claims: Sequence[Claim]
    sampled: dict[str, Robustness]
    known: dict[str, KnownSamples]
    share: float
    spent: dict[str, float]  # CPU s on samples of each claim
    _held: dict[str, list[Outcome]] = field(default_factory=lambda: defaultdict(list), repr=False)

    @staticmethod
    def begin(
        evaluator: Evaluator,
        claims: Sequence[Claim],
        share: float,
        cached: SampleTable | None = None,
        *,
        complete: bool = False,
    ) -> Inquiry:
        """Begin with no samples, leaving out claims that are broken or depend on nothing.

        Of cached samples, those that the code does not give any more are dropped, and those without
        all numbers that a claim and its null name; if they must be ``complete``, also those without
        the numbers of alternatives.
        """
        outcomes = Outcomes(
            evaluator, [claim for claim in claims if claim.checks and claim.choices]
        )
        asked, sampled, known = [], {}, {}
        for claim in claims:
            if not (claim.checks and claim.choices) or (nominal := outcomes.nominal(claim)) is None:
                continue
            for ref in claim.wanted:
                if ref not in nominal:
                    place = f"claims.{claim.paper}.{claim.name}"
                    raise InputError(place, f"an alternative names {ref}, which there is not")
            asked.append(claim)
            sampled[claim.name] = Robustness.begin(claim, basis_of(evaluator, claim))
            needed = claim.wanted if complete else claim.references_of_all
            past = cached.current(evaluator, claim, needed) if cached else None
            known[claim.name] = KnownSamples(claim.wanted, past)
        spent = dict.fromkeys(sampled, 0.0)
        inquiry = Inquiry(evaluator.parameters, outcomes, asked, sampled, known, share, spent)
        inquiry._verify(evaluator)
        return inquiry

    def _verify(self, evaluator: Evaluator) -> None:
        """Repeat a cached sample of some claims, and of all others if one of these differs."""
        cached = {name: known.cached for name, known in self.known.items() if known.cached}
        for numbers in to_repeat(evaluator, self.claims, cached):
            for number in sorted({*numbers.values()}):
                named = [claim for claim in self.claims if numbers.get(claim.name) == number]
                self.ask(number, [c for c in named if number not in self.known[c.name].made])
            if all(self.known[name].cached for name in numbers):
                return

    def limit(self, claim: Claim, samples: Callable[[Claim], int]) -> int:
        """The number of samples of a claim at which sampling ends, decided or not.

        Samples that are no case are replaced by as many others at most.
        """
        if (whole := self.sampled[claim.name].whole) is not None:
            return whole
        most, void = samples(claim), self._held[claim.name].count("no case")
        return max(most + min(most, void), self.known[claim.name].length)

    def possible(self, claim: Claim) -> tuple[str, ...]:
        """The verdicts on a claim that are possible by the samples so far."""
        counted = self.sampled[claim.name].counted(self._held[claim.name])
        return possible(claim.quantifier, counted, self.share)

    def decided(self, claim: Claim) -> bool:
        """True if no more samples of a claim are needed. Those that are cached are all used."""
        robustness = self.sampled[claim.name]
        if robustness.whole is not None:
            return robustness.samples == robustness.whole
        cases = counted(self._held[claim.name]).samples
        enough = cases >= _LEAST and robustness.samples >= self.known[claim.name].length
        return enough and len(self.possible(claim)) == 1

    def lacks(self, claim: Claim, enough: int) -> bool:
        """True if a main claim, or one that depends, has fewer than ``enough`` samples, not all."""
        cases = counted(self._held[claim.name]).samples
        fewer = self.sampled[claim.name].whole is None and cases < enough
        return fewer and (claim.is_main or self.possible(claim) == (DEPENDS,))

    def fill(
        self, samples: Callable[[Claim], int], *, seconds: float = math.inf, enough: int = 0
    ) -> None:
        """Make samples until claims are decided or have their maximum.

        Where claims need ``enough`` samples (see `lacks`) they get these, too, up to their maximum.
        None are made of a claim after so many CPU ``seconds``.
        """
        for number in itertools.count():
            going = [
                claim
                for claim in self.claims
                if (self.lacks(claim, enough) or not self.decided(claim))
                and number < self.limit(claim, samples)
                and (number in self.known[claim.name] or self.spent[claim.name] < seconds)
            ]
            if not going:
                break
            self.ask(number, [claim for claim in going if number not in self.known[claim.name]])
            for claim in going:
                if number == self.sampled[claim.name].samples:
                    self.add(number, claim)

    def to_keep(self) -> dict[str, Samples]:
        """The samples of each claim that was not left out, for a table."""
        return {claim.name: self.sampled[claim.name].to_keep(claim) for claim in self.claims}

    def ask(self, number: int, claims: Iterable[Claim]) -> None:
        """Make a sample of some claims, whose outcome is known from then on."""
        together = defaultdict(list)
        for claim in claims:
            together[tuple(claim.keys)].append(claim)
        here = self.outcomes.isolated()  # claims of the same choices share what they need
        for members in together.values():
            began = time.process_time()
            choices = members[0].choices
            drawn = with_values(self.parameters, choices, chosen(self.parameters, choices, number))
            try:
                there = here.at(drawn, members)
            except InputError:  # what refuses one of them need not refuse the others
                there = {}
                for claim in members if len(members) > 1 else ():
                    with suppress(InputError):
                        there |= here.at(drawn, [claim])
            for claim in members:
                self.known[claim.name].take(number, _rounded(claim, there.get(claim.name)))
                self.spent[claim.name] += (time.process_time() - began) / len(members)

    def add(self, number: int, claim: Claim) -> None:
        """Take the next sample of a claim, which must be known."""
        so_far, known = self.sampled[claim.name], self.known[claim.name]
        sample = known[number]
        so_far.trials.append(Trial(partial(chosen, self.parameters, claim.choices, number), sample))
        so_far.cached += known.is_cached(number)
        self._held[claim.name].append(outcome(claim, None if sample is None else nested(sample)))


def _rounded(claim: Claim, sample: Sample | None) -> Sample | None:
    """The numbers with as many digits as are kept, so that it does not matter who made them."""
    return from_text(claim.wanted, as_text(claim.wanted, sample))

"""Robustness of claims: over samples of what the paper leaves open, and single changes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from reobserve.core.errors import InputError
from reobserve_papers.claims import sequential
from reobserve_papers.claims.cached_samples import CachedSamples, as_text
from reobserve_papers.claims.choices import chosen, sample
from reobserve_papers.claims.known_samples import KnownSamples, MadeSamples
from reobserve_papers.claims.outcomes import Outcome, Outcomes, decided
from reobserve_papers.claims.registry import Claim, Quantifier
from reobserve_papers.claims.reversals import Reversal, smallest_reversals
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator

# Of the samples: from here on a claim stands whatever else a reader chooses, and as rarely as this
# leaves it is said to fail. One in ten may choose badly. Set before anything was sampled.
FIRM = 0.9

# No claim is decided by fewer samples, if it may have as many: which choice decides can only be
# seen from some. It does not weaken the decision, which may be taken at any number of samples.
_LEAST = 20

# So many samples with the same numbers show that what a claim depends on does not reach them.
_ALIKE = 8


def finding(
    quantifier: Quantifier, stated: bool, held: int, samples: int
) -> tuple[bool, bool | None]:
    """True if a claim is true, and whether that is firm, or None if the samples do not decide.

    Parameters
    ----------
    quantifier
        One setting with which it holds decides a claim of what `can` be, one with which it fails
        a claim of what `always` is. Where none is found, and for a claim of what `is`, nine of
        ten samples must agree with the settings of the parameter file.
    stated
        Whether it holds with the settings of the parameter file.
    held
        In how many of the samples it holds.
    samples
        How many there are; where there are none the settings of the file decide.
    """
    if quantifier == "can" and (stated or held):
        return True, True
    if quantifier == "always" and not (stated and held == samples):
        return False, True
    if not samples:
        return stated, True
    return stated, sequential.above(FIRM, held if stated else samples - held, samples)


@dataclass(frozen=True)
class Trial:
    """One sample: what was chosen, a value for each name of `Robustness.names`, and the outcome."""

    values: tuple[Any, ...]
    outcome: Outcome


@dataclass
class Robustness:
    """Robustness of one claim: the samples that decide it, and the smallest change to reverse it.

    ``stated`` is the outcome with the parameter file as it is, ``names`` are those of the choices.
    ``reversal`` is None if none was found; ``looked`` is false where nobody looked. Samples in
    which something diverges count as not held, and so do those that the code refuses, as it refuses
    gains that are unstable: their numbers are in ``refused``. ``basis`` is a digest of what all
    this depends on, ``cached`` says how many of the samples were made earlier.
    """

    stated: Outcome = field(default_factory=lambda: Outcome(True))
    names: tuple[str, ...] = ()
    trials: list[Trial] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    reversal: Reversal | None = None
    looked: bool = True
    basis: str = ""
    cached: int = 0
    quantifier: Quantifier = "is"
    _counted: tuple[int, int] = field(default=(0, 0), init=False, repr=False, compare=False)

    def add(
        self,
        claim: Claim,
        values: tuple[Any, ...],
        numbers: tuple[float, ...] | None,
        cached: bool = False,
    ) -> None:
        """Take what came out of the next sample: None where the code refused it."""
        if numbers is None:
            self.refused.append(self.samples)
        self.trials.append(Trial(values, decided(claim, numbers or ())))
        self.cached += cached

    @property
    def to_keep(self) -> CachedSamples:
        """The part that another build needs of it."""
        samples = [
            None if number in self.refused else as_text(trial.outcome.numbers)
            for number, trial in enumerate(self.trials)
        ]
        return CachedSamples(self.basis, tuple(samples), self.looked, self.reversal)

    @property
    def samples(self) -> int:
        """The number of samples."""
        return len(self.trials)

    @property
    def held(self) -> int:
        """The number of samples in which the claim held."""
        # It is asked after every sample: those that were counted are not counted again.
        counted, held = self._counted
        held += sum(trial.outcome.held for trial in self.trials[counted:])
        self._counted = len(self.trials), held
        return held

    @property
    def diverged(self) -> int:
        """The number of samples in which something diverged."""
        return sum(not trial.outcome.numbers for trial in self.trials) - len(self.refused)

    @property
    def share(self) -> float:
        """The share of the samples in which the claim held."""
        return self.held / self.samples if self.samples else float("nan")

    @property
    def agreed(self) -> int:
        """The number of samples in which the claim fared as with the parameter file as it is."""
        return self.held if self.stated.held else self.samples - self.held

    @property
    def firm(self) -> bool | None:
        """True if the samples support what is found (see `finding`), or None if undecided."""
        if not self.samples:
            return None
        return finding(self.quantifier, self.stated.held, self.held, self.samples)[1]

    @property
    def decided(self) -> bool:
        """True if no more samples are needed."""
        return self.samples >= _LEAST and self.firm is not None

    def interval(self) -> tuple[float, float]:
        """The interval of the share of samples that agree (see `sequential.interval`)."""
        low, high = sequential.interval(self.agreed, self.samples)
        return (low, high) if self.stated.held else (1 - high, 1 - low)

    @property
    def alike(self) -> bool:
        """True if many samples gave the same numbers, all of them: no choice reaches these."""
        numbers = {repr(trial.outcome.numbers) for trial in self.trials}
        lost = self.diverged or self.refused
        return self.samples >= _ALIKE and len(numbers) == 1 and not lost


@dataclass(frozen=True)
class Inquiry:
    """Claims of which samples are made, and by name what is found and what was known of each."""

    parameters: Parameters
    outcomes: Outcomes
    claims: Sequence[Claim]
    found: dict[str, Robustness]
    known: dict[str, KnownSamples]

    @staticmethod
    def begin(
        evaluator: Evaluator,
        claims: Sequence[Claim],
        cached: Mapping[str, CachedSamples] | None = None,
        made: MadeSamples | None = None,
        looked: bool = True,
    ) -> Inquiry:
        """Begin with no samples, leaving out claims that are broken or depend on nothing."""
        outcomes = Outcomes(
            evaluator, [claim for claim in claims if claim.checks and claim.choices]
        )
        asked, found, known = [], {}, {}
        for claim in claims:
            if not (claim.checks and claim.choices) or (stated := outcomes.stated(claim)) is None:
                continue
            basis = outcomes.basis(claim)
            asked.append(claim)
            found[claim.name] = Robustness(
                stated, claim.knob_names, looked=looked, basis=basis, quantifier=claim.quantifier
            )
            known[claim.name] = KnownSamples.of(claim.name, basis, cached or {}, made or {})
        return Inquiry(evaluator.parameters, outcomes, asked, found, known)

    def ask(self, number: int, claims: Iterable[Claim]) -> None:
        """Make a sample of some claims, whose outcome is known from then on."""
        together = defaultdict(list)
        for claim in claims:
            together[tuple(claim.keys)].append(claim)
        here = self.outcomes.apart()  # claims that depend on the same choices share what they need
        for members in together.values():
            drawn, _ = sample(self.parameters, members[0].choices, number)
            try:
                there = here.at(drawn, members)
            except InputError:
                there = {}
            for claim in members:
                numbers = there[claim.name].numbers if there else None
                self.known[claim.name].take(number, numbers)

    def add(self, number: int, claim: Claim) -> None:
        """Take the next sample of a claim, which must be known, for what is found."""
        known, values = self.known[claim.name], chosen(self.parameters, claim.choices, number)
        self.found[claim.name].add(claim, values, known[number], known.is_cached(number))


def assess(
    evaluator: Evaluator,
    claims: Sequence[Claim],
    samples: int,
    reversals: bool = True,
    cached: Mapping[str, CachedSamples] | None = None,
    made: MadeSamples | None = None,
) -> dict[str, Robustness]:
    """The robustness of every claim that depends on something, by name.

    Parameters
    ----------
    evaluator
        Samples and moves start from its parameter file, and from what it has made of that.
    claims
        Of the same paper; left out are those that are broken or depend on nothing.
    samples
        The maximum for each claim, if fewer do not decide and no more are cached.
    reversals
        Whether to look for the smallest change that reverses a claim.
    cached
        By claim: samples that need not be made again, and the change that was found with them.
    made
        Samples that were made ahead, see `known_samples.read_chunks`.

    Raises
    ------
    InputError
        If the parameter file as it is cannot be run.
    DivergenceError
        If something diverges with the parameter file as it is.
    """
    inquiry = Inquiry.begin(evaluator, claims, cached, made, looked=reversals)
    _sample_all(inquiry, samples)
    found, known = inquiry.found, inquiry.known
    if reversals:
        changes = {
            name: one.cached.reversal
            for name, one in known.items()
            if one.cached and one.cached.looked
        }
        sought = [claim for claim in inquiry.claims if claim.name not in changes]
        changes |= smallest_reversals(inquiry.parameters, inquiry.outcomes, sought)
        for name, reversal in changes.items():
            found[name].reversal = reversal
    return found


def _sample_all(inquiry: Inquiry, max_samples: int) -> None:
    """Compute one sample after the other, each for all undecided claims."""
    found, known = inquiry.found, inquiry.known
    longest = max((one.length for one in known.values()), default=0)
    for number in range(max(max_samples, longest)):
        going = [
            claim
            for claim in inquiry.claims
            if not found[claim.name].decided and number < max(max_samples, known[claim.name].length)
        ]
        if not going:
            break
        inquiry.ask(number, [claim for claim in going if number not in known[claim.name]])
        for claim in going:
            inquiry.add(number, claim)

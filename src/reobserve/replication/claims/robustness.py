"""Robustness of claims: over samples of what the paper leaves open, and single changes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from reobserve.core.errors import InputError
from reobserve.replication.claims import sequential
from reobserve.replication.claims.choices import chosen, draw
from reobserve.replication.claims.flips import Flip, smallest_flips
from reobserve.replication.claims.kept_draws import KeptDraws, as_text
from reobserve.replication.claims.known_draws import KnownDraws, MadeDraws
from reobserve.replication.claims.outcomes import Outcome, Outcomes, decided
from reobserve.replication.claims.registry import Claim, Quantifier
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.parameters.ledger import Ledger

# Of the draws: from here on a claim stands whatever else a reader chooses, and as rarely as this
# leaves it is said to fail. One in ten may choose badly. Set before anything was drawn.
FIRM = 0.9

# No claim is decided by fewer draws, if it may have as many: which choice decides can only be told
# from some. It does not weaken the decision, which may be taken at any number of draws.
_LEAST = 20

# So many draws with the same numbers show that what a claim depends on does not reach them.
_ALIKE = 8


def finding(
    quantifier: Quantifier, stated: bool, held: int, draws: int
) -> tuple[bool, bool | None]:
    """Whether a claim is true, and whether that is firm; None where the draws do not decide.

    Parameters
    ----------
    quantifier
        One setting with which it holds decides a claim of what `can` be, one with which it fails
        a claim of what `always` is. Where none is found, and for a claim of what `is`, nine of
        ten draws must agree with the settings of the parameter file.
    stated
        Whether it holds with the settings of the parameter file.
    held
        In how many of the draws it holds.
    draws
        How many there are; where there are none the settings of the file decide.
    """
    if quantifier == "can" and (stated or held):
        return True, True
    if quantifier == "always" and not (stated and held == draws):
        return False, True
    if not draws:
        return stated, True
    return stated, sequential.above(FIRM, held if stated else draws - held, draws)


@dataclass(frozen=True)
class Trial:
    """One draw: what was chosen, a value for each name of `Robustness.names`, and the outcome."""

    values: tuple[Any, ...]
    outcome: Outcome


@dataclass
class Robustness:
    """Of one claim: the draws that decide it, and the smallest change that flips it.

    ``stated`` is the outcome with the ledger as it is, ``names`` are those of the choices. ``flip``
    is None if none was found; ``looked`` is false where nobody looked. Draws in which something
    diverges count as not held, and so do those that the code refuses, as it refuses gains that are
    unstable: their numbers are in ``refused``. ``basis`` is a digest of what all this depends on,
    ``kept`` says how many of the draws were made earlier.
    """

    stated: Outcome = field(default_factory=lambda: Outcome(True))
    names: tuple[str, ...] = ()
    trials: list[Trial] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    flip: Flip | None = None
    looked: bool = True
    basis: str = ""
    kept: int = 0
    quantifier: Quantifier = "is"
    _counted: tuple[int, int] = field(default=(0, 0), init=False, repr=False, compare=False)

    def add(
        self,
        claim: Claim,
        values: tuple[Any, ...],
        numbers: tuple[float, ...] | None,
        kept: bool = False,
    ) -> None:
        """Take what came out of the next draw: None where the code refused it."""
        if numbers is None:
            self.refused.append(self.draws)
        self.trials.append(Trial(values, decided(claim, numbers or ())))
        self.kept += kept

    @property
    def to_keep(self) -> KeptDraws:
        """What another build needs of it."""
        draws = [
            None if number in self.refused else as_text(trial.outcome.numbers)
            for number, trial in enumerate(self.trials)
        ]
        return KeptDraws(self.basis, tuple(draws), self.looked, self.flip)

    @property
    def draws(self) -> int:
        """How many there were."""
        return len(self.trials)

    @property
    def held(self) -> int:
        """In how many the claim held."""
        # It is asked after every draw: those that were counted are not counted again.
        counted, held = self._counted
        held += sum(trial.outcome.held for trial in self.trials[counted:])
        self._counted = len(self.trials), held
        return held

    @property
    def diverged(self) -> int:
        """In how many something diverged."""
        return sum(not trial.outcome.numbers for trial in self.trials) - len(self.refused)

    @property
    def share(self) -> float:
        """Of the draws in which the claim held."""
        return self.held / self.draws if self.draws else float("nan")

    @property
    def agreed(self) -> int:
        """In how many the claim fared as it does with the ledger as it is."""
        return self.held if self.stated.held else self.draws - self.held

    @property
    def firm(self) -> bool | None:
        """Whether the draws support what is found, see `finding`; None if they do not decide."""
        if not self.draws:
            return None
        return finding(self.quantifier, self.stated.held, self.held, self.draws)[1]

    @property
    def decided(self) -> bool:
        """Whether no more draws are needed."""
        return self.draws >= _LEAST and self.firm is not None

    def interval(self) -> tuple[float, float]:
        """What the share may be; see `sequential.interval`, which is of the draws that agree."""
        low, high = sequential.interval(self.agreed, self.draws)
        return (low, high) if self.stated.held else (1 - high, 1 - low)

    @property
    def alike(self) -> bool:
        """Whether many draws gave the same numbers, all of them: no choice reaches these."""
        numbers = {repr(trial.outcome.numbers) for trial in self.trials}
        lost = self.diverged or self.refused
        return self.draws >= _ALIKE and len(numbers) == 1 and not lost


@dataclass(frozen=True)
class Inquiry:
    """Claims of which draws are made, and by name what is found and what was known of each."""

    ledger: Ledger
    outcomes: Outcomes
    claims: Sequence[Claim]
    found: dict[str, Robustness]
    known: dict[str, KnownDraws]

    @staticmethod
    def begin(
        evaluator: Evaluator,
        claims: Sequence[Claim],
        kept: Mapping[str, KeptDraws] | None = None,
        made: MadeDraws | None = None,
        looked: bool = True,
    ) -> Inquiry:
        """With no draws yet; left out are claims that are broken or depend on nothing."""
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
            known[claim.name] = KnownDraws.of(claim.name, basis, kept or {}, made or {})
        return Inquiry(evaluator.ledger, outcomes, asked, found, known)

    def ask(self, number: int, claims: Iterable[Claim]) -> None:
        """Make a draw of some claims; what comes out is known from then on."""
        together = defaultdict(list)
        for claim in claims:
            together[tuple(claim.keys)].append(claim)
        here = self.outcomes.apart()  # claims that depend on the same choices share what they need
        for members in together.values():
            drawn, _ = draw(self.ledger, members[0].choices, number)
            try:
                there = here.at(drawn, members)
            except InputError:
                there = {}
            for claim in members:
                numbers = there[claim.name].numbers if there else None
                self.known[claim.name].take(number, numbers)

    def add(self, number: int, claim: Claim) -> None:
        """Take the next draw of a claim, which must be known, for what is found."""
        known, values = self.known[claim.name], chosen(self.ledger, claim.choices, number)
        self.found[claim.name].add(claim, values, known[number], known.is_kept(number))


def assess(
    evaluator: Evaluator,
    claims: Sequence[Claim],
    draws: int,
    flips: bool = True,
    kept: Mapping[str, KeptDraws] | None = None,
    made: MadeDraws | None = None,
) -> dict[str, Robustness]:
    """The robustness of every claim that depends on something, by name.

    Parameters
    ----------
    evaluator
        Draws and moves start from its ledger, and from what it has made of that.
    claims
        Of the same paper; left out are those that are broken or depend on nothing.
    draws
        The most for each claim, if fewer do not decide and no more are kept.
    flips
        Whether to look for the smallest change that flips a claim.
    kept
        By claim: draws that need not be made again, and the change that was found with them.
    made
        Draws that were made ahead, see `known_draws.read_chunks`.

    Raises
    ------
    InputError
        If the ledger as it is cannot be run.
    DivergenceError
        If something diverges with the ledger as it is.
    """
    inquiry = Inquiry.begin(evaluator, claims, kept, made, looked=flips)
    _draw_all(inquiry, draws)
    found, known = inquiry.found, inquiry.known
    if flips:
        told = {name: one.kept.flip for name, one in known.items() if one.kept and one.kept.looked}
        sought = [claim for claim in inquiry.claims if claim.name not in told]
        told |= smallest_flips(inquiry.ledger, inquiry.outcomes, sought)
        for name, flip in told.items():
            found[name].flip = flip
    return found


def _draw_all(inquiry: Inquiry, most: int) -> None:
    """Ask one reader after the other, each about all claims that are not yet decided."""
    found, known = inquiry.found, inquiry.known
    longest = max((one.length for one in known.values()), default=0)
    for number in range(max(most, longest)):
        going = [
            claim
            for claim in inquiry.claims
            if not found[claim.name].decided and number < max(most, known[claim.name].length)
        ]
        if not going:
            break
        inquiry.ask(number, [claim for claim in going if number not in known[claim.name]])
        for claim in going:
            inquiry.add(number, claim)

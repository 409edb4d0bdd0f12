"""Whether claims hold with a ledger, computed in this one process."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from reobserve.errors import DivergenceError, InputError
from reobserve.evidence.claims.checks import THEORY, Numbers
from reobserve.evidence.claims.registry import Claim
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.evaluation import Evaluator
from reobserve.scoring.metrics import Metric, lookup


@dataclass(frozen=True)
class Outcome:
    """Of a claim: whether it holds, and the number that decides each of its checks.

    Where something that it needs diverges, it does not hold and has no numbers.
    """

    held: bool
    numbers: tuple[float, ...] = ()


class Outcomes:
    """Outcomes of claims with other ledgers; what a change does not touch is not run again."""

    def __init__(self, ledger: Ledger, claims: Iterable[Claim]) -> None:
        # Siblings start from what this one has run: all that the claims need.
        self._base = Evaluator(ledger)
        figures = dict.fromkeys(figure for claim in claims for figure in claim.figures)
        self._stated = {figure: lookup(metrics_of(self._base, figure)) for figure in figures}

    def at(self, ledger: Ledger, claims: Iterable[Claim]) -> dict[str, Outcome]:
        """The outcomes by claim.

        Raises
        ------
        InputError
            If the ledger cannot be run, or a claim names a number that does not exist.
        """
        evaluator = self._base.sibling(ledger)
        numbers: dict[str, dict[tuple[str, str], float]] = {}
        diverged = set()
        outcomes: dict[str, Outcome] = {}
        asked = frozenset(ref.metric for claim in claims for ref in claim.references(THEORY))
        for claim in claims:
            for figure in claim.figures:
                if figure in numbers or figure in diverged:
                    continue
                try:
                    numbers[figure] = lookup(metrics_of(evaluator, figure, asked))
                except DivergenceError:
                    diverged.add(figure)
            lost = diverged.intersection(claim.figures)
            outcomes[claim.name] = Outcome(False) if lost else outcome(claim, numbers)
        return outcomes

    def stated(self, claim: Claim) -> Outcome | None:
        """The outcome with the ledger as it is; None if it names a number that nobody has."""
        try:
            return outcome(claim, self._stated)
        except InputError:
            return None


def metrics_of(
    evaluator: Evaluator, figure: str, asked: frozenset[str] | None = None
) -> list[Metric]:
    """The numbers behind a figure, or of the theory; of that perhaps those ``asked`` for only."""
    return evaluator.theory(asked) if figure == THEORY else evaluator.figure(figure).metrics


def holds(claim: Claim, numbers: Numbers) -> bool:
    """Whether all checks of a claim hold; see `Check.holds`."""
    return all(check.holds(numbers) for check in claim.checks)


def outcome(claim: Claim, numbers: Numbers) -> Outcome:
    """The outcome of a claim, given the numbers behind figures; see `Check.holds`."""
    return Outcome(holds(claim, numbers), tuple(check.deciding(numbers) for check in claim.checks))

"""Outcomes of claims with other parameters, computed in one process."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import dataclass

from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.seals import digest
from reobserve_papers.claims.checks import THEORY, Check, Numbers
from reobserve_papers.claims.registry import Claim
from reobserve_papers.metrics.metrics import Metric, lookup
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator


@dataclass(frozen=True)
class Outcome:
    """Outcome of a claim: whether it holds, and the number that decides each of its checks.

    Where something that it needs diverges, it does not hold and has no numbers.
    """

    held: bool
    numbers: tuple[float, ...] = ()


class Outcomes:
    """Outcomes of claims with other parameters, running only what a change touches."""

    def __init__(self, base: Evaluator, claims: Iterable[Claim]) -> None:
        # What others start from: all that the claims need.
        self._base = base
        figures = dict.fromkeys(figure for claim in claims for figure in claim.figures)
        self._stated = {figure: lookup(metrics_of(self._base, figure)) for figure in figures}

    def apart(self) -> Outcomes:
        """A copy, with which all that it runs from here on is forgotten."""
        other = copy.copy(self)
        other._base = self._base.apart()
        return other

    def at(self, parameters: Parameters, claims: Iterable[Claim]) -> dict[str, Outcome]:
        """The outcomes by claim.

        Raises
        ------
        InputError
            If the parameter file cannot be run, or a claim names a number that does not exist.
        """
        evaluator = self._base.sibling(parameters)
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

    def basis(self, claim: Claim) -> str:
        """See `basis_of`."""
        return basis_of(self._base, claim)

    def stated(self, claim: Claim) -> Outcome | None:
        """The outcome with the stated parameters, or None if it names an unknown number."""
        try:
            return outcome(claim, self._stated)
        except InputError:
            return None


def basis_of(evaluator: Evaluator, claim: Claim) -> str:
    """A digest of all but code that samples of a claim depend on."""
    seen = [evaluator.digest(None if figure == THEORY else figure) for figure in claim.figures]
    asked = [repr(part) for part in (*claim.checks, *claim.choices)]
    asked += [repr(knob.named) for choice in claim.choices for knob in choice.knobs if knob.named]
    return digest([seen, asked, evaluator.parameters.seed])


def metrics_of(
    evaluator: Evaluator, figure: str, asked: frozenset[str] | None = None
) -> list[Metric]:
    """The numbers behind a figure, or of the theory, perhaps of those ``asked`` for only."""
    return evaluator.theory(asked) if figure == THEORY else evaluator.figure(figure).numbers


def outcome(claim: Claim, numbers: Numbers) -> Outcome:
    """The outcome of a claim, given the numbers behind figures (see `Check.deciding`)."""
    return decided(claim, tuple(check.deciding(numbers) for check in claim.checks))


def decided(claim: Claim, numbers: tuple[float, ...]) -> Outcome:
    """The outcome where these numbers decide the checks, or none because something diverged."""
    satisfied = bool(numbers) and all(map(Check.satisfied_by, claim.checks, numbers))
    return Outcome(satisfied, numbers)

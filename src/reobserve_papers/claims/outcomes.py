"""Outcomes of claims with other parameters, computed in one process."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.seals import digest
from reobserve_papers.claims.checks import THEORY, Numbers, Reference
from reobserve_papers.claims.choices import Choice
from reobserve_papers.claims.registry import Claim
from reobserve_papers.metrics.metrics import Metric, lookup
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator

# Whether a claim holds. Where it says which of two numbers is less, its opposite may hold, or
# neither (a tie); else it is opposed where it does not hold. It is no case where it would divide by
# what is not a number.
Outcome = Literal["holds", "tie", "opposed", "diverged", "refused", "no case"]

# Numbers of one sample by reference, without those of a figure that diverged.
Sample = Mapping[Reference, float]


class Outcomes:
    """Numbers of claims with other parameters, running only what a change touches."""

    def __init__(self, base: Evaluator, claims: Iterable[Claim]) -> None:
        # What others start from: all that the claims need.
        self._base = base
        figures = dict.fromkeys(ref.figure for claim in claims for ref in claim.wanted)
        self._nominal = {figure: lookup(metrics_of(self._base, figure)) for figure in figures}

    def isolated(self) -> Outcomes:
        """A copy, with which all that it runs from here on is forgotten."""
        other = copy.copy(self)
        other._base = self._base.isolated()
        return other

    def at(self, parameters: Parameters, claims: Iterable[Claim]) -> dict[str, Sample]:
        """Return the numbers that the claims want, by claim."""
        evaluator = self._base.sibling(parameters)
        claims = list(claims)
        wanted = [ref for claim in claims for ref in claim.wanted]
        asked = frozenset(ref.metric for ref in wanted if ref.figure == THEORY)
        numbers: dict[str, Mapping[tuple[str, str], float]] = {}
        for figure in dict.fromkeys(ref.figure for ref in wanted):
            try:
                numbers[figure] = lookup(metrics_of(evaluator, figure, asked))
            except DivergenceError:
                continue
        return {claim.name: taken(claim.wanted, numbers) for claim in claims}

    def nominal(self, claim: Claim) -> Sample | None:
        """The numbers with the parameter file as it is, or None if it names an unknown one."""
        try:
            for check in claim.checks:
                check.values(self._nominal)
        except InputError:
            return None
        return {
            ref: self._nominal[ref.figure][ref.observer, ref.metric]
            for ref in claim.wanted
            if (ref.observer, ref.metric) in self._nominal.get(ref.figure, {})
        }


def basis_of(evaluator: Evaluator, claim: Claim, known: Sequence[str] | None = None) -> str:
    """A digest of all but code that samples of a claim depend on.

    ``known`` are the keys of the parameter file that there were when they were made: keys that have
    been added since do not count. Which numbers are taken of a sample and what is asked of them
    does not count either.
    """
    parameters = evaluator.parameters
    if known is not None and set(known) != set(parameters.by_key):
        evaluator = Evaluator(_without_new(parameters, frozenset(known)))
    figures = dict.fromkeys(ref.figure for ref in claim.wanted)
    seen = {
        figure: evaluator.digest(None if figure == THEORY else figure)
        for figure in figures
        if figure in claim.figures
    }
    counted = claim.cells is not None
    described = [_described(choice, counted) for choice in claim.choices]
    return digest([seen, described, parameters.seed])


def _described(choice: Choice, counted: bool) -> list[Any]:
    """Describe what a sample draws, in plain values."""
    return [
        [list(choice.keys)],
        *(
            [list(knob.keys), list(knob.path), list(knob.span), knob.multiple,
             list(knob.words), list(knob.named), *[knob.block] * bool(knob.words and not counted)]
            for knob in choice.knobs
        ),
    ]  # fmt: skip


def _without_new(parameters: Parameters, known: frozenset[str]) -> Parameters:
    """The parameters without entries that are not known."""

    def pruned(tree: Any, place: str) -> Any:
        if not isinstance(tree, Mapping):
            return tree
        kept = {}
        for key, value in tree.items():
            here = f"{place}.{key}" if place else str(key)
            if here in parameters.by_key and here not in known:
                continue
            kept[key] = value if here in parameters.by_key else pruned(value, here)
        return kept

    return replace(parameters, tree=pruned(parameters.tree, ""))


def metrics_of(
    evaluator: Evaluator, figure: str, asked: frozenset[str] | None = None
) -> list[Metric]:
    """The numbers behind a figure, or of the theory, perhaps of those ``asked`` for only."""
    return evaluator.theory(asked) if figure == THEORY else evaluator.figure(figure).numbers


def taken(wanted: Iterable[Reference], numbers: Numbers) -> dict[Reference, float]:
    """The numbers that a claim wants, without those of figures that diverged."""
    return {ref: ref.look_up(numbers) for ref in wanted if ref.figure in numbers}


def nested(sample: Sample) -> dict[str, dict[tuple[str, str], float]]:
    """The same numbers, by figure."""
    numbers: dict[str, dict[tuple[str, str], float]] = {}
    for ref, value in sample.items():
        numbers.setdefault(ref.figure, {})[ref.observer, ref.metric] = value
    return numbers


def outcome(claim: Claim, numbers: Numbers | None) -> Outcome:
    """The outcome of a claim, given the numbers behind figures, None where these were refused."""
    if numbers is None:
        return "refused"
    if any(figure not in numbers for figure in claim.figures):
        return "diverged"
    if not all(check.is_case(numbers) for check in claim.checks):
        return "no case"
    if all(check.holds(numbers) for check in claim.checks):
        return "holds"
    mirrored = [check.mirrored for check in claim.checks]
    if not any(mirrored):
        return "opposed"
    turned = (other or check for check, other in zip(claim.checks, mirrored, strict=True))
    return "opposed" if all(check.holds(numbers) for check in turned) else "tie"


def deciding(claim: Claim, numbers: Numbers | None) -> tuple[float, ...]:
    """The number that decides each check, none where it is no case, diverged or was refused."""
    if numbers is None or outcome(claim, numbers) in ("no case", "diverged"):
        return ()
    return tuple(check.deciding(numbers) for check in claim.checks)

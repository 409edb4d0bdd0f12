"""Cached samples that a build repeats: every step and number once."""

from __future__ import annotations

from collections import Counter

import pytest

from reobserve_papers.claims.checks import THEORY
from reobserve_papers.claims.choices import chosen, with_values
from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.claims.sample_table import Samples, SampleTable, read_cached, to_repeat
from reobserve_papers.parameters.parameters import default_parameters
from reobserve_papers.steps import evaluation
from reobserve_papers.steps.chain import reads
from reobserve_papers.steps.evaluation import Evaluator
from tests import FIVE, ROOT

from .stub import GAIN, ILO, Code, assess, claim

STUDY = [
    claim("fig4_matched a gain", GAIN, name="gain", above=620),
    claim("fig4_matched a share", GAIN, name="share", above=0.31),
]


class Recorded:
    """The steps that samples run, in place of running them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.steps: list[tuple[str, ...]] = []

        def run(evaluator: Evaluator, *step: str) -> None:
            self.steps.append(step)
            for need in reads(evaluator.parameters, *step):
                evaluator.result(*need)

        monkeypatch.setattr(Evaluator, "run", run)
        monkeypatch.setattr(evaluation, "figure_data", lambda *_: None)
        monkeypatch.setattr(evaluation, "measure", lambda *_: [])

    def of(self, evaluator: Evaluator, one: Claim) -> Counter[tuple[str, ...]]:
        """The steps for all figures of a claim, and the names of numbers without a study."""
        numbers = set()
        self.steps.clear()
        for figure in {reference.figure for reference in one.wanted}:
            before = len(self.steps)
            metrics = {(str(reference),) for reference in one.wanted if reference.figure == figure}
            if figure == THEORY:
                evaluator.theory(frozenset(reference.metric for reference in one.wanted))
            else:
                evaluator.figure(figure)
            if not any(step[0] == "study" for step in self.steps[before:]):
                numbers |= metrics
        return Counter([*self.steps, *numbers])


@pytest.mark.parametrize("paper", FIVE)
def test_all_that_cached_samples_run_is_repeated_and_studies_once(
    paper: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters, recorded = default_parameters(ROOT, paper), Recorded(monkeypatch)
    claims = [one for one in read_registry(ROOT, parameters).claims if one.checks and one.choices]
    cached = read_cached(ROOT, paper).claims
    base = Evaluator(parameters)
    for one in claims:
        recorded.of(base, one)
        base.theory()

    def steps(one: Claim, number: int) -> Counter[tuple[str, ...]]:
        values = chosen(parameters, one.choices, number)
        here = base.isolated().sibling(with_values(parameters, one.choices, values))
        return recorded.of(here, one)

    needed, others = to_repeat(Evaluator(parameters), claims, cached)
    assert {**needed, **others}.keys() == {one.name for one in claims}
    repeated = sum(
        (steps(one, needed[one.name]) for one in claims if one.name in needed), Counter()
    )
    for one in claims:
        for number in range(min(2, len(cached[one.name].samples))):
            assert steps(one, number).keys() <= repeated.keys(), (one.name, number)
    assert {n for step, n in repeated.items() if step[0] == "study"} <= {1}


def past(*samples: str | None) -> Samples:
    return Samples("", ("fig4_matched a gain",), samples)


def test_sample_that_was_refused_verifies_nothing() -> None:
    one, two = (claim("fig4_matched a gain", GAIN, name=name, above=620) for name in "ab")
    for samples, expected in (
        (("1", "1"), ({"a": 0}, {"b": 0})),
        ((None, "1"), ({"a": 0}, {"b": 1})),
        ((None, None), ({"a": 0, "b": 0}, {})),
        (("-", "-"), ({"a": 0, "b": 0}, {})),
        ((), ({"a": 0}, {})),
    ):
        assert (
            to_repeat(Evaluator(ILO), [one, two], {"a": past("1"), "b": past(*samples)}) == expected
        )
    assert to_repeat(Evaluator(ILO), [one, two], {"b": past("1")}) == ({"b": 0}, {})


def found(cached: SampleTable | None = None) -> dict[str, Robustness]:
    return assess(Evaluator(ILO), STUDY, lambda _: 40, 0.9, cached)


def test_claims_of_one_study_are_verified_by_one_sample_unless_it_differs(code: Code) -> None:
    first = found()
    cached = SampleTable(
        tuple(ILO.by_key), {one.name: first[one.name].to_keep(one) for one in STUDY}
    )

    def counts() -> dict[str, int]:
        code.asked.clear()
        return {name: one.samples - one.cached for name, one in found(cached).items()}

    assert counts() == {"gain": 1, "share": 0}
    assert len(code.asked) == 2  # nominal, and one sample
    code.factor = 1.001
    assert counts() == {"gain": first["gain"].samples, "share": 1}

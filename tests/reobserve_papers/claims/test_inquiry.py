"""Samples with a known answer: the "metric" is itself a number of the parameter file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reobserve_papers.claims import outcomes
from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.inquiry import Inquiry, Robustness, read_robustness
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.sample_table import write_samples
from reobserve_papers.claims.verdict_rules import Counted, possible
from reobserve_papers.steps.evaluation import Evaluator

from .stub import GAIN, ILO, PERIODS, SHARE, VARIANT, Code, assess, claim, with_checks

pytestmark = pytest.mark.usefixtures("code")


def found(one: Claim, samples: int = 400, share: float = 0.9) -> Robustness:
    return assess(Evaluator(ILO), [one], lambda _: samples, share)["it"]


def counted(one: Claim, samples: Robustness) -> Counted:
    return samples.counted(samples.outcomes(one))


def verdicts(one: Claim, samples: Robustness, share: float = 0.9) -> tuple[str, ...]:
    return possible(one.quantifier, counted(one, samples), share)


def test_share_of_samples_agrees_with_the_range() -> None:
    """Near the line of the verdicts, so that no number of samples decides."""
    near = claim("fig1 a gain", GAIN, above=630)  # 0.1 of a decade from 500
    one = found(near)
    assert one.samples == 400
    assert len(verdicts(near, one)) == 2
    low, high = counted(near, one).interval()
    assert low < 1 - math.log10(1.26) < high
    assert abs(counted(near, one).held / 400 - 0.9) < 4 * math.sqrt(0.09 / 400)


def test_sampling_stops_when_decided() -> None:
    half = claim("fig1 a gain", GAIN, above=1600)
    assert 20 <= found(half).samples < 100
    assert verdicts(half, found(half)) == ("depends on unstated choices",)
    always, never = claim("fig1 a gain", GAIN, above=400), claim("fig1 a gain", GAIN, below=400)
    assert counted(always, found(always)) == Counted(36, 36)
    assert counted(never, found(never)) == Counted(0, 36)
    assert verdicts(never, found(never)) == ("contradicted",)
    assert counted(never, found(never)).interval() == (
        0.0,
        pytest.approx(1 - counted(always, found(always)).interval()[0]),
    )


def test_another_share_decides_after_other_numbers_of_samples() -> None:
    always = claim("fig1 a gain", GAIN, above=400)
    assert found(always, share=0.8).samples == 20  # 17 would do, and no fewer than 20 are made
    assert found(always, share=0.95).samples > 36


def test_counterexample_ends_the_samples_of_what_is_always_so() -> None:
    rare = replace(claim("fig1 a gain", GAIN, below=4000), quantifier="always")
    one = found(rare)
    assert one.samples == 20
    assert verdicts(rare, one) == ("contradicted",)
    sure = replace(claim("fig1 a gain", GAIN, above=400), quantifier="always")
    assert (found(sure).samples, verdicts(sure, found(sure))) == (36, ("reproduced",))


@given(
    st.sampled_from([400, 520, 620, 1600, 4000, 5000]), st.sampled_from(["is", "can", "always"]),
    st.booleans(), st.integers(0, 120), st.integers(36, 100),
)  # fmt: skip
@example(1600, "is", False, 100, 100)
@example(400, "is", True, 100, 80)
def test_main_claims_and_those_that_depend_get_enough_samples(
    bound: float, quantifier: Any, is_main: bool, enough: int, maximum: int
) -> None:
    promised = ("abstract",) if is_main else ()
    one = replace(claim("fig1 a gain", GAIN, above=bound), quantifier=quantifier, promised=promised)
    inquiry = Inquiry.begin(Evaluator(ILO), [one], 0.9)
    inquiry.fill(lambda _: maximum, enough=enough)
    samples, alone = inquiry.sampled["it"].samples, found(one, maximum).samples
    if is_main or inquiry.possible(one) == ("depends on unstated choices",):
        assert samples == max(alone, min(enough, maximum))
        assert inquiry.lacks(one, enough) == (samples < enough)
    else:
        assert samples == alone or not alone < samples < enough
        assert not inquiry.lacks(one, enough)


@given(st.floats(400, 5100), st.sampled_from([1600.0, 4500.0]), st.sampled_from(["is", "always"]))
@example(620.0, 1600.0, "is")
@example(5100.0, 1600.0, "is")  # none is a case
@example(400.0, 1600.0, "is")  # all are
def test_samples_that_are_no_case_are_replaced(rests: float, bound: float, quantifier: Any) -> None:
    """They count neither way, and the verdict is that of the same samples without them."""
    one = claim("fig1 a gain", GAIN, over="fig1 a left", below=bound)
    one = replace(one, quantifier=quantifier, promised=("abstract",))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(outcomes, "metrics_of", code := Code())
        code.rests = rests
        inquiry = Inquiry.begin(Evaluator(ILO), [one], 0.9)
        inquiry.fill(lambda _: 60, enough=60)
    drawn = inquiry.sampled["it"]
    gains = [trial.values[0] for trial in drawn.trials]
    assert [word == "no case" for word in drawn.outcomes(one)] == [gain < rests for gain in gains]
    cases = [gain for gain in gains if gain >= rests]
    assert counted(one, drawn) == Counted(sum(gain < bound for gain in cases), len(cases))
    assert len(cases) == 60 or drawn.samples == 120
    assert verdicts(one, drawn) == inquiry.possible(one)


def test_all_claims_use_the_same_samples() -> None:
    """Samples are shared between claims, and each claim stops when it is decided."""
    quick = claim("fig1 a gain", GAIN, above=1900)
    slow = claim("fig1 a gain", SHARE, GAIN, above=400, name="slow")
    both = assess(Evaluator(ILO), [quick, slow], lambda _: 400, 0.9)
    assert (both["it"].samples, both["slow"].samples) == (20, 36)
    gains = [[trial.numbers for trial in one.trials] for one in both.values()]
    assert gains[0] == gains[1][:20]


def test_sample_stores_its_choices_and_numbers() -> None:
    one = found(claim("fig1 a gain", GAIN, above=400), 3)
    assert one.names == (GAIN,)
    for trial in one.trials:
        assert trial.numbers is not None
        assert list(trial.numbers.values()) == pytest.approx(trial.values, rel=1e-9)


def test_samples_that_cannot_differ_are_reported() -> None:
    unreached = claim("fig1 a share", GAIN, above=0)  # K1 does not change with the gain
    reached = claim("fig1 a gain", GAIN, above=0)
    assert found(unreached).alike(unreached)
    assert not found(reached).alike(reached)
    assert not found(unreached, 7).alike(unreached)  # too few to decide


def test_samples_that_differ_in_a_number_of_an_alternative_only_are_alike() -> None:
    unreached = claim("fig1 a share", GAIN, above=0)
    more = replace(unreached, wanted=(*unreached.wanted, Reference("fig1", "a", "gain")))
    assert found(more).alike(more)


def test_samples_depend_on_the_seed_but_not_on_other_claims() -> None:
    one = claim("fig1 a gain", GAIN, above=1000)
    other = claim("fig1 a share", SHARE, above=0.7, name="other")
    alone = assess(Evaluator(ILO), [one], lambda _: 50, 0.9)["it"]
    both = assess(Evaluator(ILO), [other, one], lambda _: 50, 0.9)["it"]
    assert alone == both
    refused = claim("fig3 a gain", GAIN, above=1000, name="refused")  # what it needs, half the time
    with_it = assess(Evaluator(ILO), [refused, one], lambda _: 50, 0.9)
    assert with_it["it"] == alone
    assert "refused" in with_it["refused"].outcomes(refused)
    seeded = replace(ILO, seed=2)
    assert assess(Evaluator(seeded), [one], lambda _: 50, 0.9)["it"].trials != alone.trials


def test_diverging_sample_is_lost() -> None:
    one = claim("fig2 a gain", GAIN, above=0)
    samples = found(one)
    outcomes = samples.outcomes(one)
    assert outcomes.count("holds") + outcomes.count("diverged") == samples.samples
    assert 0 < outcomes.count("diverged") < samples.samples
    assert verdicts(one, samples) == ("depends on unstated choices",)


def test_refused_sample_is_lost() -> None:
    one = claim("fig3 a gain", GAIN, above=0)
    samples = found(one)
    outcomes = samples.outcomes(one)
    assert 0 < outcomes.count("refused") == samples.samples - outcomes.count("holds")
    gains = [trial.values[0] for trial in samples.trials if trial.numbers is None]
    assert gains
    assert max(gains) < 1000
    kept = samples.to_keep(one).samples
    assert [text is None for text in kept] == [trial.numbers is None for trial in samples.trials]


def test_samples_take_the_numbers_of_alternatives_and_nulls() -> None:
    one = replace(claim("fig1 a gain", GAIN, above=400), null={"a": "idle"})
    one = with_checks(one, *one.checks)
    one = replace(one, wanted=(*one.wanted, Reference("fig1", "a", "share")))
    samples = found(one, 3)
    names = [(ref.observer, ref.metric) for ref in samples.trials[0].numbers or ()]
    assert names == [("a", "gain"), ("idle", "gain"), ("a", "share")]
    assert samples.outcomes(one.with_null) == ["holds"] * 3  # it is 1000
    harder = with_checks(one, Check.parse({"value": "fig1 a gain", "above": 1001}))
    assert samples.outcomes(harder.with_null) == ["opposed"] * 3


# Words and counts that are few are counted.


def test_few_discrete_choices_are_counted() -> None:
    words = claim("fig1 a variant", VARIANT, below=1.5)
    one = found(words, 1)  # a maximum of samples is none of what is counted
    assert (one.samples, one.whole) == (3, 3)
    assert [trial.values for trial in one.trials] == [
        ("sampled",),
        ("continuous",),
        ("forgetting",),
    ]
    assert counted(words, one) == Counted(2, 3, whole=True)
    assert verdicts(words, one) == ("depends on unstated choices",)
    both = claim("fig1 a variant", VARIANT, PERIODS, below=2.5)
    one = found(both)
    assert one.samples == one.whole == 3 * 4
    assert len({trial.values for trial in one.trials}) == 12
    assert verdicts(both, one) == ("reproduced",)


def test_what_is_counted_with_what_is_not_is_sampled() -> None:
    one = found(claim("fig1 a variant", VARIANT, GAIN, below=2.5))
    assert (one.whole, one.samples) == (None, 36)


def test_claims_with_and_without_counting_are_decided_together() -> None:
    words = claim("fig1 a variant", VARIANT, below=1.5, name="words")
    near = claim("fig1 a gain", GAIN, above=630)
    both = assess(Evaluator(ILO), [words, near], lambda _: 30, 0.9)
    assert (both["words"].samples, both["it"].samples) == (3, 30)


def test_claims_without_choices_and_broken_claims_are_skipped() -> None:
    free = claim("fig1 a gain", above=0)
    unknown = claim("fig1 a gains", GAIN, above=0)
    assert assess(Evaluator(ILO), [free, unknown], lambda _: 4, 0.9) == {}


def test_alternative_that_names_an_unknown_number_is_refused(code: Code) -> None:
    one = claim("fig1 a gain", GAIN, above=0)
    one = replace(one, wanted=(*one.wanted, Reference("fig1", "a", "gian")))
    said = r"^claims\.ilo\.it: an alternative names fig1 a gian, which there is not$"
    with pytest.raises(ValueError, match=said):
        Inquiry.begin(Evaluator(ILO), [one], 0.9)


@pytest.mark.parametrize("figure", ["fig1", "fig2", "fig3"])
def test_stored_samples_are_read_as_they_were(figure: str, tmp_path: Path) -> None:
    one = claim(f"{figure} a gain", GAIN, VARIANT, above=0)
    samples = found(one, 40)
    write_samples(tmp_path / "robustness.json", ILO, {"it": samples.to_keep(one)})
    assert read_robustness(tmp_path / "robustness.json", ILO, [one]) == {"it": samples}

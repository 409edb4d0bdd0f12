"""Robustness with a known answer: the "metric" is itself a number of the parameter file."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.errors import DivergenceError, InputError
from reobserve_papers.claims import outcomes
from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.choices import find_choice
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.reversals import Reversal
from reobserve_papers.claims.robustness import Robustness, assess
from reobserve_papers.claims.robustness_file import read_robustness, to_data
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
GAIN = "observers.continuous.K2"  # 2000, from 500 to 5000: logarithmic
FORGETTING = "observers.forgetting.K1"  # 0.9, from 0.5 to 0.99: linear
VARIANT = "metrics.variant"  # the first of these words
VARIANTS = ("sampled", "continuous", "forgetting")


@pytest.fixture(autouse=True)
def shown(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Figures that show gains of the parameter file; one diverges, one is refused; all calls are
    cached.
    """
    calls: list[str] = []

    def metrics_of(evaluator: Evaluator, figure: str, asked: object = None) -> list[Metric]:
        calls.append(figure)
        observers = evaluator.parameters.section("observers")
        gain = observers["continuous"]["K2"]
        if figure == "fig2" and gain < 1000:
            raise DivergenceError("it", 1.0)
        if figure == "fig3" and gain < 1000:
            raise InputError("K2", "must be 1000 or more")
        share = observers["forgetting"]["K1"]
        place = VARIANTS.index(evaluator.parameters.section("metrics")["variant"])
        numbers = {"gain": gain, "share": share, "variant": place}
        return [Metric("a", name, value, "1") for name, value in numbers.items()]

    monkeypatch.setattr(outcomes, "metrics_of", metrics_of)
    return calls


def claim(value: str, *keys: str, **relation: Any) -> Claim:
    checks = (Check.parse({"value": value, **relation}),)
    return Claim("ilo", "it", checks=checks, choices=tuple(find_choice(ILO, key) for key in keys))


def found(one: Claim, samples: int = 400) -> Robustness:
    return assess(Evaluator(ILO), [one], samples)["it"]


def test_share_of_samples_agrees_with_the_range() -> None:
    """Near the threshold of the verdicts, so that no number of samples decides."""
    one = found(claim("fig1 a gain", GAIN, above=630))  # 0.1 of a decade from 500
    assert one.firm is None
    assert one.samples == 400
    low, high = one.interval()
    assert low < 1 - math.log10(1.26) < high
    assert one.share == one.held / 400


def test_sampling_stops_when_decided() -> None:
    turns_over = found(claim("fig1 a gain", GAIN, above=1000))
    assert turns_over.firm is False
    assert 20 <= turns_over.samples < 100
    holds = found(claim("fig1 a gain", GAIN, above=400))
    assert (holds.firm, holds.samples, holds.held) == (True, 36, 36)
    fails = found(claim("fig1 a gain", GAIN, below=400))
    assert (fails.firm, fails.samples, fails.held) == (True, 36, 0)
    assert fails.interval() == (0.0, pytest.approx(1 - holds.interval()[0]))


def test_all_claims_use_the_same_samples() -> None:
    """Samples are shared between claims, and each claim stops when it is decided."""
    quick = claim("fig1 a gain", GAIN, above=1900)
    slow = replace(claim("fig1 a gain", FORGETTING, GAIN, above=400), name="slow")
    both = assess(Evaluator(ILO), [quick, slow], 400)
    assert (both["it"].samples, both["slow"].samples) == (20, 36)
    gains = [[trial.outcome.numbers for trial in one.trials] for one in both.values()]
    assert gains[0] == gains[1][:20]


def test_sample_stores_its_choices_and_outcome() -> None:
    one = found(claim("fig1 a gain", GAIN, above=400), 3)
    assert one.names == (GAIN,)
    assert [trial.outcome.numbers for trial in one.trials] == [t.values for t in one.trials]
    assert one.stated.numbers == (2000.0,)


def test_samples_that_cannot_differ_are_reported() -> None:
    assert found(claim("fig1 a share", GAIN, above=0)).alike  # K1 does not change with the gain
    assert not found(claim("fig1 a gain", GAIN, above=0)).alike
    assert not found(claim("fig1 a share", GAIN, above=0), 7).alike  # too few to decide


def test_samples_depend_on_the_seed_but_not_on_other_claims() -> None:
    one, other = (
        claim("fig1 a gain", GAIN, above=1000),
        claim("fig1 a share", FORGETTING, above=0.7),
    )
    alone = assess(Evaluator(ILO), [one], 50)["it"]
    both = assess(Evaluator(ILO), [replace(other, name="other"), one], 50)["it"]
    assert alone == both


def test_smallest_reversing_change_is_found_within_tolerance() -> None:
    """From 2000 to 1000 is log10(2) of a decade; the interval from 1/4 of the way is halved."""
    one = found(claim("fig1 a gain", GAIN, above=1000), 1)
    assert one.reversal is not None
    assert (one.reversal.key, one.reversal.unit, one.reversal.start) == (GAIN, "N m s/rad", 2000.0)
    true = math.log10(2)
    assert true <= one.reversal.size <= true + 0.75 * math.log10(4) / 16
    assert one.reversal.end <= 1000
    assert one.reversal.end == pytest.approx(2000 * 10**-one.reversal.size)


def test_smaller_of_two_reversing_changes_is_reported() -> None:
    """K1 reaches 0.91 after 0.02 of its range; the gain reaches 4000 after 0.3 of its own."""
    two = claim("fig1 a gain", GAIN, FORGETTING, below=4000)
    two = replace(two, checks=(*two.checks, Check.parse({"value": "fig1 a share", "below": 0.91})))
    reversal = found(two, 1).reversal
    assert reversal is not None
    assert reversal.key == FORGETTING
    assert 0.01 / 0.49 <= reversal.size < 0.03
    assert reversal.end >= 0.91


def test_changing_a_word_counts_as_the_whole_range() -> None:
    one = claim("fig1 a variant", VARIANT, below=1.5)
    assert found(one, 1).reversal == Reversal(VARIANT, "1", "sampled", "forgetting", 1.0)
    assert found(claim("fig1 a variant", VARIANT, below=2.5), 1).reversal is None
    two = claim("fig1 a variant", VARIANT, GAIN, below=1.5)
    two = replace(two, checks=(*two.checks, Check.parse({"value": "fig1 a gain", "above": 1900})))
    reversal = found(two, 1).reversal
    assert reversal is not None
    assert reversal.key == GAIN  # which moves by less


def test_failing_claim_is_reversed_too_if_possible() -> None:
    reversal = found(claim("fig1 a gain", GAIN, below=1000), 1).reversal
    assert reversal is not None
    assert reversal.end < 1000
    assert found(claim("fig1 a gain", GAIN, above=1), 1).reversal is None


def test_diverging_sample_counts_as_failed() -> None:
    one = found(claim("fig2 a gain", GAIN, above=0))
    assert one.firm is False
    assert one.held + one.diverged == one.samples
    assert 0 < one.diverged < one.samples
    assert one.reversal is not None  # to where it diverges
    assert one.reversal.end < 1000


def test_refused_sample_counts_as_failed() -> None:
    one = found(claim("fig3 a gain", GAIN, above=0))
    assert (one.held + len(one.refused), one.diverged) == (one.samples, 0)
    assert all(gain < 1000 for k in one.refused for gain in one.trials[k].values)
    assert one.firm is False
    assert one.reversal is not None  # to where it is refused
    assert one.reversal.end < 1000
    assert one.to_keep.samples[one.refused[0]] is None


def test_existence_claim_stops_at_the_first_example() -> None:
    rare = claim("fig1 a gain", GAIN, above=4000)  # a tenth of the samples, without the nominal one
    can, seldom = found(replace(rare, quantifier="can")), found(rare)
    assert (can.firm, can.samples) == (True, 20)
    assert 0 < can.held < 20
    assert seldom.samples > 20
    always = found(replace(claim("fig1 a gain", GAIN, below=4000), quantifier="always"))
    assert (always.firm, always.samples) == (True, 20)
    none = found(replace(claim("fig1 a gain", GAIN, above=5001), quantifier="can"))
    assert (none.firm, none.samples, none.held) == (True, 36, 0)


def test_expensive_claim_is_searched_at_range_ends_only(shown: list[str]) -> None:
    expensive = replace(claim("fig1 a gain", GAIN, above=1000), expensive=True)
    one = found(expensive, 4)
    assert one.samples == 4
    assert one.reversal is not None
    assert one.reversal.end <= 1000
    # Nominal, samples, two ends, halvings.
    assert len(shown) == 1 + 4 + 2 + 4


def test_no_reversal_is_reported_without_a_search(shown: list[str], tmp_path: Path) -> None:
    one = claim("fig1 a gain", GAIN, above=100)
    silent = assess(Evaluator(ILO), [one], 4, reversals=False)["it"]
    assert (silent.samples, silent.reversal, silent.looked) == (4, None, False)
    assert len(shown) == 1 + 4
    stored = {"paper": "ilo", "seed": 1, "samples": 4, "claims": {"it": to_data(silent)}}
    (tmp_path / "robustness.json").write_text(json.dumps(stored))
    assert read_robustness(tmp_path / "robustness.json", "ilo") == {"it": silent}


def test_claims_without_choices_and_broken_claims_are_skipped() -> None:
    free = claim("fig1 a gain", above=0)
    unknown = claim("fig1 a gains", GAIN, above=0)
    assert assess(Evaluator(ILO), [free, unknown], 4) == {}

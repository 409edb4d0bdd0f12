"""Search for settings: a known minimum, interrupted runs and invalid arguments."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from reobserve import tune
from reobserve.core.errors import DivergenceError, InputError
from reobserve.tuning.search import Range, Settings, Tuned

RANGES: dict[str, Any] = {"gain": (1e-3, 1e3), "offset": (-1.0, 1.0, "linear")}
RECORDS = [0.5, 2.0]


def score(settings: Settings, record: float) -> float:
    """log score = log 0.1 + log^2(gain / 3 record) + (offset - 0.3)^2, least at (3, 0.3)."""
    off = math.log(settings["gain"] / (3.0 * record))
    return 0.1 * math.exp(off**2 + (settings["offset"] - 0.3) ** 2)


LEAST = math.log(0.1) + math.log(2.0) ** 2  # at gain 3, which is optimal for neither record


def tuned(budget: int = 200, **options: Any) -> Tuned:
    return tune(lambda one: one, RANGES, RECORDS, score, budget, 7, **options)


def test_minimum_of_a_paraboloid_is_found() -> None:
    found = tuned()
    assert len(found.history) == 200
    assert found.objective == pytest.approx(LEAST, abs=5e-3)
    assert found.settings["gain"] == pytest.approx(3.0, rel=0.05)
    assert found.settings["offset"] == pytest.approx(0.3, abs=0.05)
    assert found.score == pytest.approx(math.exp(LEAST), rel=5e-3)
    assert found.edges == {}


def test_one_dimensional_minimum_is_found_within_0_1_percent() -> None:
    found = tune(lambda one: one["gain"], {"gain": (1e-4, 1e4)}, [1.0],
                 lambda gain, _: 0.1 + math.log(gain / 0.02) ** 2, 200, 1)  # fmt: skip
    assert found.settings["gain"] == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize("budget", [3, 16, 45])
def test_history_does_not_depend_on_workers_or_budget(budget: int) -> None:
    one, two = (tuned(60, workers=workers) for workers in (1, 2))
    assert one == two
    assert tuned(budget).history == one.history[:budget]
    assert one.history != tune(lambda s: s, RANGES, RECORDS, score, 60, 8).history
    best = math.inf
    for number, trial in enumerate(one.history, start=1):
        by_hand = np.mean([math.log(min(score(trial.settings, r), 3.0)) for r in RECORDS])
        assert (trial.number, trial.failures) == (number, 0)
        assert trial.objective == pytest.approx(by_hand, abs=1e-12)
        best = min(best, trial.objective)
        assert trial.best == best
    assert one.after(60) == one.settings
    assert one.after(20) == min(one.history[:20], key=lambda t: t.objective).settings


def test_settings_at_range_limits_are_flagged() -> None:
    ranges = {"low": (1.0, 10.0), "high": (-3.0, 5.0, "linear"), "free": (0.1, 10.0)}
    found = tune(
        lambda one: one, ranges, [1.0],
        lambda s, _: 0.01 + s["low"] * (6.0 - s["high"]) * (1 + math.log(s["free"]) ** 2), 400, 1,
        failed=1e9,
    )  # fmt: skip
    assert found.edges == {"low": "low", "high": "high"}


def test_failures_get_the_worst_score_and_are_counted() -> None:
    def make(settings: Settings) -> Settings:
        if settings["gain"] > 100:
            raise InputError("gain", "is unstable")
        return settings

    def run(settings: Settings, record: float) -> float:
        if settings["gain"] < 0.1 and record > 1:
            raise DivergenceError("observer", 1.0)
        return math.nan if settings["gain"] < 0.01 else 0.5

    history = tune(make, RANGES, RECORDS, run, 64, 1).history
    for trial in history:
        gain = trial.settings["gain"]
        wanted = 2 if gain > 100 or gain < 0.01 else int(gain < 0.1)
        assert trial.failures == wanted
        mean = (wanted * math.log(3.0) + (2 - wanted) * math.log(0.5)) / 2
        assert trial.objective == pytest.approx(mean, abs=1e-12)
    assert {trial.failures for trial in history} == {0, 1, 2}


def test_settings_that_always_fail_are_reported() -> None:
    def make(settings: Settings) -> Settings:
        raise InputError("gain", "is refused")

    with pytest.raises(InputError, match=r"ranges: hold no settings .* gain: is refused"):
        tune(make, RANGES, RECORDS, score, 20)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"ranges": {}}, r"ranges: \{\} must name one setting or more"),
        ({"ranges": {"gain": 3.0}}, r"ranges\.gain: 3\.0 must be \(low, high\) or"),
        ({"ranges": {"gain": (0.0, 1.0)}}, r"ranges\.gain\.low: 0 must be greater than zero on a"),
        ({"ranges": {"gain": (2.0, 1.0)}}, r"ranges\.gain\.high: 1 must be greater than the low"),
        ({"ranges": {"gain": (1.0, math.inf)}}, r"ranges\.gain\.high: inf"),
        ({"ranges": {"gain": (1.0, 2.0, "square")}}, r"ranges\.gain\.scale: 'square' must be one"),
        ({"ranges": {3: (1.0, 2.0)}}, "ranges: 3 must be the name of a setting"),
        ({"budget": 0}, "budget: 0 must be a whole number, from 1 to 1000000"),
        ({"budget": 2.5}, "budget: 2.5 must be a whole number"),
        ({"seed": -1}, "seed: -1 must be a whole number"),
        ({"seed": "a"}, "seed: 'a' must be a whole number"),
        ({"workers": 0}, "workers: 0 must be a whole number, from 1 to 1024"),
        ({"failed": 0.0}, "failed: 0 must be greater than zero"),
        ({"records": []}, r"records: \[\] must be one record or more"),
        ({"make": 3}, "make: 3 must be a function"),
        ({"score": lambda *_: "low"}, "score: returned 'low', must return a number"),
        ({"score": lambda *_: -0.1}, "score: returned -0.1, must return zero or more"),
    ],
)  # fmt: skip
def test_invalid_search_arguments_are_refused(changed: dict[str, Any], said: str) -> None:
    given: dict[str, Any] = {
        "make": lambda one: one, "ranges": RANGES, "records": RECORDS, "score": score, "budget": 20,
        **changed,
    }  # fmt: skip
    with pytest.raises(InputError, match=said):
        tune(**given)


def test_errors_in_user_code_are_raised() -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        tune(lambda one: one, RANGES, RECORDS, lambda one, _: one + 1, 20)  # type: ignore[operator]
    with pytest.raises(KeyError):
        tune(lambda one: one["other"], RANGES, RECORDS, score, 40)


def test_range_maps_positions_to_values_and_back() -> None:
    log, linear = Range(0.01, 100.0), Range(-2.0, 2.0, "linear")
    assert [log.at(p) for p in (0.0, 0.25, 0.5, 1.0)] == [0.01, 0.1, 1.0, 100.0]
    assert [linear.at(p) for p in (0.0, 0.25, 0.5, 1.0)] == [-2.0, -1.0, 0.0, 2.0]
    assert log.place(10.0) == pytest.approx(0.75)
    assert linear.place(-1.0) == pytest.approx(0.25)

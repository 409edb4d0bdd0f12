"""The record: noise in every variant of the paper, how it is held, and the past of the input."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve_papers.papers.delay import keys, noise, plant
from reobserve_papers.parameters.job import read_job
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series
from tests.reobserve_papers.papers import fixed_parameters
from tests.reobserve_papers.plants.test_delayed_plants import SINE

Array = NDArray[np.float64]


def job(**changes: Any) -> keys.Job:
    """The record of Fig. 2, with some values of the plant changed."""
    settings = fixed_parameters("delay", seed=3).settings("plant", "sine")
    stated = read_job(keys.Parameters, settings)
    return replace(stated, plant=replace(stated.plant, **changes))


def record(**changes: Any) -> Series:
    return plant.simulate(job(**changes))


@pytest.mark.parametrize(
    ("reading", "amplitude"), [("swing", 1.0), ("wrapped", np.pi), ("turns", 51.866)]
)
def test_noise_amplitude_follows_the_chosen_variant(reading: str, amplitude: float) -> None:
    states, u = record()["state"][:, 0], record()["input"]
    stated = job(noise_amplitude=reading).plant
    found = noise.deviations(stated, 0.05, states, u)
    assert found == pytest.approx((0.05 * amplitude, 0.05), rel=1e-3)
    peak = noise.deviations(replace(stated, noise_size="peak"), 0.05, states, u)
    assert peak == pytest.approx(np.divide(found, 3))


def test_noise_is_held_with_the_stated_deviation() -> None:
    series = record(noise_period=0.02)
    for name, clean in (("measured", series["state"][:, 0]), ("measured_input", series["input"])):
        off = series[name] - clean
        held = off[:-1].reshape(-1, 8)
        assert np.ptp(held, axis=1) == pytest.approx(0, abs=1e-12)
        assert np.std(held[:, 0]) == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize(("period", "variance"), [(1e-3, 1 / 5), (2e-3, 9 / 25)])
def test_noise_changing_within_a_step_enters_as_its_mean(period: float, variance: float) -> None:
    """The mean over 5 ms of five numbers, or of three of which one counts half.

    A differentiator reads single numbers.
    """
    stated = job(noise_period=period).plant
    value, before, read = noise.drawn(stated, random_stream(1, "noise"), 40_001)
    assert np.array_equal(value[:-1], before[1:])
    assert np.array_equal(value[:-1:2], value[1::2])
    assert np.std(value) == pytest.approx(np.sqrt(variance), rel=0.02)
    assert np.std(read) == pytest.approx(1, rel=0.02)
    fast = random_stream(1, "noise").standard_normal(1000)
    assert read[:300] == pytest.approx(fast[np.floor(2.5e-3 * np.arange(300) / period).astype(int)])
    first = fast[:5].mean() if period == 1e-3 else fast[:3] @ [0.4, 0.4, 0.2]
    assert value[0] == pytest.approx(first)


def test_slower_noise_is_held_over_several_samples() -> None:
    series = record(noise_period=5e-3)
    assert "read_input" not in series.channels
    fast = record(noise_period=1e-3)
    assert np.std(fast["read_input"] - fast["input"]) == pytest.approx(0.05, rel=0.02)


def test_applied_input_noise_reaches_the_pendulum() -> None:
    """Delayed, and with no effect before t = tau."""
    clean, noisy = record(), record(noisy_input="applied")
    assert np.array_equal(clean["measured_input"], noisy["measured_input"])
    apart = np.abs(clean["state"] - noisy["state"]).max(axis=1)
    first = round(0.6 / clean.step)
    assert np.all(apart[: first + 1] == 0)
    assert np.all(apart[first + 2 : first + 40] > 0)


def test_held_noise_on_a_signal_equals_the_noise_of_its_samples() -> None:
    added = np.array([0.3, 0.3, -0.1, -0.1])
    control = noise.on_top(SINE, added, 0.1)
    time = np.array([-0.5, 0.0, 0.05, 0.15, 0.2, 0.39])
    off = control(time)[:, 0] - SINE(time)[:, 0]
    assert off == pytest.approx([0, 0.3, 0.3, 0.3, -0.1, -0.1])


@pytest.mark.parametrize("name", ["ramp", "sine"])
def test_input_without_a_past_is_unchanged_from_zero_on(name: str) -> None:
    settings = fixed_parameters("delay").settings("plant", name)
    stated = read_job(keys.Parameters, settings)
    cut = replace(stated, scenario=replace(stated.scenario, past="zero"))
    whole, late = plant.simulate(stated), plant.simulate(cut)
    for channel in ("input", "input_derivatives"):
        assert np.array_equal(whole[channel], late[channel])
    before = whole.time < 1.5  # earlier by the largest delay, that is before t = 0
    assert np.all(late["past_input"][before] == 0)
    assert np.array_equal(whole["past_input"][~before], late["past_input"][~before])
    arrives = round(0.6 / whole.step)
    assert np.all(late["delayed_input"][:arrives] == 0)
    assert np.array_equal(whole["delayed_input"][arrives:], late["delayed_input"][arrives:])

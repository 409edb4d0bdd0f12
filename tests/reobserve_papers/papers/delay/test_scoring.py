"""Peaks around singular instants, and the study of the gain against Fig. 2."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve_papers.metrics.metrics import lookup
from reobserve_papers.papers.delay.scoring import half_periods, peaks, ripple
from reobserve_papers.signals.series import Channel, Series
from reobserve_papers.steps.evaluation import Evaluator
from tests.reobserve_papers.papers import fixed_parameters

TIME = 0.01 * np.arange(6001)
# u' = 0 at 5, 15, 25, ... s, and a jump of the delay at 8 s.
PLANT = Series(
    TIME,
    {"input_derivatives": Channel(np.cos(0.1 * np.pi * TIME)[:, None], "1/s")},
    {"jumps": (8.0,)},
)


def test_scored_half_periods_start_after_the_last_jump() -> None:
    found = [(at, TIME[chosen][0], TIME[chosen][-1]) for at, chosen in half_periods(PLANT, TIME)]
    expected = [(at, at - 5, at + 5) for at in (15.0, 25.0, 35.0, 45.0)]
    assert np.array(found) == pytest.approx(np.array(expected), abs=0.011)
    quick = Series(0.05 * TIME, PLANT.channels, {"jumps": ()})
    instants = [at for at, _ in half_periods(quick, quick.time)]
    assert instants == pytest.approx([0.75, 1.25, 1.75, 2.25])


def test_peaks_have_mean_size_and_mean_distance() -> None:
    """1 to 4, at an instant and 1 to 3 s after the next; values before 10 s do not count."""
    error = np.zeros(len(TIME))
    error[500] = 9.0
    for k in range(4):
        error[1500 + 1100 * k] = (-1.0) ** k * (k + 1)
    size, distance = peaks(PLANT, TIME, error)
    assert size == pytest.approx(2.5)
    assert distance == pytest.approx((0 + 0.2 + 0.4 + 0.6) / 4, abs=2e-3)


def test_no_peaks_without_a_complete_half_period() -> None:
    short = Series(TIME[:1001], {"input_derivatives": Channel(TIME[:1001, None] - 5, "1/s")}, {})
    assert np.isnan(peaks(short, short.time, np.ones(1001))).all()


def test_ripple_is_the_residual_of_a_line_fit() -> None:
    time = np.arange(0.0, 2.0, 0.01)
    assert ripple(time, 3 * time - 1) == pytest.approx(0, abs=1e-12)
    assert ripple(time, 3 * time + 0.1 * np.sin(20 * np.pi * time)) == pytest.approx(0.2, rel=0.03)
    assert np.isnan(ripple(time[:2], time[:2]))


def test_first_study_run_equals_fig_2() -> None:
    """At the rho of Fig. 2 and with its steps; the second run has other noise."""
    study = {"rhos": [2.5], "runs": 2, "sampling_period": 0.005}
    evaluator = Evaluator(fixed_parameters("delay", {"studies": {"tradeoff": study}}))
    rows = evaluator.result("study", "tradeoff")
    own = lookup(evaluator.figure("fig2").numbers)
    first = [row for row in rows if row["run"] == 1]
    assert len(first) == 4 + 4 + 2 + 3 + 3 + 2
    for row in first:
        assert row["value"] == own[row["observer"], row["quantity"]]
    again = [row["value"] for row in rows if row["run"] == 2]
    assert not np.isclose(again, [row["value"] for row in first]).any()
    means = lookup(evaluator.figure("fig2_tradeoff").numbers)
    found = means.at("order2_noise", "rms_delay_error", noise_rho=2.5)
    both = [
        row["value"]
        for row in rows
        if row["run"] and (row["observer"], row["quantity"]) == ("order2_noise", "rms_delay_error")
    ]
    assert found == pytest.approx(np.mean(both))

"""Runs of the theory under other faults, noise and inertia, against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.papers.ilo import keys, theory_runs
from reobserve.papers.ilo.metrics import LEARNING
from reobserve.papers.ilo.observe import estimate
from reobserve.papers.ilo.plant import simulate
from reobserve.papers.ilo.scoring import Errors
from reobserve.replication.metrics.metrics import Numbers
from tests.papers.ilo.conftest import Measure


def random_fault(settings: dict[str, Any], kind: Any) -> list[dict[str, Any]]:
    mine = keys.Theory(**settings["theory"])
    begins, values = theory_runs.random_values(mine, settings["plant"]["horizon"])
    assert begins == pytest.approx(0.5 * np.arange(1, 20))
    return list(kind(mine, begins, values, 1))


def test_error_between_jumps_is_a_sum_of_step_responses(
    settings: dict[str, Any], measure: Measure
) -> None:
    # With K1 = I and v learning at every instant the ripple of each jump outlasts the next ones.
    # The other variants are made slow and coarse here, so that this is the best.
    observer = settings["observers"]["continuous"]
    slow = {"K2": 5.0, "damping": 1000.0}
    interval = {"intervals": [observer["update_interval"], 0.03]}
    step = {"kind": "constant", "axis": 1, "from": 0.5, "size": 1.0}
    record = simulate({"plant": settings["plant"], "scenario": {"fault": [step]}, "seed": 0})
    run = estimate({"plant": settings["plant"], "observer": observer}, record)
    unit = Errors.of(record, run, 0)
    terms = random_fault(settings, theory_runs.held)
    assert all(term["until"] == term["from"] + 0.5 for term in terms)
    sizes = np.array([term["size"] for term in terms])
    start, end, fault = (np.zeros(len(unit.time)) for _ in range(3))
    hold = round(0.5 / run.step)
    for k, jump in enumerate(np.diff(sizes, prepend=0.0)):
        kept = slice(k * hold, None)
        for total, one in ((start, unit.start), (end, unit.end), (fault, unit.fault_start)):
            total[kept] += jump * one[: len(one) - k * hold]
    # Scores start a second after the first jump, and 0.2 s after each.
    scored = (unit.time > 1.5 - 1e-9) & (np.mod(unit.time + 1e-9, 0.5) > 0.2)
    energy = np.mean((start**2 + start * end + end**2)[scored]) / 3
    expected = np.sqrt(energy / np.mean(fault[scored] ** 2))
    over = {"observers": {"sampled": slow, "forgetting": slow}, "theory": interval}
    found = measure("_under_random_faults", over)["best", "relative_error_between_jumps"]
    assert found == pytest.approx(expected, rel=1e-3)


def test_a_straight_line_is_followed_at_a_distance(
    settings: dict[str, Any], measure: Measure
) -> None:
    # Once settled, e = tau Lambda / K2 times the slope for the sampled variant, plus half an
    # interval for the hold less the half by which the sum leads.
    terms = random_fault(settings, theory_runs.lines)
    slopes = np.array([term["slope"] for term in terms if term["kind"] == "ramp"])
    starts = np.array([term["size"] for term in terms if term["kind"] == "constant"])
    assert starts[0] == 0
    ends = starts + 0.5 * slopes
    assert ends[:-1] == pytest.approx(starts[1:])
    power = np.mean((starts**2 + starts * ends + ends**2)[2:]) / 3
    mine, slow = settings["observers"]["sampled"], {"K2": 5.0, "damping": 1000.0}
    lag = mine["update_interval"] * mine["damping"] / mine["K2"]
    over = {"observers": {"continuous": slow, "forgetting": slow}}
    found = measure("_under_random_faults", over)
    error = found["best", "relative_error_under_random_fault"]
    assert error == pytest.approx(lag * np.sqrt(np.mean(slopes[2:] ** 2) / power), rel=0.03)


def test_error_under_noise_is_that_of_the_noise_and_of_the_fault(
    settings: dict[str, Any], found: Numbers
) -> None:
    # Noise is drawn at each update: its part is the noise gain times 1e-5 rad/s, in the mean.
    fault = settings["theory"]["aperiodic"]
    record = simulate({"plant": settings["plant"], "scenario": {"fault": fault}, "seed": 0})
    size = np.sqrt(np.mean(record["fault"][record.time > 6.0, 0] ** 2))
    noise = settings["theory"]["noise"] * found.at("sampled", "noise_gain", multiple=1) / size
    error = found["sampled", "relative_error_under_noise"]
    assert error == pytest.approx(np.hypot(noise, 0.0126), rel=0.05)


def test_a_wrong_inertia_shows_as_a_torque(measure: Measure, changed: dict[str, Any]) -> None:
    # J (1 + x) w' - ... = B u + v: at rest w' = (B u + u_f) / J, so that v has x (B u + u_f) more.
    changed["plant"] |= {"initial_rate": [0.0, 0.0, 0.0], "inertia": np.diag([20.0] * 3).tolist()}
    changed["observers"]["sampled"]["initial_rate"] = [0.0, 0.0, 0.0]
    changed["theory"]["aperiodic"] = [{"kind": "constant", "axis": 1, "from": 1.0, "size": 0.5}]
    changed["plant"]["control"] = [{"kind": "constant", "axis": 1, "from": 0.0, "size": 0.25}]
    for x in (0.1, -0.2):
        numbers = measure("_with_wrong_inertia", {"theory": {"inertia_error": x}}, changed)
        error = numbers[LEARNING, "relative_error_with_wrong_inertia"]
        assert error == pytest.approx(abs(x) * 0.75 / 0.5, rel=1e-3)


def test_an_integrator_is_damped_as_the_parameter_file_asks(
    settings: dict[str, Any], found: Numbers
) -> None:
    # For slow faults e = Lambda / Gamma u_f', Lambda = 2 (Gamma J)^(1/2).
    slope = 2 * np.sqrt(36.0 / settings["theory"]["adaptive_gain"])
    terms = [term for term in settings["theory"]["aperiodic"] if term["kind"] == "sine"]
    slopes = sum((term["amplitude"] * term["frequency"]) ** 2 for term in terms)
    size = sum(term["amplitude"] ** 2 for term in terms)
    expected = slope * np.sqrt(slopes / size)
    assert found["integral", "relative_error"] == pytest.approx(expected, rel=0.2)

"""The delay task: records against an adaptive integrator, methods on a known delay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from reobserve.core.errors import InputError
from reobserve.tuning.task import Array, Condition, Estimates, TaskRecord
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.bench.tasks.delay import Plant, simulate
from tests import ROOT

PATH = ROOT / "config/bench/delay.yaml"
TASK = PackagedTask.read(PATH)
PLANT: Plant = TASK.plant_in("nominal")
NOMINAL = Condition("as tuned")
QUIET = 1e-9  # negligible noise
T = 0.02


def values_of(found: Array | Estimates) -> Array:
    return found.values if isinstance(found, Estimates) else found


def quiet(classes: list[str], levels: list[float], seed: int, **changed: float) -> TaskRecord:
    stated: Plant = replace(PLANT, noise=QUIET, classes=classes, levels=levels, **changed)  # type: ignore[arg-type]
    return simulate(stated, NOMINAL, seed, T)


@pytest.mark.parametrize("seed", [1, 2])
def test_record_agrees_with_an_adaptive_integrator(seed: int) -> None:
    """With ramps, which are linear between samples, and u from its derivatives."""
    record = quiet(["ramp"], PLANT.levels, seed)
    u = CubicHermiteSpline(record.time, record.inputs[:, 0], record.inputs[:, 1])
    tau = record.truth[:, 0] + PLANT.middle

    def rate(t: float, x: Array) -> Array:
        return np.asarray(-x + u(t - np.interp(t, record.time, tau)))

    first = round(PLANT.bounds[1] / T)
    found = solve_ivp(
        rate, (record.time[first], record.time[-1]), record.measurements[first], "DOP853",
        record.time[first:], rtol=1e-10, atol=1e-10, max_step=0.1,
    )  # fmt: skip
    assert found.y[0] == pytest.approx(record.measurements[first:, 0], abs=1e-6)


def test_inputs_come_with_their_derivatives() -> None:
    record = quiet(["step"], PLANT.levels, 3)
    u, rate, bend = record.inputs.T
    assert np.gradient(u, T, edge_order=2)[1:-1] == pytest.approx(rate[1:-1], abs=2e-3)
    assert np.gradient(rate, T, edge_order=2)[1:-1] == pytest.approx(bend[1:-1], abs=4e-3)
    # Three spectral lines of amplitude 1: u'' <= 2.6^2 + ...; the speed 0.3 only rescales time.
    slow = quiet(["step"], PLANT.levels, 3, speed=0.5)
    assert slow.inputs[::2, 0] == pytest.approx(u[: len(u) // 2 + 1], abs=1e-12)


def test_delay_has_steps_ramps_and_oscillations() -> None:
    for seed in range(1, 9):
        steps = np.diff(quiet(["step"], PLANT.levels, seed).truth[:, 0])
        assert np.count_nonzero(np.abs(steps) > 1e-9) == 3
        ramps = quiet(["ramp"], PLANT.levels, seed).truth[:, 0]
        assert (
            np.count_nonzero(np.abs(np.diff(ramps, 2)) > 1e-9) == 2
        )  # from one third of the record to the next
        swings = quiet(["swing"], PLANT.levels, seed).truth[:, 0]
        width = np.ptp(PLANT.levels)
        assert np.abs(np.diff(swings)).max() <= 0.5 * width * PLANT.swing[1] * T + 1e-9
        whole = simulate(PLANT, NOMINAL, seed, T).truth[:, 0]
        assert np.count_nonzero(np.abs(np.diff(whole)) > 0.5 * width * PLANT.swing[1] * T) <= 1
        for one in (ramps, swings, whole):
            inside = one + PLANT.middle
            assert PLANT.levels[0] <= inside.min()
            assert inside.max() <= PLANT.levels[1]


# Settings that find a constant delay, the speed of the input, and the median and largest error:
# by the errors of Hermite's cubic; of linear interpolation, T^2 u'' / (8 u'); of a parabola through
# costs on a grid of 0.1 s; by the chatter of a relay, M T, while u' does not vanish; and of a
# Taylor series, tau u'' / (2 u') and tau^2 u''' / (6 u') of tau, which are unbounded where u'
# vanishes.
GRID = {"process": 1e-4, "rate": 0.03, "switch": 0.02, "jump": 0.01}
FOUND = {
    "extended_1": ({"rho": 5.0, "threshold": 0.01}, 0.1, 0.1, np.inf),
    "extended_2": ({"rho": 5.0, "threshold": 0.01}, 0.1, 0.005, 0.02),
    "least_squares": ({"covariance": 1000.0, "forgetting": 1.0}, 1.0, 1e-4, 5e-4),
    "adaptive": ({"filter_time": 0.05, "forgetting": 2.0, "rate": 5.0}, 1.0, 5e-5, 2e-4),
    "relay": ({"gain": 0.2, "lag": 0.02}, 1.0, 0.005, 0.025),
    "relay_inverse": ({"gain": 0.3, "lag": 0.02}, 1.0, 0.003, 0.025),
    "ekf": ({"process": 1e-3, "walk": 0.01}, 1.0, 1e-4, 3e-4),
    "imm": ({"process": 0.01, "drift": 0.01, "jump": 0.01}, 1.0, 1e-4, 1e-3),
    "grid": (GRID, 1.0, 2e-3, 5e-3),
    "grid_R": (GRID | {"memory": 2.0}, 1.0, 2e-3, 5e-3),
    "parallel": ({"memory": 1.0}, 1.0, 0.003, 0.01),
}


def test_every_method_has_a_constant_delay_test() -> None:
    assert set(FOUND) == set(TASK.methods)


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("method", FOUND)
def test_methods_find_a_constant_delay(method: str, every: int) -> None:
    settings, speed, median, most = FOUND[method]
    delay = {"imm": 0.8, "grid": 0.625, "grid_R": 0.625}.get(method, 0.63)  # on its grid
    for seed in (1, 2):
        levels = [delay, delay + 1e-12]
        stated = replace(PLANT, noise=QUIET, classes=["step"], levels=levels, speed=speed)
        record = simulate(stated, Condition("", period=every), seed, T)
        values = {**TASK.methods[method].fixed, **settings}
        make = TASK.function(method)
        estimate = values_of(make(stated, values, every * T, 1e-3)(record))
        assert estimate.shape == record.truth.shape
        wrong = np.abs(estimate - record.truth)[record.time > 20.0]
        assert np.median(wrong) < median * every**2
        assert wrong.max() < most * every**2


def late_input(record: TaskRecord, row: int, delay: float) -> float:
    """u in the middle of the period after a row, so late, in straight lines."""
    time, u = record.time, record.inputs[:, 0]
    return float(np.interp(time[row] + T / 2 - delay, time, u))


DECAY, FIRST = np.exp(-T), round(1.5 / T)  # of x in a period; the row that knows 1.5 s of u


def test_extended_filter_agrees_with_a_filter_in_its_plainest_form() -> None:
    record = simulate(replace(PLANT, horizon=9.0), NOMINAL, 4, T)
    y, (least, most) = record.measurements[:, 0], PLANT.bounds
    state, P = np.array([y[FIRST], 0.75]), np.diag([0.03**2, (most - least) ** 2 / 12])
    Q, found = np.diag([0.05, 0.4]) ** 2 * T, []
    for k in range(FIRST, len(y)):
        if k > FIRST:
            tau = min(max(state[1], least), most)
            u, more = (late_input(record, k - 1, tau + d) for d in (0.0, 1e-6))
            F = np.array([[DECAY, (1 - DECAY) * (more - u) / 1e-6], [0.0, 1.0]])
            state = np.array([DECAY * state[0] + (1 - DECAY) * u, tau])
            P = F @ P @ F.T + Q
        K = P[:, 0] / (P[0, 0] + 0.03**2)
        state, P = state + K * (y[k] - state[0]), P - np.outer(K, P[0])
        found.append(min(max(state[1], least), most) - 0.75)
    estimate = values_of(
        TASK.function("ekf")(PLANT, {"process": 0.05, "walk": 0.4}, T, 0.03)(record)
    )
    assert not estimate[:FIRST].any()
    assert estimate[FIRST:, 0] == pytest.approx(np.array(found), abs=1e-5)
    assert np.ptp(found) > 0.5


def test_bank_agrees_with_one_in_its_plainest_form() -> None:
    """Of scalar filters, mixed, predicted, corrected and weighed by their likelihoods."""
    record = simulate(replace(PLANT, horizon=6.0), NOMINAL, 4, T)
    y, delays, R, Q = record.measurements[:, 0], np.linspace(0.0, 1.5, 7), 0.03**2, 0.05**2 * T
    rates = np.full((7, 7), 0.2 / 7)
    for i in range(6):
        rates[i, i + 1] += 0.5 * 3.0
        rates[i + 1, i] += 0.5 * 3.0
    np.fill_diagonal(rates, 0.0)
    chain = expm(T * (rates - np.diag(rates.sum(axis=1))))
    x, P, modes, found = np.full(7, y[FIRST]), np.full(7, R), np.full(7, 1 / 7), []
    for k in range(FIRST, len(y)):
        if k > FIRST:
            weights = chain * modes[:, None]
            modes = weights.sum(axis=0)
            mixing = weights / modes
            mean = x @ mixing
            P = ((P[:, None] + (x[:, None] - mean) ** 2) * mixing).sum(axis=0)
            late = np.array([late_input(record, k - 1, one) for one in delays])
            x, P = DECAY * mean + (1 - DECAY) * late, DECAY**2 * P + Q
        S = P + R
        modes *= np.exp(-0.5 * (y[k] - x) ** 2 / S) / np.sqrt(S)
        modes /= modes.sum()
        x, P = x + P / S * (y[k] - x), P * R / S
        found.append(modes @ delays - 0.75)
    settings = {"process": 0.05, "drift": 3.0, "jump": 0.2, "delays": 7.0}
    estimate = values_of(TASK.function("imm")(PLANT, settings, T, 0.03)(record))
    assert estimate[FIRST:, 0] == pytest.approx(np.array(found), abs=1e-6)
    assert np.ptp(found) > 0.3


def test_parallel_models_agree_with_sums_over_the_past() -> None:
    """Errors squared, weighed by exp(-age / memory); a parabola through the three least costs."""
    record = simulate(replace(PLANT, horizon=6.0), NOMINAL, 4, T)
    y, delays, keep = record.measurements[:, 0], np.linspace(0.0, 1.5, 7), np.exp(-T / 0.4)
    x, costs, found = np.full(7, y[FIRST]), np.zeros(7), []
    for k in range(FIRST, len(y)):
        if k > FIRST:
            late = np.array([late_input(record, k - 1, one) for one in delays])
            x = DECAY * x + (1 - DECAY) * late
        costs = keep * costs + (y[k] - x) ** 2
        best = min(max(int(costs.argmin()), 1), 5)
        bent = np.polyfit([-1.0, 0.0, 1.0], costs[best - 1 : best + 2], 2)
        shift = -bent[1] / (2 * bent[0]) if bent[0] > 1e-12 else 0.0
        found.append(delays[best] + 0.25 * min(max(shift, -1.0), 1.0) - 0.75)
    estimate = values_of(
        TASK.function("parallel")(PLANT, {"memory": 0.4, "delays": 7.0}, T, 0.03)(record)
    )
    assert estimate[FIRST + 5 :, 0] == pytest.approx(np.array(found[5:]), abs=1e-6)
    assert np.ptp(found) > 0.3


def test_unknown_class_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "delay.yaml"
    path.write_text(PATH.read_text().replace("classes: [step]}", "classes: [stop]}"))
    with pytest.raises(InputError, match=r"conditions\.steps\.plant\.classes.*'stop'"):
        PackagedTask.read(path)

"""Leak detectors: statistics, thresholds and scores against known answers."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim, tf2ss
from scipy.stats import chi2, kstest

from reobserve.detection.false_alarms import false_alarm_threshold
from reobserve.observers.kalman import KalmanFilter
from reobserve.tuning.table import Results
from reobserve.tuning.task import Condition
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.bench.plot import detection
from reobserve_papers.bench.tasks import leak
from tests import ROOT

TASK = PackagedTask.read(ROOT / "config/bench/leak.yaml")
PLANT: leak.Plant = TASK.plant_in("nominal")
PERIOD, EXACT = TASK.period, replace(PLANT, disturbance=0.0)
SETTINGS = {"process": 0.007, "share": 0.5}


def filters(plant: leak.Plant, settings: Any) -> tuple[KalmanFilter, KalmanFilter]:
    made = (
        KalmanFilter(leak._model(plant, mode, settings, PERIOD, plant.noise))
        for mode in ("normal", "leakage")
    )
    return next(made), next(made)


def test_healthy_records_follow_the_normal_model() -> None:
    plant = replace(EXACT, noise=1e-12)
    record = leak.simulate(plant, Condition("nominal"), 4, PERIOD)
    system = cont2discrete(tf2ss(plant.normal[0], [1.0, *plant.normal[1]]), PERIOD)
    _, velocity, _ = dlsim(system, record.inputs)
    onset = int(np.argmax(record.truth > 0))
    assert record.measurements[: onset + 1] == pytest.approx(velocity[: onset + 1], abs=1e-8)
    off = np.abs(record.measurements - velocity)[onset + 1 :]
    assert off.max() > 0.1
    for healthy in record.healthy():
        assert healthy.measurements == pytest.approx(velocity, abs=1e-8)
        assert not healthy.truth.any()
    assert record.truth.max() == pytest.approx(record.truth[-1, 0])
    assert plant.share[0] <= record.truth[-1, 0] <= plant.share[1]


def test_healthy_records_have_independent_noise() -> None:
    record = TASK.record("nominal", 4)
    noise = [one.measurements - record.measurements for one in record.healthy()]  # type: ignore[attr-defined]
    before = slice(0, int(np.argmax(record.truth > 0)))
    for one in (*noise, noise[0] - noise[1], noise[1] - noise[2]):
        assert one[before].std() > 1.2 * PLANT.noise  # sqrt 2 of the noise, and the voltages


def test_normalised_innovations_are_chi_squared() -> None:
    size = 20
    settings = {"process": 1e-4, "window": size * PERIOD}
    statistic = leak.power(EXACT, settings, PERIOD, EXACT.noise)
    condition = Condition("nominal")
    found = [
        statistic(one)[2 * size :: size]
        for seed in range(20)
        for one in leak.simulate(EXACT, condition, seed, PERIOD).healthy()
    ]
    assert kstest(np.concatenate(found), chi2(size).cdf).pvalue > 0.01


def test_restart_shortens_delay_for_distant_models() -> None:
    """For the identified leak; with a model of half of it the other sum is larger earlier."""

    def delay(restarts: bool, share: float) -> float:
        settings = {"process": 0.004, "share": share}
        make = partial(leak.sum_of_ratios, restarts)
        run = leak.detector(make, PLANT, settings, PERIOD, PLANT.noise)
        return float(np.mean([leak.score(run, one, 0.0, details=False).error for one in records]))

    records: Any = [TASK.record("nominal", seed) for seed in range(3001, 3033)]
    assert delay(True, 1.0) < 0.6 * delay(False, 1.0)
    assert delay(False, 0.5) < delay(True, 0.5) < delay(True, 1.0)


def test_scores_count_delays_misses_and_false_alarms() -> None:
    record: Any = TASK.record("nominal", 6)
    onset, rows = int(np.argmax(record.truth > 0)), len(record.time)

    def scored(*alarms: int, healthy: int = 0, since: float = 0.0) -> Any:
        def run(one: Any) -> Any:
            rung = alarms if one is record else [7] * (one in record.healthy()[:healthy])
            return np.isin(np.arange(rows), rung).astype(float)[:, None]

        return leak.score(run, record, since)

    assert scored(onset + 5, onset + 90).error == pytest.approx(5 * PERIOD)
    assert scored(onset + 5).lag == pytest.approx(5 * PERIOD)
    assert (scored().error, scored().lag) == (1.0, 1.0)
    assert scored(rows - 1).error == pytest.approx(min(1.0, PERIOD * (rows - 1 - onset)))
    for false in (onset - 3, onset):
        assert scored(false, onset + 5).error == 1.0
        assert np.isnan(scored(false, onset + 5).lag)
        assert scored(false, onset + 5, since=(onset + 1) * PERIOD).error < 0.02
    assert [scored(healthy=k).quantile for k in range(4)] == pytest.approx([0, 1 / 3, 2 / 3, 1])


@pytest.mark.parametrize("method", ["glr", "cusum"])
def test_threshold_comes_from_healthy_records(method: str) -> None:
    """The stated share of these records exceeds it; stored, it is that of the nominal condition."""
    make: Any = {"glr": leak.glr, "cusum": partial(leak.sum_of_ratios, True)}[method]
    level = leak.NOMINAL
    records = leak._healthy(PLANT, level, PERIOD)
    statistic = make(PLANT, SETTINGS, PERIOD, PLANT.noise)
    limit = false_alarm_threshold([statistic(one).max() for one in records], PLANT.rate)
    assert len(records) == PLANT.healthy
    assert sum(statistic(one).max() > limit for one in records) == 2
    for condition in ("nominal", "kept_noise"):
        record = TASK.record(condition, 7)
        run = TASK.make(method, SETTINGS, condition, given=False)
        assert (run(record)[:, 0] == (statistic(record) > limit)).all()
    record = TASK.record("noise", 7)
    renewed = TASK.make(method, SETTINGS, "noise", given=False)(record)[:, 0]
    assert (renewed != (statistic(record) > limit)).any()


def test_figure_shows_delay_over_false_alarm_rate() -> None:
    shares = {"nominal": 0.1, "rate_5": 0.05, "rate_2": 0.02, "rate_50": 0.6}
    cells = [
        {"condition": condition, "method": name, "training": "nominal", "given_noise": "no",
         "quantile": share, "lag": 0.1 / share}
        for name in TASK.methods for condition, share in shares.items()
    ]  # fmt: skip
    axes = detection(Results(TASK, cells, [])).axes[0]
    assert [line.get_label() for line in axes.lines] == [
        TASK.methods[name].label for name in TASK.shown
    ]
    for line in axes.lines:
        expected = [[0.02, 5.0], [0.05, 2.0], [0.6, 0.1 / 0.6]]
        assert line.get_xydata().tolist() == pytest.approx(np.array(expected))

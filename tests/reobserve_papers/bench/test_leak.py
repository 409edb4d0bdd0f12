"""Leak detectors: statistics, thresholds and scores against known answers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim, tf2ss
from scipy.stats import chi2, kstest, uniform

from reobserve.core.errors import InputError
from reobserve.detection.false_alarms import false_alarm_threshold
from reobserve.observers.kalman import KalmanFilter
from reobserve.tuning.results import Results
from reobserve.tuning.task import Array, Condition
from reobserve_papers.bench import leaks
from reobserve_papers.bench.bench_figures import detection
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.bench.tasks import leak
from tests import ROOT

TASK = PackagedTask.read(ROOT / "config/bench/leak.yaml")
PLANT: leaks.Plant = TASK.plant_in("nominal")
PERIOD, EXACT = TASK.period, replace(PLANT, disturbance=0.0)
SETTINGS = {"process": 0.007, "share": 0.5}


def filters(plant: leaks.Plant, settings: Any) -> tuple[KalmanFilter, KalmanFilter]:
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


def test_wrong_model_has_coefficients_that_are_spread_evenly() -> None:
    """By up to the stated share, the same factors for both models."""
    stated, found = [np.array(one) for one in (PLANT.normal, PLANT.leakage)], []
    for seed in range(1, 101):
        normal, faulty = (leaks.actuator(PLANT, one, 0.1, seed) for one in ("normal", "leakage"))
        factors = np.array(normal.coefficients) / stated[0]
        assert np.array(faulty.coefficients) == pytest.approx(factors * stated[1])
        found.append(factors)
    errors = (np.array(found).ravel() - 1.0) / 0.1
    assert kstest(errors, uniform(-1, 2).cdf).pvalue > 0.01
    assert (np.ptp(found, axis=0) > 0.15).all()


def test_threshold_of_a_wrong_model_comes_from_the_plant_at_hand() -> None:
    """Of nineteen records the largest, each with its own input and noise."""
    record: Any = TASK.record("model", 7)
    before = record.before()
    assert len(before) == PLANT.healthy_own == 19
    assert not any(one.truth.any() for one in before)
    own, nominal = (leaks.actuator(PLANT, "normal", wrong, 7) for wrong in (0.1, 0.0))

    def misfit(model: Any, one: Any) -> float:
        system = cont2discrete(tf2ss(model.coefficients[0], [1.0, *model.coefficients[1]]), PERIOD)
        return float(np.std(one.measurements - dlsim(system, one.inputs)[1]))

    assert all(misfit(own, one) < 0.7 * misfit(nominal, one) for one in before)
    assert len({one.inputs.tobytes() for one in before}) == 19
    make: Any = partial(leak.sum_of_ratios, True)
    statistic = make(PLANT, SETTINGS, PERIOD, PLANT.noise)
    limit = max(statistic(one).max() for one in before)
    run: Any = TASK.make("cusum", SETTINGS, "model", given=False)
    assert (run(record)[:, 0] == (statistic(record) > limit)).all()
    assert leak.score(run, record, 0.0).redrawn == ()
    kept: Any = TASK.make("cusum", SETTINGS, "kept_model", given=False)
    nominal_limit = run_limit("cusum", make)
    assert (kept(record)[:, 0] == (statistic(record) > nominal_limit)).all()


def run_limit(method: str, make: Any) -> float:
    statistic = make(PLANT, SETTINGS, PERIOD, PLANT.noise)
    healthy = leaks.healthy_records(PLANT, leak.NOMINAL, PERIOD)
    return false_alarm_threshold([statistic(one).max() for one in healthy], PLANT.rate)


def test_false_alarms_are_as_rare_with_a_wrong_model() -> None:
    """One in twenty of each plant's records: of 144 three standard deviations are 5.4 %, more as
    plants differ.
    """
    run: Any = TASK.make("cusum", SETTINGS, "model", given=False)
    found = [
        leak.score(run, TASK.record("model", 3001 + k), 0.0).quantile  # type: ignore[arg-type]
        for k in range(48)
    ]
    assert 0.0 < np.mean(found) < 0.12


def test_redrawn_delays_vary_with_the_healthy_records() -> None:
    """Each is the delay for the threshold of records that are drawn again."""
    run: Any = TASK.make("glr", SETTINGS, "nominal", given=False)
    statistic = leak.glr(PLANT, SETTINGS, PERIOD, PLANT.noise)
    healthy = leaks.healthy_records(PLANT, leak.NOMINAL, PERIOD)
    limits = np.sort([statistic(one).max() for one in healthy])[-15:]
    several = 0
    for seed in range(9, 21):
        record: Any = TASK.record("nominal", seed)
        onset, values = int(np.argmax(record.truth > 0)), statistic(record)
        firsts = [int(np.argmax(values > one)) - onset for one in limits if (values > one).any()]
        delays = {round(PERIOD * one, 9) if one > 0 else 1.0 for one in firsts}
        found = leak.score(run, record, 0.0)
        assert len(found.redrawn) == leak.REDRAWN
        assert {round(one, 9) for one in found.redrawn} <= delays | {1.0}
        several += len(set(found.redrawn)) > 1
    assert several > 3


def test_misses_are_counted_apart_from_early_alarms() -> None:
    record: Any = TASK.record("nominal", 6)
    onset, rows = int(np.argmax(record.truth > 0)), len(record.time)

    def missed(*alarms: int) -> float:
        return leak.score(
            lambda _: np.isin(np.arange(rows), alarms).astype(float)[:, None], record, 0.0
        ).missed

    assert (missed(), missed(onset + 5), missed(onset - 3), missed(rows - 1)) == (1, 0, 0, 1)


def test_period_that_does_not_divide_the_times_of_voltages_is_refused() -> None:
    with pytest.raises(InputError, match=r"period: 0\.008 s must divide 0\.012 s"):
        leak.simulate(PLANT, Condition("four times the period", period=4), 1, PERIOD)


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


def test_models_lie_between_the_stated_ones() -> None:
    """The coefficients, and what a held voltage and a voltage that is white noise make of them."""
    model = leak._model(PLANT, "leakage", {"process": 0.01, "share": 0.4}, PERIOD, 0.02)
    over, under = (
        0.6 * np.array(one) + 0.4 * np.array(other)
        for one, other in zip(PLANT.normal, PLANT.leakage, strict=True)
    )
    A, B, C, _, _ = cont2discrete(tf2ss(over, [1.0, *under]), PERIOD)
    expected = [float((C @ np.linalg.matrix_power(A, k) @ B)[0, 0]) for k in range(40)]
    found = [
        float((model.C @ np.linalg.matrix_power(model.A, k) @ model.B)[0, 0]) for k in range(40)
    ]
    assert found == pytest.approx(expected, rel=1e-6)
    assert np.asarray(model.Q) == pytest.approx(0.01**2 / PERIOD * model.B @ model.B.T)
    assert np.asarray(model.R) == pytest.approx(0.02**2)


SHORT = leak.simulate(
    replace(PLANT, onset=(0.1, 0.15), horizon=0.3), Condition("nominal"), 4, PERIOD
)
NOISE = 0.02


class Plain:
    """A Kalman filter in its plainest form, started at rest."""

    def __init__(self, F: Array, G: Array, H: Array, Q: Array, start: list[float]) -> None:
        self.F, self.G, self.H, self.Q = F, G, H, Q
        self.x, self.P = np.zeros(len(F)), np.diag(start)

    def predict(self, u: float) -> None:
        self.x = self.F @ self.x + self.G * u
        self.P = self.F @ self.P @ self.F.T + self.Q

    def correct(self, y: float) -> float:
        """The logarithm of the likelihood, without its constant."""
        S, e = float(self.H @ self.P @ self.H) + NOISE**2, y - float(self.H @ self.x)
        K = self.P @ self.H / S
        self.x, self.P = self.x + K * e, self.P - np.outer(K, self.H @ self.P)
        return -0.5 * (e * e / S + math.log(S))


def plain(mode: str, settings: dict[str, float]) -> Plain:
    one = leak._model(PLANT, mode, settings, PERIOD, NOISE)
    A, B, C, Q = (np.asarray(each) for each in (one.A, one.B, one.C, one.Q))
    return Plain(A, B[:, 0], C[0], Q, [1e-6] * 4)


def statistic(make: Any, settings: dict[str, float]) -> Array:
    return np.asarray(make(PLANT, settings, PERIOD, NOISE)(SHORT))


def test_bank_agrees_with_one_in_its_plainest_form() -> None:
    settings = {"process": 0.01, "share": 0.5, "leave": 10.0}
    bank = [plain(mode, settings) for mode in ("normal", "friction", "leakage")]
    stay = math.exp(-10.0 * PERIOD)
    chain = np.full((3, 3), (1 - stay) / 2) + (stay - (1 - stay) / 2) * np.eye(3)
    modes, found = np.array([1.0, 0.0, 0.0]), []
    for k, y in enumerate(SHORT.measurements[:, 0]):
        if k:
            weights = chain * modes[:, None]
            modes = weights.sum(axis=0)
            x, P = np.array([one.x for one in bank]), np.array([one.P for one in bank])
            for one, share in zip(bank, (weights / modes).T, strict=True):
                one.x = share @ x
                off = x - one.x
                one.P = np.tensordot(share, P + off[:, :, None] * off[:, None, :], 1)
                one.predict(float(SHORT.inputs[k - 1, 0]))
        logs = np.array([one.correct(float(y)) for one in bank])
        modes = modes * np.exp(logs - logs.max())
        modes = np.maximum(modes / modes.sum(), math.exp(-700.0))
        found.append(math.log(modes[1] + modes[2]) - math.log(modes[0]))
    odds = statistic(partial(leak.bank, "kalman"), settings)
    assert odds[1:] == pytest.approx(np.array(found[1:]), abs=1e-6)
    assert np.ptp(odds[1:]) > 5.0


def test_lost_voltage_agrees_with_a_filter_in_its_plainest_form() -> None:
    one = plain("normal", {"process": 0.01})
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[:4, 4], whole[4, 4] = one.F, one.G, 1.0
    Q = np.zeros((5, 5))
    Q[:4, :4], Q[4, 4] = one.Q, 2.0**2 * PERIOD
    watch = Plain(whole, np.r_[one.G, 0.0], np.r_[one.H, 0.0], Q, [*[1e-6] * 4, 0.0])
    lost, mean = [], 0.0
    for k, y in enumerate(SHORT.measurements[:, 0]):
        if k:
            watch.predict(float(SHORT.inputs[k - 1, 0]))
        watch.correct(float(y))
        if k:
            keep = math.exp(-PERIOD / 0.03)
            mean = keep * mean - (1 - keep) * watch.x[4] * SHORT.inputs[k - 1, 0]
        lost.append(mean)
    found = statistic(leak.augmented, {"process": 0.01, "walk": 2.0, "lag": 0.03})
    assert found == pytest.approx(np.array(lost), abs=1e-8)
    assert np.abs(found).max() > 0.05


def test_cumulative_sum_is_that_of_likelihoods() -> None:
    settings = {"process": 0.01, "share": 0.5}
    pair, total, found = [plain(mode, settings) for mode in ("normal", "leakage")], 0.0, []
    for k, y in enumerate(SHORT.measurements[:, 0]):
        if k:
            for one in pair:
                one.predict(float(SHORT.inputs[k - 1, 0]))
        before, after = (one.correct(float(y)) for one in pair)
        total = max(0.0, total + after - before)
        found.append(total)
    sums = statistic(partial(leak.sum_of_ratios, False), settings)
    assert sums == pytest.approx(np.array(found), abs=1e-6)
    assert sums.max() > 1.0


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
    records = leaks.healthy_records(PLANT, level, PERIOD)
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

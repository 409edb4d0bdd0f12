"""Results of the tasks of the bench, sentences with their checks over whole columns."""

from __future__ import annotations

from docs.generate.bench import Bench, extent
from docs.generate.decisions import ALONE, BANKS, wrapped


def _bullets(*sentences: str) -> str:
    return "\n".join(["", *(wrapped(one, "- ") for one in sentences), ""])


def of_body(body: Bench) -> str:
    """Fault torque of a rigid body."""
    for one in body.results.task.table:
        found = body.near(one)
        assert one == "drifts" or all(label.startswith("FaultBank") for label in found), one
    rest, poor = body.rest("nominal", *BANKS), ("filtered_difference", "levant")
    assert {one["method"] for one in rest[-2:]} == set(poor)
    assert body.rest("noise")[-1]["method"] == "fault_bank"
    others = [one["method"] for one in rest if one["method"] != "with_a_rate"]
    blind = body.rest("noise_10", "fault_bank_R", "random_walk_R", given=False)
    assert blind[0]["method"] == "levant"
    return _bullets(
        "**Unless faults drift, banks are best**: no other causal method may be within 5 % of the "
        f"best. As tuned, banks have {extent(map(body, BANKS), 3)}, others "
        f"{extent((one['error'] for one in rest[:-2]), 3)}, a filtered difference and a "
        f"differentiator {extent(map(body, poor), 3)}.",
        "**A bank takes noise for jumps**: with three times the noise its error is "
        f"{body('fault_bank', 'noise'):.3f}, the largest; given R "
        f"{body('fault_bank', 'noise', given=True):.3f}, estimating it "
        f"{body('fault_bank_R', 'noise'):.3f}. With ten times the noise, of methods that do "
        f"neither, the differentiator is best, with {blind[0]['error']:.2f}; others have "
        f"{blind[1]['error']:.2f} or more.",
        f"**A filter with a rate** has {body('with_a_rate', 'drifts'):.3f} where faults drift, a "
        f"random walk {body('random_walk', 'drifts'):.3f}; where faults jump they have "
        f"{body('with_a_rate', 'jumps'):.3f} and {body('random_walk', 'jumps'):.3f}.",
        f"**Latency** as tuned: banks {body.late(*BANKS)} ms, the filter with a rate "
        f"{body.late('with_a_rate')} ms, other causal methods {body.late(*others)} ms.",
    )


def of_motor(motor: Bench) -> str:
    """Actuator and sensor fault of a motor."""
    near = {one: motor.near(one) for one in motor.results.task.table}
    for one, found in near.items():
        assert one == "drifts" or all(label.startswith("FaultBank") for label in found), one
    rest = motor.rest("nominal", *BANKS)
    own = [one["error"] for one in rest if one["training"] == "paper"]
    tuned = [one["error"] for one in rest if one["training"] != "paper"]
    assert own
    assert min(own) > max(tuned)
    nees, free = motor.nees(), "AugmentedKalmanFilter"
    return _bullets(
        "**Unless all faults drift, banks are best**, as above. With three times the noise a "
        f"bank has {motor('fault_bank', 'noise'):.3f}, given R "
        f"{motor('fault_bank', 'noise', given=True):.3f}, estimating it "
        f"{motor('fault_bank_R', 'noise'):.3f}. As tuned, other causal methods have "
        f"{extent(tuned, 3)}, with the paper's settings {extent(own, 3)}.",
        f"**The inverted model** with two low-passes has {motor('inverted'):.3f}. An unknown-input "
        "filter is the same here, as there are as many faults as measurements.",
        "**Stated disturbances make the variance right, not the error small**: NEES is "
        f"{nees[f'{free}, disturbances stated']:.1f} in place of {nees[free]:.1f}, the error "
        f"{motor('random_walk_stated'):.3f} in place of {motor('random_walk'):.3f}.",
        f"**Latency** as tuned: a bank {motor.late('fault_bank')} ms, "
        f"{motor.late('fault_bank_R')} if it estimates R, other tuned causal methods "
        f"{motor.late(*(one['method'] for one in rest))} ms.",
    )


def of_leak(leak: Bench) -> str:
    """Detection of a leak."""
    paper = "IMM of SVSF, the paper's settings"
    undecided = [one for one in leak.column("nominal") if one != paper]
    assert leak.within("nominal") == {"yes": [], "no": [paper], "undecided": undecided}
    leak.check_all(lambda one: one["missed"] < 0.05, "nominal", but=[paper])
    delays = [one["lag"] for name, one in leak.column("nominal").items() if name != paper]
    leak.check_all(lambda one: one["quantile"] == 1, "kept_noise", given=False)
    kept = leak.shares("quantile", "kept_noise", given=True)
    voltage = kept.pop("AugmentedKalmanFilter, lost voltage, given R")
    given = leak.shares("missed", "noise", given=True)
    frozen = leak.shares("missed", "noise", given=False)
    assert all(given[f"{one}, given R"] < frozen[one] for one in undecided)
    wrong = leak.shares("missed", "model")
    alone, _ = wrong.pop(ALONE), wrong.pop(paper)
    mixed = leak.tuned_again("missed", "model", "mixed")
    best = {ALONE, "AugmentedKalmanFilter, lost voltage"}
    assert {label for label, share in mixed.items() if share == 0} == best
    bank = mixed.pop("IMM of Kalman filters")
    others = [share for label, share in mixed.items() if label not in best]
    assert bank < min(others)
    assert len(kept) == 6
    assert voltage > 2 * max(kept.values())
    assert alone < min(wrong.values())
    threshold = "reobserve.detection.false_alarms.false_alarm_threshold"
    return _bullets(
        "**As tuned, nothing is decided**, except that an IMM with the paper's settings is worse. "
        f"Others miss less than 5 % of leaks, with mean delays of {extent(delays)} s.",
        "**Most thresholds survive a change that the filter knows.** Given three times the noise, "
        f"six detectors with the old threshold alarm in {extent(kept.values(), 0)} % of healthy "
        "records. An augmented filter, whose statistic is not normalised, alarms in "
        f"{voltage:.0f} %. If not given the noise, each alarms in all: then set the threshold "
        f"again, with [`false_alarm_threshold`][{threshold}].",
        f"**With new thresholds**, filters that are given the noise miss "
        f"{extent(given.values(), 0)} % of leaks, others {extent(frozen.values(), 0)} %.",
        "**Tuned with models up to 10 % wrong**, the CUSUM and an augmented filter miss no leak, "
        f"an IMM of Kalman filters {bank:.0f} %, others {extent(others, 0)} %.",
    )


def of_oscillator(oscillator: Bench) -> str:
    """State of Van der Pol's oscillator."""
    extended, unscented = "ExtendedKalmanFilter", "UnscentedKalmanFilter"
    for one in oscillator.results.task.table:
        column = oscillator.column(one)
        for label in (label for label in column if label.startswith(unscented)):
            twin = column[label.replace(unscented, extended)]
            assert abs(column[label]["error"] / twin["error"] - 1) < 0.002, (one, label)
    within = oscillator.within("nominal")
    assert oscillator.best("nominal") in (extended, unscented)
    assert "normal form, order 4" in within["yes"]
    assert "normal form, order 0" in within["undecided"]
    blind = oscillator.rest("noise", "ekf_R", "ekf_ab_R", given=False)
    assert (blind[0]["method"], blind[0]["training"]) == ("normal_0", "paper")
    orders = ("normal_0", "normal_2", "normal_4")
    failing = oscillator.results.cell("nominal", "normal_2", "paper")
    assert failing is not None
    return _bullets(
        "**Extended and unscented Kalman filter** differ by less than 0.2 % and are best as tuned. "
        f"The error of a normal form of order 4 is {oscillator.ratio('normal_4')} times as large, "
        f"of a constant gain (order 0) {oscillator.ratio('normal_0')}, undecided.",
        "**With three times the noise** a filter that estimates R has "
        f"{oscillator('ekf_R', 'noise'):.4f}, given R "
        f"{oscillator('ekf', 'noise', given=True):.4f}. Of methods that do neither, order 0 with "
        "the slow poles of the paper's example is best, with "
        f"{blind[0]['error']:.4f}; others have {blind[1]['error']:.4f} or more.",
        "**Tune poles before orders**: tuned, orders 0, 2 and 4 are within "
        f"{oscillator.spread('nominal', *orders):.0f} %. With the poles of the paper's example "
        f"order 0 has {oscillator('normal_0', 'nominal', 'paper'):.3f}, order 4 "
        f"{oscillator('normal_4', 'nominal', 'paper'):.3f}, and order 2 fails in "
        f"{100 * failing['failed']:.0f} % of runs.",
    )


def of_delay(delay: Bench) -> str:
    """Input delay of a scalar system."""
    for one in ("nominal", "slow", "noise", "period", "steps", "noise_10"):
        assert all(label.startswith("GridFilter") for label in delay.near(one)), one
    grid, filtered = "GridFilter, delays and rates", "extended Kalman filter"
    grids = {grid, f"{grid}, R estimated"}
    assert delay.near("swings") == grids | {filtered}
    assert delay.near("slowest") == {grid, filtered}
    for one in ("model", "model_20"):
        found = delay.within(one)
        assert (found["yes"], {*found["undecided"]}) == (["IMM of 16 delays"], grids)
    for condition, training in (("model", "mixed"), ("slowest", "slowest")):
        again = delay.tuned_again("error", condition, training)
        assert set(sorted(again, key=lambda label: again[label])[:2]) == grids
    return _bullets(
        "**A grid of delays and rates is best**, as tuned "
        f"{delay.against('nominal', 'grid', 'grid_R')}. All others are also more than 5 % worse "
        "for slow inputs, at twice the period, and where the delay steps. An extended Kalman "
        f"filter may be as good where it swings ({delay('ekf', 'swings'):.3f} against "
        f"{delay('grid', 'swings'):.3f}) and for the slowest inputs "
        f"({delay('ekf', 'slowest'):.3f} against {delay('grid', 'slowest'):.3f}).",
        f"**With a wrong model** an IMM of 16 delays has {delay('imm', 'model'):.3f}, grids "
        f"{delay('grid', 'model'):.3f} and {delay('grid_R', 'model'):.3f}, undecided. Tuned with "
        f"wrong models, the IMM has {delay('imm', 'model', 'mixed'):.3f}, grids "
        f"{delay('grid', 'model', 'mixed'):.3f} and {delay('grid_R', 'model', 'mixed'):.3f}.",
        f"**A grid needs R**: with three times the noise it has {delay('grid', 'noise'):.2f}, "
        f"given R {delay('grid', 'noise', given=True):.3f}, estimating it "
        f"{delay('grid_R', 'noise'):.3f}; an IMM {delay('imm', 'noise'):.2f}, given R "
        f"{delay('imm', 'noise', given=True):.3f}.",
        "**`ExtendedHighGainObserver`** expands the delayed input in a series. If the delay is up "
        f"to several radians of the input, its error is {delay.ratio('extended_2')} times the best "
        "(order 2); for inputs a tenth as fast "
        f"{delay.ratio('extended_2', 'slowest')} times.",
    )

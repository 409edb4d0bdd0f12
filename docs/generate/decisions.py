"""Which observer when: situations, and what decides across them, with numbers of the bench."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

from docs.generate.bench import Bench, extent
from docs.generate.markdown import table

BANKS = ("fault_bank", "fault_bank_R")
WITH_STATES = ("ekf_ab", "ukf_ab", "ekf_ab_R")
GRIDS = ("grid", "grid_R")
ALONE = "CUSUM, filters never restarted"
KALMANS = "IMM of Kalman filters, given R"

_BANK = "[`FaultBank`][reobserve.observers.fault_bank.FaultBank]"
_SMOOTHER = "[`rts_smoother`][reobserve.observers.smoother.rts_smoother]"
_EXTENDED = "[`ExtendedKalmanFilter`][reobserve.observers.nonlinear_filter.ExtendedKalmanFilter]"
_STATES = (
    "the same on [`with_parameter_states`]"
    "[reobserve.systems.nonlinear.NonlinearModel.with_parameter_states]"
)
_GRID = "[`GridFilter.of_delay`][reobserve.observers.grid_filter.GridFilter.of_delay]"
_NORMAL = "[normal form][reobserve.observers.normal_form.normal_form_observer] of order 4"


def situations(body: Bench, motor: Bench, oscillator: Bench, delay: Bench) -> str:
    """A table: the situation, the observer, and how much larger errors are without it."""
    drifting = [b.rest("drifts", *BANKS)[0] for b in (body, motor)]
    assert all(one["within"] == "undecided" for one in drifting)
    assert drifting[0]["method"] == "with_a_rate"
    assert {"ExtendedKalmanFilter", "UnscentedKalmanFilter"} < oscillator.near("model_5")
    for b in (body, motor):
        smoothed = b.results.cell("drifts", "smoothed")
        assert smoothed is not None
        assert smoothed["ratio_high"] < 1
    wrong = delay.rest("model", *GRIDS)[0]
    assert wrong["method"] == "imm"
    rows = [
        ("Jumping fault torque of a rigid body", _BANK, _next(body, "jumps", *BANKS)),
        ("Jumping fault of a linear plant", _BANK, _next(motor, "jumps", *BANKS)),
        ("Fault of one channel, others healthy", _BANK, _next(motor, "healthy", *BANKS)),
        (
            "Drifting fault", f"{_BANK} or Kalman filter of fault and rate",
            f"undecided: {_between(drifting[0])}",
        ),
        (
            "Drifting fault, the answer may wait", _SMOOTHER,
            f"{_inverse(body, 'smoothed', 'drifts')} (a rigid body)",
        ),
        (
            "Measurement noise unknown or changing", "`noise_memory` of the filter",
            _next(motor, "noise", "fault_bank_R", given=False) + " (noise × 3)",
        ),
        (
            "State of a nonlinear plant", f"{_EXTENDED} or unscented",
            f"{oscillator.ratio('normal_4')} ({_NORMAL})",
        ),
        (
            "The same, parameters wrong by up to 10 %", _STATES,
            _next(oscillator, "model", *WITH_STATES),
        ),
        ("Delay of an input", _GRID, _next(delay, "nominal", *GRIDS)),
        ("The same, model wrong by up to 10 %", f"an IMM of delays, or {_GRID}",
         f"{_between(wrong)} (IMM over grid)"),
    ]  # fmt: skip
    return table(("situation", "observer", "error of the best other"), rows)


def _next(b: Bench, condition: str, *methods: str, given: bool | None = None) -> str:
    """The ratio of the best of all other rows, which is more than 5 % worse, to the best."""
    assert not [one for one in b.rest(condition, *methods, given=given) if one["within"] != "no"]
    return _between(b.rest(condition, *methods, given=given)[0])


def _between(cell: Mapping[str, Any]) -> str:
    low, high = math.floor(100 * cell["ratio_low"]), math.ceil(100 * cell["ratio_high"])
    return f"{cell['ratio']:.2f} [{low / 100:.2f}, {high / 100:.2f}]"


def _inverse(b: Bench, method: str, condition: str) -> str:
    """The ratio of the best causal row to a method."""
    cell = b.results.cell(condition, method)
    assert cell is not None
    names = {"ratio": "ratio", "ratio_low": "ratio_high", "ratio_high": "ratio_low"}
    return _between({one: 1 / cell[other] for one, other in names.items()})


def across(body: Bench, motor: Bench, leak: Bench, oscillator: Bench, delay: Bench) -> str:
    """What holds for several tasks, as a list."""
    said = (
        _noise(body, motor, leak, oscillator, delay),
        _thresholds(leak),
        _misses(leak),
        _variances(body, motor, oscillator, delay),
    )
    return "\n".join(wrapped(one, "- ") for one in said)


def wrapped(text: str, mark: str) -> str:
    """An item of a list, in lines as on pages that are written by hand."""
    filled = textwrap.fill(
        text.replace(" %", "\0%"), 138, initial_indent=mark, subsequent_indent=" " * len(mark),
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return filled.replace("\0", " ")


def _noise(*tasks: Bench) -> str:
    gains = []
    for frozen, given in (pair for b in tasks for pair in b.noises()):
        assert all(given[one] < frozen[one] for one in given)
    for b in tasks:
        frozen, given = b.errors("noise"), b.errors("noise", given=True)
        gains += [100 * (1 - given[one] / frozen[one]) for one in given]
    estimating = [b for b in tasks if b.cost_of_r()]
    assert len(estimating) == 4
    for b in estimating:
        near = b.near("noise", given=False)
        assert near
        assert all("R estimated" in label for label in near), near
    costs = {
        (b.results.task.title, one): max(b.cost_of_r(one))
        for b in estimating
        for one in b.results.task.table
        if one != "noise"
    }
    healthy = sorted(cost for (_, condition), cost in costs.items() if condition == "healthy")
    tuned = max(cost for (_, condition), cost in costs.items() if condition == "nominal")
    most = max(cost for (_, condition), cost in costs.items() if condition != "healthy")
    tenfold = max(max(b.cost_of_r("noise_10", given=True)) for b in estimating)
    return (
        "**Measurement noise.** Give R if you know it or can measure it at rest: with three times "
        f"the noise, the errors of filters and detectors fall by {extent(gains, 0)} %. If R is "
        "unknown or drifts, estimate it (`noise_memory`): with three times the noise, in the four "
        "tasks with such methods, only methods that estimate R or are given it may be within 5 % "
        f"of the best. To estimate R costs up to {tuned:.0f} % as tuned, up to {most:.0f} % in "
        f"other conditions, {healthy[0]:.0f} and {healthy[1]:.0f} % on healthy channels, and with "
        f"ten times the noise up to {tenfold:.0f} % against giving R."
    )


def _thresholds(leak: Bench) -> str:
    kept = extent(leak.shares("quantile", "kept_model").values(), 0)
    return (
        "**Thresholds.** Set them with healthy records of your plant and the model in use. With "
        f"thresholds from a right model, tuned detectors alarm in {kept} % of healthy records of "
        "plants whose model is wrong."
    )


def _misses(leak: Bench) -> str:
    for one in ("noise", "model"):
        column, best = leak.column(one), leak.best(one, "lag")
        assert best.startswith(ALONE), one
        assert column[best]["missed"] == 0, one
    given, wrong = leak.shares("missed", "noise", given=True), leak.shares("missed", "model")
    friction, small = leak.shares("missed", "friction"), leak.shares("missed", "small")
    assert wrong.pop(ALONE) == given.pop(f"{ALONE}, given R") == given.pop(KALMANS) == 0
    leak.check_all(
        lambda one: one["missed"] == 0, "nominal", but=["IMM of SVSF, the paper's settings"]
    )
    few, many = leak.column("rate_2"), leak.column("rate_10")
    faster = extent((100 * (1 - many[one]["lag"] / few[one]["lag"]) for one in few), 0)
    return (
        "**A miss or a late alarm.** If a miss costs more, take a CUSUM of filters that are never "
        "restarted. It has the shortest mean delay and misses no leak, given R at three times the "
        f"noise (others but an IMM of Kalman filters {extent(given.values(), 0)} %) and with a "
        f"wrong model (others {extent(wrong.values(), 0)} %). It misses {friction[ALONE]:.0f} % of "
        "frictions, for which it has no model. As tuned, no tuned method misses a leak; of leaks "
        f"of 10 to 30 % each misses {extent(small.values(), 0)} %. If 10 in place of 2.5 % of "
        f"healthy records may alarm, mean delays fall by {faster} %."
    )


def _variances(body: Bench, motor: Bench, oscillator: Bench, delay: Bench) -> str:
    def of(b: Bench, holds: Callable[[str], bool]) -> str:
        return extent((nees for label, nees in b.nees().items() if holds(label)), 1)

    of_delay = delay.nees()
    assert set(of_delay) == {
        "GridFilter, delays and rates", "GridFilter, delays and rates, R estimated",
        "IMM of 16 delays", "extended Kalman filter",
    }  # fmt: skip

    def bank(label: str) -> bool:
        return label.startswith("FaultBank")

    def other(label: str) -> bool:
        return not bank(label) and "smoothed" not in label

    of_motor, walk = motor.nees(), "AugmentedKalmanFilter"
    blind = [
        nees
        for b in (body, motor, oscillator, delay)
        for label, nees in b.nees("noise").items()
        if "given R" not in label and "R estimated" not in label and "smoothed" not in label
    ]
    return (
        "**Variances.** NEES, the squared error over its variance, is 1 on average if the variance "
        "is right. Accurate methods may be too certain. On the body, NEES is "
        f"{of(body, bank)} for banks and {of(body, other)} for other causal filters; on the motor "
        f"{of_motor['FaultBank']:.1f} for a bank, {of_motor['FaultBank, R estimated']:.1f} if it "
        f"estimates R, {of_motor[walk]:.1f} for a random walk and "
        f"{of_motor[f'{walk}, disturbances stated']:.1f} with stated disturbances; for delays "
        f"{of(delay, lambda one: one.startswith('Grid'))} for grids, "
        f"{of_delay['IMM of 16 delays']:.1f} for an IMM and "
        f"{of_delay['extended Kalman filter']:.0f} for an extended Kalman filter. With three "
        "times the noise, R neither given nor estimated, it is "
        f"{min(blind):.1f} to {max(blind):.0f}."
    )

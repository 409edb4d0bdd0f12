"""What to decide before an observer is chosen, with the numbers of the bench that decide it."""

from __future__ import annotations

import textwrap
from collections.abc import Callable

from docs.generate.bench import Bench, extent
from reobserve.tuning.scoring import PAPER

BANKS = ("fault_bank", "fault_bank_R")
WITH_STATES = ("ekf_ab", "ukf_ab", "ekf_ab_R")
ALONE = "CUSUM, filters never restarted"
KALMANS = "IMM of Kalman filters, given R"


def decisions(body: Bench, motor: Bench, leak: Bench, oscillator: Bench, delay: Bench) -> str:
    """Numbered questions, each with its branches."""
    tasks = (body, motor, leak, oscillator, delay)
    questions = [
        _jumps(body, motor),
        _may_wait(body, motor),
        _noise(*tasks),
        _parameters(oscillator),
        _healthy(body, motor),
        _thresholds(leak),
        _misses(leak),
        _variances(body, motor, oscillator, delay),
    ]
    lines = []
    for number, (question, *branches) in enumerate(questions, 1):
        lines.append(wrapped(question, f"{number}. "))
        lines += [wrapped(one, "    - ") for one in branches]
    return "\n".join(lines)


def wrapped(text: str, mark: str) -> str:
    """An item of a list, in lines as on pages that are written by hand."""
    filled = textwrap.fill(
        text.replace(" %", "\0%"), 138, initial_indent=mark, subsequent_indent=" " * len(mark),
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return filled.replace("\0", " ")


def _jumps(body: Bench, motor: Bench) -> list[str]:
    others = [b.rest("drifts", *BANKS)[0] for b in (body, motor)]
    assert all(one["within"] == "undecided" for one in others)
    return [
        "**Can the fault jump?**",
        "Yes: a [`FaultBank`][reobserve.observers.fault_bank.FaultBank]. Where all faults jump it "
        f"has {body.against('jumps', *BANKS)} of all others but banks on a rigid body, "
        f"{motor.against('jumps', *BANKS)} on a motor.",
        "No, it drifts: this is undecided. On the body a bank has "
        f"{body('fault_bank', 'drifts'):.3f}, the best other {others[0]['error']:.3f}; on the "
        f"motor {motor('fault_bank_R', 'drifts'):.3f} if it estimates R, "
        f"{motor('fault_bank', 'drifts'):.3f} if not, and {others[1]['error']:.3f}.",
    ]


def _may_wait(body: Bench, motor: Bench) -> list[str]:
    def first(b: Bench, condition: str = "nominal") -> float:
        return float(b.rest(condition)[0]["error"])

    for b, better, worse in (
        (body, {"nominal", "noise", "model", "period", "jumps", "drifts"}, {"healthy"}),
        (motor, {"drifts"}, {"jumps", "healthy"}),
    ):
        cells = {one: b.column(one) for one in b.results.task.table}
        late = {one: cell[b.results.task.methods["smoothed"].label] for one, cell in cells.items()}
        assert {one for one, cell in late.items() if cell["ratio_high"] < 1} == better
        assert {one for one, cell in late.items() if cell["ratio_low"] > 1} == worse
    return [
        "**May the answer wait?** Then smooth "
        "([`rts_smoother`][reobserve.observers.smoother.rts_smoother]) what drifts. On the body a "
        f"smoothed random walk has {body('smoothed'):.3f}, the best causal row {first(body):.3f}; "
        "it is worse on healthy axes only. On the motor it is better where faults drift, "
        f"{motor('smoothed', 'drifts'):.3f} against {first(motor, 'drifts'):.3f}, worse than banks "
        f"where they jump, {motor('smoothed', 'jumps'):.3f} against {first(motor, 'jumps'):.3f}, "
        f"and on healthy channels, {motor('smoothed', 'healthy'):.3f} against "
        f"{first(motor, 'healthy'):.3f}; else this is undecided. No bank was smoothed.",
    ]


def _noise(*tasks: Bench) -> list[str]:
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
    return [
        "**Is R known, the covariance of the noise of measurements?**",
        "Yes, or measurable at rest: give it. At three times the noise this lowers the error of "
        f"each filter and detector, by {extent(gains, 0)} %.",
        "No, or it drifts: estimate it (`noise_memory`). At three times the noise, every causal "
        "row that neither is given nor estimates R is more than 5 % worse than the best, and one "
        "that estimates it is not known to be, in all four tasks with such rows. It costs up to "
        f"{tuned:.0f} % as tuned, up to {most:.0f} % in other columns, but {healthy[0]:.0f} and "
        f"{healthy[1]:.0f} % on healthy channels; at ten times the noise, up to {tenfold:.0f} % "
        "against giving R.",
    ]


def _parameters(oscillator: Bench) -> list[str]:
    cost = 100 * (oscillator("ekf_ab") / oscillator("ekf") - 1)
    assert {"ExtendedKalmanFilter", "UnscentedKalmanFilter"} < oscillator.near("model_5")
    return [
        "**Are few parameters wrong, and does the record excite them?** Make them states: on an "
        f"oscillator {oscillator.against('model', *WITH_STATES)} of filters and observers without, "
        f"if wrong by up to 10 %, which these filters know; "
        f"{oscillator.against('model_20', *WITH_STATES)} by up to 20 %. By up to 5 % it is "
        f"undecided, and {cost:.0f} % worse if they are right.",
    ]


def _healthy(body: Bench, motor: Bench) -> list[str]:
    tuned = [one for one in motor.rest("healthy", *BANKS) if one["training"] != PAPER]
    return [
        "**Several faults, or one beside healthy channels?** In both cases a bank: on healthy "
        f"ones it has {body.against('healthy', *BANKS)} (body) and "
        f"{motor.against('healthy', *BANKS)} (motor; {tuned[0]['error']:.4f} of tuned rows, and "
        f"{motor('fault_bank_R', 'healthy'):.4f} if it estimates R); with all faulty "
        f"{body.against('all', *BANKS)} and {motor.against('all', *BANKS)}.",
    ]


def _thresholds(leak: Bench) -> list[str]:
    kept = extent(leak.shares("quantile", "kept_model").values(), 0)
    return [
        "**Whose healthy records set the threshold?** This plant's, with the model in use. With "
        f"thresholds from a right model, tuned detectors alarm in {kept} % of healthy records of "
        "plants whose model is wrong.",
    ]


def _misses(leak: Bench) -> list[str]:
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
    nominal = leak.within("nominal")
    assert (nominal["yes"], nominal["no"]) == ([], ["IMM of SVSF, the paper's settings"])
    return [
        "**What does a miss cost, against a late alarm?**",
        "More: a CUSUM whose filters are never restarted has the shortest mean delay and misses "
        "none of these leaks, given R at three times the noise, as only an IMM of Kalman filters "
        f"does not, either (others {extent(given.values(), 0)} %), and with a wrong model (others "
        f"{extent(wrong.values(), 0)} %). But it misses {friction[ALONE]:.0f} % of frictions, for "
        f"which it has no model. As tuned no tuned row misses any, and of leaks of 10 to 30 % each "
        f"misses {extent(small.values(), 0)} %.",
        "Less: by the geometric mean of delays, which quick alarms decide, nothing is decided as "
        "tuned, but that an IMM with a paper's settings is worse.",
        "Thresholds that 10 instead of 2.5 % of healthy records may exceed shorten mean delays by "
        f"{faster} %.",
    ]


def _variances(body: Bench, motor: Bench, oscillator: Bench, delay: Bench) -> list[str]:
    def of(b: Bench, holds: Callable[[str], bool], condition: str = "nominal") -> str:
        return extent((nees for label, nees in b.nees(condition).items() if holds(label)), 1)

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
    return [
        "**Must the variance be right?** The mean squared error over it (NEES, 1 if right) shows "
        "that accurate rows may be too certain. On the body banks have "
        f"{of(body, bank)}, other causal filters {of(body, other)}; where faults jump "
        f"{of(body, bank, 'jumps')} and {of(body, other, 'jumps')}, where they drift "
        f"{of(body, bank, 'drifts')} and {of(body, other, 'drifts')}. On the motor a bank has "
        f"{of_motor['FaultBank']:.1f}, {of_motor['FaultBank, R estimated']:.1f} if it estimates R; "
        f"a random walk {of_motor[walk]:.1f}, {of_motor[f'{walk}, disturbances stated']:.1f} with "
        "stated disturbances. Of delays grids have "
        f"{of(delay, lambda one: one.startswith('Grid'))}, an IMM "
        f"{of_delay['IMM of 16 delays']:.1f}, an extended Kalman filter "
        f"{of_delay['extended Kalman filter']:.0f}; filters of the oscillator "
        f"{extent(oscillator.nees().values())}. At three times the noise, if neither given nor "
        f"estimated, these are {min(blind):.1f} to {max(blind):.0f}.",
    ]

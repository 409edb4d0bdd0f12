"""What to decide before an observer is chosen, with the numbers of the bench that decide it."""

from __future__ import annotations

import textwrap
from collections.abc import Callable

from docs.generate.bench import Bench, extent

BANKS = ("fault_bank", "fault_bank_R")
WITH_STATES = ("ekf_ab", "ukf_ab", "ekf_ab_R")
ALONE = "CUSUM, filters never restarted"


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

    for one in body.results.task.table:
        assert (body("smoothed", one) < first(body, one)) == (one != "healthy"), one
    assert motor("smoothed", "jumps") > motor("fault_bank_R", "jumps")
    return [
        "**May the answer wait?** Then smooth "
        "([`rts_smoother`][reobserve.observers.smoother.rts_smoother]). On the body a smoothed "
        f"random walk has {body('smoothed'):.3f}, the best causal row {first(body):.3f}; it loses "
        f"on healthy axes only. On the motor it is no bound for banks: {motor('smoothed'):.3f} "
        f"against {first(motor):.3f}, where faults jump {motor('smoothed', 'jumps'):.3f} against "
        f"{first(motor, 'jumps'):.3f}.",
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
    worst = max(costs, key=lambda one: costs[one])
    assert worst == (tasks[1].results.task.title, "healthy"), worst
    tuned = max(cost for (_, condition), cost in costs.items() if condition == "nominal")
    tenfold = max(max(b.cost_of_r("noise_10", given=True)) for b in estimating)
    return [
        "**Is R known?**",
        "Yes, or measurable at rest: give it. At three times the noise this lowers the error of "
        f"each filter and detector, by {extent(gains, 0)} %.",
        "No, or it drifts: estimate it (`noise_memory`). At three times the noise, every causal "
        "row that neither is given nor estimates R is more than 5 % worse than the best, and one "
        "that estimates it is not known to be, in all four tasks with such rows. It costs up to "
        f"{tuned:.0f} % as tuned, but {costs[worst]:.0f} % on healthy channels of the motor; at "
        f"ten times the noise, up to {tenfold:.0f} % against giving R.",
    ]


def _parameters(oscillator: Bench) -> list[str]:
    cost = 100 * (oscillator("ekf_ab") / oscillator("ekf") - 1)
    assert {"ExtendedKalmanFilter", "UnscentedKalmanFilter"} < oscillator.near("model_5")
    return [
        "**Are few parameters wrong, and does the record excite them?** Make them states: on an "
        f"oscillator {oscillator.against('model', *WITH_STATES)} of filters and observers without, "
        f"if wrong by up to 10 %; {oscillator.against('model_20', *WITH_STATES)} by up to 20 %. By "
        f"up to 5 % it is undecided, and {cost:.0f} % worse if they are right.",
    ]


def _healthy(body: Bench, motor: Bench) -> list[str]:
    return [
        "**Several faults, or one beside healthy channels?** On healthy ones a bank has "
        f"{body.against('healthy', *BANKS)} (body) and {motor.against('healthy', *BANKS)} (motor, "
        f"but {motor('fault_bank_R', 'healthy'):.4f} if it estimates R); with all faulty "
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
    for one in ("nominal", "noise", "model", "period"):
        column, best = leak.column(one), leak.best(one, "lag")
        assert best.startswith(ALONE), one
        assert column[best]["missed"] == min(cell["missed"] for cell in column.values()), one
    wrong, friction = leak.shares("missed", "model"), leak.shares("missed", "friction")
    alone = wrong.pop(ALONE)
    few, many = leak.column("rate_2"), leak.column("rate_10")
    faster = extent((100 * (1 - many[one]["lag"] / few[one]["lag"]) for one in few), 0)
    nominal = leak.within("nominal")
    assert (nominal["yes"], nominal["no"]) == ([], ["IMM of SVSF, the paper's settings"])
    return [
        "**What does a miss cost, against a late alarm?**",
        "More: on these records a CUSUM whose filters are never restarted has the shortest mean "
        "delay and no more misses than others, if given R and a renewed threshold. With a wrong "
        "model it "
        "misses "
        f"{alone:.0f} % of leaks, others {min(wrong.values()):.0f} % or more; but "
        f"{friction[ALONE]:.0f} % of frictions, for which it has no model.",
        "Less: by the geometric mean of delays, which quick alarms decide, nothing is decided as "
        "tuned, but that an IMM with a paper's settings is worse.",
        f"False alarms in 10 instead of 2.5 % of healthy records shorten mean delays by {faster}"
        " %.",
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

    of_motor = motor.nees()
    return [
        "**Must the variance be right?** The mean squared error over it (NEES, 1 if right) shows "
        f"that accurate rows may be too certain: banks of the body have {of(body, bank)}, where "
        f"faults drift {of(body, bank, 'drifts')}, where they jump {of(body, bank, 'jumps')}; its "
        f"other causal filters {of(body, lambda one: not bank(one) and 'smoothed' not in one)}. "
        f"On the motor a bank has {of_motor['FaultBank']:.1f}, "
        f"{of_motor['FaultBank, R estimated']:.1f} if it estimates R; grids of delays have "
        f"{of(delay, lambda one: one.startswith('Grid'))}, an IMM "
        f"{of_delay['IMM of 16 delays']:.1f}, an extended Kalman filter "
        f"{of_delay['extended Kalman filter']:.0f}; filters of the oscillator "
        f"{extent(oscillator.nees().values())}.",
    ]

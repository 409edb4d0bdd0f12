"""Stage metrics: how well state and delay are estimated, at rest and while the delay moves.

Errors are estimates minus the truth. They count from the ledger's `metrics.start` on, or
`_from_start`; the other windows are the ledger's, too (`late`, `varying`, `ripple`, `away`). A
number at the end of a state's error is its component, at the end of a delay's the segment before
which jump of the delay. `nan` means that it never happens.

In the theory the observer column holds what is judged: the pendulum, the delay, an input, the order
of the expansion, the differentiator with L in its last line (`levant`), random starts
(`projection`), the average delay as an estimate; and errors of runs are without noise.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.papers.delay.record import UNITS
from reobserve.papers.delay.scoring import (
    constant_segments,
    errors,
    near_and_away,
    ripple,
    turned_over_at,
)
from reobserve.replication.metrics.metrics import Metric, Score, scores_of
from reobserve.replication.metrics.responses import root_mean_square, window
from reobserve.replication.parameters.figure_data import FigureData

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "turned_over_at": "when the pendulum first leaves half a turn",
    "largest_angle": "of the pendulum, turns counted",
    "rms_error_<component>": "root mean square error of a state",
    "rms_error_<component>_from_start": "the same from t = 0 on",
    "rms_delay_error": "root mean square error of the delay",
    "rms_delay_error_from_start": "the same from t = 0 on",
    "late_delay_error_<jump>": "largest error in the last seconds before a jump",
    "varying_rms_delay_error": "root mean square error where the delay varies",
    "varying_peak_delay_error": "largest error there",
    "ripple_<jump>": "of the estimate in the last seconds before a jump, its slope taken out",
    "least_delay": "least estimate of the run",
    "greatest_delay": "greatest estimate of the run",
    "off_share": "share of the run in which the gain is switched off",
    "<quantity> <sweep>=<level>": (
        "mean over the runs of a study at one level; of the theory's runs one, without noise"
    ),
    "lipschitz_constant": "of the pendulum's f",
    "drift_over_lipschitz": "largest difference of f over that of the state, over that constant",
    "least_input_gain": "least |G|",
    "greatest_input_gain": "greatest |G|",
    "determinant_error": (
        "of the observability Jacobian from -G u'(t - tau), over its greatest value"
    ),
    "difference_under_constant_input": "largest one of the state between two delays",
    "jumps": "how often the delay jumps",
    "largest_jump": "of the delay",
    "breaks": "instants at which the input or a derivative up to the third is discontinuous",
    "largest_derivative_<order>": "of the input",
    "least_rate": "least |u'|, zero where it changes its sign",
    "singular_instants": "how often u' changes its sign",
    "singular_share": "share of the time with u' = 0",
    "remainder order=<order>": "largest remainder of the expansion (6)",
    "remainder_over_bound order=<order>": "the same over its bound (7), at the worst delay",
    "slow_pole": "of the linear error system, hanging pendulum",
    "slow_pole_upright": "the same, upright",
    "rho_over_proved": "rho over the least one with which the proof of Theorem 2 goes through",
    "relative_rms_error_<order>": (
        "root mean square error of a derivative by the differentiator, over its own"
    ),
    "bound_share": "third derivative of the input over L",
    "noise_exponent_<order>": "power of the noise with which the error of a derivative grows",
    "rms_bias": (
        "of the delay with which the expansion gives u(t - tau), away from singular instants"
    ),
    "relative_rms_bias": "the same over the delay",
    "rms_delay_error_faster rho=<level>": (
        "error with a faster input and a shorter delay over that without, by the ledger's measure"
    ),
    "rms_delay_error_in_noise rho=<level>": (
        "error without noise, and what the noise of Fig. 2 adds by the linear error system"
    ),
    "relative_rms_error_<order>_in_noise": (
        "the same on the noisy input of Fig. 2, by a differentiator of order three"
    ),
    "late_delay_error": "largest error of a constant delay long after the start",
    "late_rate_error": "largest error of the rate there",
    "decay_over_pole": "rate at which the error of a constant delay falls, over the slow pole's",
    "share_at_bounds": "share of runs from random starts that meet a bound of the delay",
    "singular_peak_delay_error": "mean over singular instants of the largest error near them",
    "other_peak_delay_error": "largest error away from them",
    "<which>_peak_delay_error_hardly_off": "the same with a small threshold",
}


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`."""
    plant = data.plant
    if data.job.scenario.model == "pendulum":
        yield Metric("plant", "turned_over_at", turned_over_at(plant), "s")
        yield Metric("plant", "largest_angle", float(np.max(np.abs(plant["state"][:, 0]))), "rad")
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    if data.study:  # the mean over the runs at each level
        coordinates = ("observer", "quantity", "unit", "sweep", "level")
        for (name, quantity, unit, sweep, level), runs in data.study.groups(*coordinates):
            score = quantity, float(np.mean(runs["value"])), unit
            yield Metric.at(name, score, **{sweep: level})


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    plant, estimate, rules = data.plant, data.estimates[name], data.job.metrics
    time, error = estimate.time, errors(plant, estimate)
    later = window(time, rules.start, np.inf)
    if "state" in error:
        units = UNITS[data.job.scenario.model][0].split(", ")
        for when, chosen in (("", later), ("_from_start", slice(None))):
            for i, value in enumerate(root_mean_square(error["state"][chosen])):
                yield f"rms_error_{i + 1}{when}", float(value), units[i]
    if "delay" not in error:
        return
    off = error["delay"]
    yield "rms_delay_error", float(root_mean_square(off[later])), "s"
    yield "rms_delay_error_from_start", float(root_mean_square(off)), "s"
    for number, start, end in constant_segments(plant, rules.late):
        late = off[window(time, start, end)]
        yield f"late_delay_error_{number}", float(np.max(np.abs(late))), "s"
    moving = off[window(time, *rules.varying)]
    yield "varying_rms_delay_error", float(root_mean_square(moving)), "s"
    yield "varying_peak_delay_error", float(np.max(np.abs(moving))), "s"
    near, _ = near_and_away(plant, time, rules.away)
    if near:
        peaks = [float(np.max(np.abs(off[chosen]))) for chosen in near]
        yield "singular_peak_delay_error", float(np.mean(peaks)), "s"
    for number, start, end in constant_segments(plant, rules.ripple):
        chosen = window(time, start, end)
        yield f"ripple_{number}", ripple(time[chosen], estimate["delay"][chosen]), "s"
    yield "least_delay", float(np.min(estimate["delay"])), "s"
    yield "greatest_delay", float(np.max(estimate["delay"])), "s"
    if "off" in estimate.channels:
        yield "off_share", float(np.mean(estimate["off"][1:])), "1"

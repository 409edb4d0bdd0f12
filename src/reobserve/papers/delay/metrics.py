"""Stage metrics: how well state and delay are estimated, at rest and while the delay moves.

Errors are estimates minus the truth. They count from the parameter `metrics.start` on, or
`_from_start`; the other windows are parameters, too (`late`, `varying_from` and `varying_until`,
`radius`, `ripple`). A number at the end of a state's error is its component, at the end of a
delay's the segment before which jump of the delay. `nan` means that it never happens.

In the theory the observer column holds what is computed: the pendulum, the delay, an input, the
order of the expansion, the differentiator with L in its last line (`levant`), random starts
(`starts`, and `projection` for those that meet a bound), the average delay as an estimate; and
errors of runs are without noise.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.papers.delay.scoring import (
    constant_segments,
    errors,
    peaks,
    ripple,
    rms_scores,
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
    "varying_rms_delay_error": "root mean square error of the delay where it varies",
    "varying_rms_error_<component>": "root mean square error of a state where the delay varies",
    "delay_radius": "largest error of the delay once the last jump is forgotten",
    "predicted_delay_radius rho=<level>": "the same by the lag of the linear error system",
    "settled_rms_delay_error": "root mean square error of the delay there",
    "least_radius rho=<level>": (
        "bound of the error of the linear error system with |xi| at the threshold, for the worst "
        "remainder and rate of the delay"
    ),
    "ripple_<jump>": (
        "of the estimate in the last seconds with the gain on before a jump, its slope taken out"
    ),
    "least_delay": "least estimate of the run",
    "greatest_delay": "greatest estimate of the run",
    "off_share": "share of the run in which the gain is switched off",
    "<quantity> <sweep>=<level>": (
        "mean over the runs of a study at one level; of the theory's runs one, without noise"
    ),
    "determinant_error": (
        "of the observability Jacobian from -G u'(t - tau), over its greatest value"
    ),
    "breaks": "instants at which the input or a derivative up to the third is discontinuous",
    "least_rate": "least |u'|, zero where it changes its sign",
    "singular_instants": "how often u' changes its sign",
    "singular_share": "share of the time with u' = 0",
    "remainder order=<order>": "largest remainder of the expansion (6)",
    "slow_pole": "of the linear error system, hanging pendulum",
    "slow_pole_upright": "the same, upright",
    "relative_rms_error_<order>": (
        "root mean square error of a derivative by the differentiator, over its own"
    ),
    "bound_share": "third derivative of the input over L",
    "rms_delay_error_faster rho=<level>": (
        "error with a faster input and a shorter delay over that without, by `theory.accuracy`"
    ),
    "relative_rms_error_<order>_in_noise": (
        "the same on the noisy input of Fig. 2, by a differentiator of order three"
    ),
    "late_delay_error": "largest error of a constant delay long after the start",
    "late_rate_error": "largest error of the rate there",
    "peak_delay_error": (
        "mean of the largest errors of the delay in halves of a period around singular instants"
    ),
    "peak_distance": (
        "mean distance of these from the instant: 0 there, 1 in the middle between two instants"
    ),
    "<which>_hardly_off": "the same with a small threshold",
}


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`."""
    plant = data.plant
    if data.study:  # the mean over the runs at each level
        coordinates = ("observer", "quantity", "unit", "sweep", "level")
        for (name, quantity, unit, sweep, level), runs in data.study.groups(*coordinates):
            score = quantity, float(np.mean(runs["value"])), unit
            yield Metric.at(name, score, **{sweep: level})
        return
    if data.job.scenario.model == "pendulum":
        yield Metric("plant", "turned_over_at", turned_over_at(plant), "s")
        yield Metric("plant", "largest_angle", float(np.max(np.abs(plant["state"][:, 0]))), "rad")
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    plant, estimate, rules = data.plant, data.estimates[name], data.job.metrics
    time, error = estimate.time, errors(plant, estimate)
    yield from rms_scores(rules, data.job.scenario.model, plant, estimate)
    if "delay" not in error:
        return
    off = error["delay"]
    for number, start, end in constant_segments(plant, rules.late):
        late = off[window(time, start, end)]
        yield f"late_delay_error_{number}", float(np.max(np.abs(late))), "s"
    if data.job.scenario.model == "pendulum":
        yield "delay_radius", float(np.max(np.abs(off[window(time, *rules.radius)]))), "s"
        size, distance = peaks(plant, time, off)
        if np.isfinite(size):
            yield "peak_delay_error", size, "s"
            yield "peak_distance", distance, "1"
    else:
        settled = off[window(time, *rules.radius)]
        yield "settled_rms_delay_error", float(root_mean_square(settled)), "s"
    on = estimate["off"] == 0 if "off" in estimate.channels else np.ones(len(time), dtype=bool)
    for number, _, jump in constant_segments(plant, rules.ripple):
        chosen = np.flatnonzero(on & (time < jump - 1e-9))[-round(rules.ripple / estimate.step) :]
        yield f"ripple_{number}", ripple(time[chosen], estimate["delay"][chosen]), "s"
    yield "greatest_delay", float(np.max(estimate["delay"])), "s"
    if "off" in estimate.channels:
        yield "off_share", float(np.mean(estimate["off"][1:])), "1"

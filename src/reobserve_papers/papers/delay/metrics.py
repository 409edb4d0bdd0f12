"""Stage metrics: errors of state and delay, where the delay is constant and where it varies.

Errors are estimates minus true values. They are computed from `metrics.start` on, with the ending
`_from_start` from t = 0 on; the other windows are parameters, too (`late`, `varying_from` and
`varying_until`, `radius`, `ripple`). The number at the end of a state error is the component; at
the end of a delay error it is the segment, which ends with that jump of the delay. `nan` means that
it never happens.

In the theory the column observer names the subject: the pendulum, the delay, an input, the order of
the expansion, the differentiator with L in its last line (`levant`), random initial estimates
(`starts`, and `projection` for the runs that reach a bound), or the average delay as an estimate.
Errors of runs are without noise.

`guess` is a baseline: the delay stays where it begins, the state is the
measurement and its difference quotient; in the theory all stay where they begin. A check of
estimates that it passes tests nothing. `threshold=none` is a sampled observer whose gain is never
switched off.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from reobserve_papers.metrics.metrics import Metric, Score, scores_of
from reobserve_papers.metrics.responses import root_mean_square, scored
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.measured import output
from reobserve_papers.papers.delay.scoring import (
    GUESS,
    constant_segments,
    errors,
    peaks,
    ripple,
    rms_scores,
    turned_over_at,
)
from reobserve_papers.papers.delay.units import UNITS
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.signals.grid import stride
from reobserve_papers.signals.series import Channel, Series

# By layout of a figure: what its numbers are of, beside observers.
SUBJECTS = {
    "states": "guess plant",
    "comparison": "guess",
    "tradeoff": "guess",
    "theory": (
        "guess delay mean_delay levant order_<order> pendulum projection ramp sine starts "
        "state_gain"
    ),
}

# The meaning of each metric, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "turned_over_at": "time at which the pendulum first exceeds half a turn",
    "largest_angle": "largest angle of the pendulum, including full turns",
    "rms_error_<component>": "root mean square error of a state",
    "rms_error_<component>_from_start": "the same from t = 0 on",
    "rms_delay_error": "root mean square error of the delay",
    "rms_delay_error_from_start": "the same from t = 0 on",
    "late_delay_error_<jump>": "largest error of the delay in the last seconds before a jump",
    "varying_rms_delay_error": "root mean square error of the delay where it varies",
    "varying_largest_delay_error": "largest error of the delay where it varies",
    "varying_rms_error_<component>": "root mean square error of a state where the delay varies",
    "delay_radius": "largest error of the delay after the transient of the last jump",
    "predicted_delay_radius rho=<level>": (
        "the same, predicted by the lag of the linear error system"
    ),
    "settled_rms_delay_error": "root mean square error of the delay after that transient",
    "ultimate_bound rho=<level>": (
        "ultimate bound of the error of the linear error system with |xi| at the threshold, for "
        "the worst remainder and rate of the delay"
    ),
    "ripple_<jump>": (
        "peak-to-peak ripple of the estimate, without its mean slope, over the last seconds with "
        "the gain on before a jump"
    ),
    "minimum_delay": "minimum of the delay over the run",
    "maximum_delay": "maximum of the delay or of its estimate over the run",
    "off_share": "share of the run in which the gain is switched off",
    "<quantity> <rho,noise_rho,forgetting,relay_gain>=<level>": (
        "mean over the runs of a study at one level; in the theory a single run without noise"
    ),
    "<quantity> threshold=none": "the same without a threshold, by a sampled observer",
    "jumps": "number of jumps of the delay",
    "determinant_at_turning_points derivatives=<order>": (
        "smallest determinant of the output, its rate and its derivative of this order where the "
        "rate of the input vanishes, over its size"
    ),
    "determinant_error": (
        "difference between the observability Jacobian and -G u'(t - tau), over its maximum"
    ),
    "breaks": "number of instants at which the input or a derivative up to the third is "
    "discontinuous",
    "minimum_rate": "minimum of |u'|, zero if u' changes its sign",
    "singular_instants": "number of sign changes of u'",
    "singular_share": "share of the time with u' = 0",
    "remainder order=<order>": "largest remainder of the expansion (6)",
    "radius_away rho=<level>": (
        "largest norm of the error of states and delay after the transient of the last jump, four "
        "seconds or more from singular instants"
    ),
    "zeros_of_xi": "number of sign changes of xi (10) after the last jump of the delay",
    "rate_of_xi rho=<level>": "largest rate of the estimated xi (Assumption 7) over the run",
    "proof_radius rho=<level>": "the r of (16) by (28) to (31), with the numbers of Fig. 2",
    "lyapunov_rate": (
        "largest V' over rho V for (27) where the projection holds the delay; negative without it"
    ),
    "slow_pole": "slowest pole of the linear error system, hanging pendulum",
    "slow_pole_upright": "the same, upright",
    "relative_rms_error_<order>": (
        "root mean square error of a derivative by the differentiator, over that of the derivative"
    ),
    "bound_share": "maximum of the third derivative of the input over L",
    "noise_exponent_<order>": "exponent of the size of the noise in the error of a derivative",
    "rms_delay_error_faster accuracy=<absolute,relative> rho=<level>": (
        "error with a faster input and a shorter delay over that without both, in seconds or "
        "relative to the delay"
    ),
    "share_of_constant_faster rho=<level>": (
        "error with both over that of the average delay as an estimate"
    ),
    "relative_rms_error_<order>_in_noise": (
        "the same on the noisy input of Fig. 2, by a differentiator of order three"
    ),
    "late_delay_error": "largest error of a constant delay long after the start",
    "late_rate_error": "largest error of the rate at that time",
    "spread_on_the_sine": "largest difference of the final estimates of runs with different starts",
    "peak_delay_error": (
        "mean of the largest errors of the delay in the half periods around singular instants"
    ),
    "peak_distance": (
        "mean distance of these errors from the instant: 0 there, 1 in the middle between two"
    ),
    "<which>_small_threshold": "the same with a small threshold",
}


def measure(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The numbers of a figure (see `MEANINGS`)."""
    plant = data.plant
    if data.study:  # the mean over the runs at each level
        coordinates = ("observer", "quantity", "unit", "sweep", "level")
        for (name, quantity, unit, sweep, level), runs in data.study.groups(*coordinates):
            score = quantity, float(np.mean(runs["value"])), unit
            yield Metric.at(name, score, **{sweep: level})
        if isinstance(data.job.study, keys.Tradeoff):
            for sweep, clean in (("rho", True), ("noise_rho", False)):
                for rho, score in product(data.job.study.rhos, _guess(data, clean=clean)):
                    if "start" not in score[0]:
                        yield Metric.at(GUESS, score, **{sweep: rho})
        return
    if data.job.scenario.model == "pendulum":
        yield Metric("plant", "turned_over_at", turned_over_at(plant), "s")
        yield Metric("plant", "largest_angle", float(np.max(np.abs(plant["state"][:, 0]))), "rad")
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    for name, observer in data.job.observers.items():
        if isinstance(observer, keys.Extended) and observer.model == "lag":
            from reobserve_papers.papers.delay import without_threshold  # it loads numba

            estimate = without_threshold.estimate(data.job, observer, plant)
            for score in _varying(data, estimate):
                yield Metric.at(name, score, threshold="none")
    yield from scores_of(GUESS, _guess(data, clean=False))


def _varying(data: FigureData[keys.Job], estimate: Series) -> Iterator[Score]:
    """Errors of an estimate of the delay where it varies, also after the transient of the jump."""
    rules, off = data.job.metrics, errors(data.plant, estimate)["delay"]
    for score in rms_scores(rules, data.job.scenario.model, data.plant, estimate):
        if score[0].startswith("varying"):
            yield score
    settled = off[scored("metrics.radius", estimate.time, *rules.radius)]
    yield "settled_rms_delay_error", float(root_mean_square(settled)), "s"


def _guess(data: FigureData[keys.Job], *, clean: bool) -> Iterator[Score]:
    """Scores of a baseline.

    It keeps the initial delay of the first extended observer. Its state is the measurement,
    ``clean`` or with its noise, and the difference quotient of that over a sampling period.
    """
    job, plant = data.job, data.plant
    observer = next(body for body in job.observers.values() if isinstance(body, keys.Extended))
    every = 2 * stride(job.plant.step, observer.sampling_period)
    time = plant.time[::every]
    channels = {"delay": Channel(np.full(len(time), observer.initial_delay), "s")}
    if job.scenario.model == "pendulum":
        y = (plant["state"][:, 0] if clean else output(plant)[0])[::every]
        rate = np.diff(y, prepend=y[0]) / observer.sampling_period
        channels["state"] = Channel(np.column_stack([y, rate]), UNITS[job.scenario.model][0])
    estimate = Series(time, channels, plant.events)
    return rms_scores(job.metrics, job.scenario.model, plant, estimate)


def _scores(data: FigureData[keys.Job], name: str) -> Iterator[Score]:
    plant, estimate, rules = data.plant, data.estimates[name], data.job.metrics
    time, error = estimate.time, errors(plant, estimate)
    yield from rms_scores(rules, data.job.scenario.model, plant, estimate)
    if "delay" not in error:
        return
    off = error["delay"]
    for number, start, end in constant_segments(plant, rules.late):
        late = off[scored("metrics.late", time, start, end)]
        yield f"late_delay_error_{number}", float(np.max(np.abs(late))), "s"
    if data.job.scenario.model == "pendulum":
        radius = off[scored("metrics.radius", time, *rules.radius)]
        yield "delay_radius", float(np.max(np.abs(radius))), "s"
        size, distance = peaks(plant, time, off)
        if np.isfinite(size):
            yield "peak_delay_error", size, "s"
            yield "peak_distance", distance, "1"
    else:
        settled = off[scored("metrics.radius", time, *rules.radius)]
        yield "settled_rms_delay_error", float(root_mean_square(settled)), "s"
    on = estimate["off"] == 0 if "off" in estimate.channels else np.ones(len(time), dtype=bool)
    for number, _, jump in constant_segments(plant, rules.ripple):
        chosen = np.flatnonzero(on & (time < jump - 1e-9))[-round(rules.ripple / estimate.step) :]
        yield f"ripple_{number}", ripple(time[chosen], estimate["delay"][chosen]), "s"
    yield "maximum_delay", float(np.max(estimate["delay"])), "s"
    if "off" in estimate.channels:
        yield "off_share", float(np.mean(estimate["off"][1:])), "1"

"""Stage study: ILO and adaptive observers over the integral gain and over measurement noise.

With K1 = I and a small tau an ILO is a proportional-integral adaptive observer with Gamma =
K2 / tau, so Figs 3 and 4 of the paper differ by their gains. The study runs three families of
observers over Gamma on the same fault, then all observers of the parameter file over the noise:

    integral                Kp = 0, Lambda for a stated damping ratio of axis 1
    proportional_integral   Kp = Gamma tau / 2, Lambda and tau of the continuous ILO
    ilo                     K1 and Lambda of the continuous ILO, K2 = Gamma tau

At one noise level it also computes the error in each second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import located
from reobserve.observers.rigid_body_observer import RigidBodyObserver
from reobserve_papers.papers.ilo import keys, study_rows
from reobserve_papers.papers.ilo.observe import observe
from reobserve_papers.papers.ilo.scoring import Errors, scored_errors
from reobserve_papers.papers.ilo.setup import build_observer, pure_integrator
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.grid import noise_hold
from reobserve_papers.signals.random_streams import held_normal, random_stream
from reobserve_papers.signals.series import Channel, Series

Array = NDArray[np.float64]


def run(job: keys.Job, plant: Series) -> list[dict[str, Any]]:
    """Run the study, with one row for each run and the columns of `study_rows.HEADER`.

    ``level`` is Gamma, the noise, or the end of a second [s]. The error of a second is divided by
    the fault in the window of the metrics, as all errors are.
    """
    return [*_gain_rows(job, plant), *_noise_rows(job, plant)]


def _gain_rows(job: keys.Job, plant: Series) -> Iterator[dict[str, Any]]:
    study, observers = job.study, job.observers
    ilo: keys.Continuous = named(observers, "continuous", keys.Continuous)
    for gain in study.integral_gains:
        integral = pure_integrator(job, gain, study.damping_ratio)
        correction = gain * ilo.update_interval
        families: dict[str, keys.Observer] = {
            "integral": integral,
            "proportional_integral": replace(
                integral, proportional_gain=0.5 * correction, observer_gain=ilo.observer_gain
            ),
            "ilo": replace(ilo, K2=correction),
        }
        for name, observer in families.items():
            with located(f"studies.integral_gains, {gain:g}"):
                built = build_observer(job.plant, observer)
                errors = scored_errors(job, plant, _estimate(job, plant, built, observer))
            yield _row("integral_gain", name, gain, 0, errors.relative_root_mean_square)


def _noise_rows(job: keys.Job, plant: Series) -> Iterator[dict[str, Any]]:
    study, observers = job.study, job.observers
    built = {}
    for name, observer in observers.items():
        with located(f"observers.{name}"):
            built[name] = build_observer(job.plant, observer)
    for run in range(study.noise_runs):
        stream = random_stream(job.seed, "ilo", "matching noise", str(run))
        noise = held_normal(
            stream, len(plant.time), noise_hold(job.plant.noise_period, job.plant.step), 3
        )
        for level in study.noise_levels:
            # The same sample for every observer and level, so that only these differ.
            noisy = _with_noise(plant, level, noise)
            for name, observer in observers.items():
                with located(f"observers.{name}"):
                    estimate = _estimate(job, noisy, built[name], observer)
                score = scored_errors(job, plant, estimate)
                yield _row("noise", name, level, run, score.relative_root_mean_square)
                if level == study.shown_noise:
                    errors = Errors.of(plant, estimate, job.metrics.axis - 1)
                    fault = score.root_mean_square / score.relative_root_mean_square
                    for second in range(1, int(job.plant.horizon) + 1):
                        size = errors.window(second - 1, second).root_mean_square
                        yield _row("time", name, second, run, size / fault)


def _with_noise(plant: Series, level: float, noise: tuple[Array, Array]) -> Series:
    measured, before = (Channel(plant["rate"] + level * unit, "rad/s") for unit in noise)
    channels = {**plant.channels, "measured": measured, "measured_before": before}
    return Series(plant.time, channels, plant.events)


def _row(sweep: str, observer: str, level: float, run: int, score: float) -> dict[str, Any]:
    return dict(zip(study_rows.HEADER, (sweep, observer, float(level), run, score), strict=True))


def _estimate(
    job: keys.Job, record: Series, built: RigidBodyObserver, observer: keys.Observer
) -> Series:
    return observe(built, keys.Job(job.plant, observer=observer), record)

"""The differentiator (37), with L in its last line."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.levant import LevantDifferentiator
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.delay import keys, noise
from reobserve_papers.papers.delay.setup import input_and_derivatives
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

SEED = 0
NOISES = 0.005, 0.05  # bounds of the noise on u


@part
def measure(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Errors of derivatives without and with noise."""
    body = named(job.observers, "order2_noise", keys.Extended).levant()
    period = body.sampling
    time = np.arange(0.0, sine.time[-1] + 0.5 * period, period)
    terms = job.theory.sine
    signals = input_and_derivatives(
        "sine", Signal.parse("sine", terms, 1), keys.MAX_DERIVATIVES + 1
    )
    truth = np.column_stack([s(time)[:, 0] for s in signals[:-1]])
    late = time >= 0.5 * sine.time[-1]  # after the finite convergence time
    sizes = root_mean_square(truth[late])
    law = LevantDifferentiator(
        L=body.L, order=keys.MAX_DERIVATIVES, lambdas=body.lambdas, sampling_period=period
    )
    run = law.run(truth[:, 0], start=law.init(np.zeros(keys.MAX_DERIVATIVES + 1)))
    shares = root_mean_square((run["derivatives"] - truth)[late]) / sizes
    for i in range(1, keys.MAX_DERIVATIVES + 1):
        yield Metric("levant", f"relative_rms_error_{i}", float(shares[i]), "1")
    largest = float(np.max(np.abs(signals[-1](time))))
    yield Metric("levant", "bound_share", largest / body.L, "1")
    yield from _in_noise(job, body, late, signals, time)
    yield from _growth(job, body, late, truth, time)


def _growth(
    job: keys.Job, body: keys.Levant, late: Any, truth: Array, time: Array
) -> Iterator[Metric]:
    """Exponents of the errors of u' and u'' in the size of the noise, from 0.5 to 5 per cent.

    The amplitude of the sine is one. [34] has powers 2/3 and 1/3 of the noise, not 1.
    """
    rows = np.floor(time / job.plant.noise_period + 1e-9).astype(int)
    stream = random_stream(SEED, "delay", "theory", "growth")
    drawn = stream.uniform(-1.0, 1.0, int(rows[-1]) + 1)[rows]
    order, errors = keys.MAX_DERIVATIVES, []
    for size in NOISES:
        law = LevantDifferentiator(
            L=body.L, order=order, lambdas=body.lambdas, sampling_period=body.sampling
        )
        run = law.run(truth[:, 0] + size * drawn, start=law.init(np.zeros(order + 1)))
        errors.append(root_mean_square((run["derivatives"] - truth)[late]))
    powers = np.log(errors[1] / errors[0]) / np.log(NOISES[1] / NOISES[0])
    for i in range(1, order + 1):
        yield Metric("levant", f"noise_exponent_{i}", float(powers[i]), "1")


def _in_noise(
    job: keys.Job, body: keys.Levant, late: Any, signals: list[Signal], time: Array
) -> Iterator[Metric]:
    """Relative errors of the derivatives up to the third, of the input with the noise of Fig. 2."""
    truth = np.column_stack([s(time)[:, 0] for s in signals])
    size = noise.deviations(job.plant, job.theory.noise_share, truth[:, 0], truth[:, 0])[1]
    rows = np.floor(time / job.plant.noise_period + 1e-9).astype(int)
    stream = random_stream(SEED, "delay", "theory", "derivatives")
    drawn = size * stream.standard_normal(int(rows[-1]) + 1)[rows]
    order = keys.MAX_DERIVATIVES + 1
    law = LevantDifferentiator(L=body.L, order=order, sampling_period=body.sampling)
    run = law.run(truth[:, 0] + drawn, start=law.init(np.zeros(order + 1)))
    errors = root_mean_square((run["derivatives"] - truth)[late])
    shares = errors / root_mean_square(truth[late])
    for i in range(1, order + 1):
        yield Metric("levant", f"relative_rms_error_{i}_in_noise", float(shares[i]), "1")

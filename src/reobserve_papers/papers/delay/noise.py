"""The noise on y and u: its size and its samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.papers.delay import keys
from reobserve_papers.signals.grid import noise_hold
from reobserve_papers.signals.inputs import Signal, Term
from reobserve_papers.signals.random_streams import held_normal
from reobserve_papers.signals.samples import Linear

Array = NDArray[np.float64]


def deviations(plant: keys.Plant, share: float, angle: Array, u: Array) -> tuple[float, float]:
    """Standard deviations of the noise on y and u: a share of their amplitudes without noise.

    The parameter ``noise_amplitude`` defines the amplitude of the angle [rad]; ``noise_size``
    states whether the share is a standard deviation or a peak.
    """
    if plant.noise_amplitude == "swing":
        amplitude = plant.swing
    elif plant.noise_amplitude == "wrapped":
        amplitude = float(np.max(np.abs((angle + np.pi) % (2 * np.pi) - np.pi)))
    else:
        amplitude = float(np.max(np.abs(angle)))
    size = share if plant.noise_size == "deviation" else share / plant.noise_peak
    return size * amplitude, size * float(np.max(np.abs(u)))


def drawn(
    plant: keys.Plant, stream: np.random.Generator, samples: int
) -> tuple[Array, Array, Array]:
    """Unit noise at the plant's samples: values, their limits from the left, and single values.

    Noise that changes faster than every second sample, the shortest step of an observer, is
    replaced by its mean over two samples. The single values are for a differentiator.
    """
    pair, period = 2 * plant.step, plant.noise_period
    if period >= pair:
        values, before = held_normal(stream, samples, noise_hold(plant.noise_period, plant.step))
        return values, before, values
    index, ends = np.arange(samples), np.arange(samples // 2 + 2) * pair
    fast = stream.standard_normal(int(np.ceil(ends[-1] / period)) + 1)
    area = np.concatenate([[0.0], np.cumsum(fast)]) * period
    means = np.diff(np.interp(ends, period * np.arange(len(area)), area)) / pair
    single = fast[np.floor(index * plant.step / period + 1e-9).astype(int)]
    return means[index // 2], means[np.maximum(index - 1, 0) // 2], single


def on_top(control: Signal, noise: Array, step: float) -> Signal:
    """The control plus noise at the samples from t = 0 on, each held for a step.

    Steep straight lines replace the jumps, because they may reach the plant at any time.
    """
    start = np.arange(len(noise)) * step
    instants = np.column_stack([start, start + (1 - 1e-6) * step]).ravel()
    term = Term(0, 0.0, np.inf, Linear(instants, np.repeat(noise, 2)))
    return Signal(1, (*control.terms, term))

"""The noise on y and u: how large it is, and how it is drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.matrices import as_positive
from reobserve.core.random_streams import held_normal
from reobserve.papers.delay import keys
from reobserve.signals.grid import noise_hold
from reobserve.signals.inputs import Signal, Term
from reobserve.signals.signal_shapes import Linear

Array = NDArray[np.float64]

PEAK = 3.0  # standard deviations, which normal noise leaves in three samples of a thousand


def deviations(plant: keys.Plant, share: float, angle: Array, u: Array) -> tuple[float, float]:
    """Standard deviations on y and u: a share of the amplitudes of the two without noise.

    What counts as amplitude of the angle [rad], and whether the share is a standard deviation or
    a peak, are readings of the paper: ``noise_amplitude`` and ``noise_size`` of the ledger.
    """
    if plant.noise_amplitude == "swing":
        amplitude = plant.swing
    elif plant.noise_amplitude == "wrapped":
        amplitude = float(np.max(np.abs((angle + np.pi) % (2 * np.pi) - np.pi)))
    else:
        amplitude = float(np.max(np.abs(angle)))
    size = share if plant.noise_size == "deviation" else share / PEAK
    return size * amplitude, size * float(np.max(np.abs(u)))


def hold(plant: keys.Plant, least: int = 2) -> tuple[int, float]:
    """Samples of the plant for which unit noise is held, and its deviation.

    Nobody sees noise that changes within ``least`` samples, the step of an observer. Such noise
    is held for these samples, with the deviation of its mean over them.

    Raises
    ------
    InputError
        If the period is not positive, or longer and no multiple of two plant steps.
    """
    shares = as_positive("plant.noise_period", plant.noise_period) / (least * plant.step)
    return (least, float(np.sqrt(shares))) if shares < 1 else (noise_hold(plant), 1.0)


def drawn(
    plant: keys.Plant, stream: np.random.Generator, samples: int, least: int = 2
) -> tuple[Array, Array]:
    """Unit noise at the plant's samples, and its limits from the left; see `hold`."""
    held, size = hold(plant, least)
    noise, before = held_normal(stream, samples, held)
    return size * noise, size * before


def on_top(control: Signal, noise: Array, step: float) -> Signal:
    """The control with noise at the samples from t = 0 on added to it, each held for a step.

    As straight lines that are as good as upright: unlike jumps these may arrive at any time.
    """
    start = np.arange(len(noise)) * step
    instants = np.column_stack([start, start + (1 - 1e-6) * step]).ravel()
    term = Term(0, 0.0, np.inf, Linear(instants, np.repeat(noise, 2)))
    return Signal(1, (*control.terms, term))

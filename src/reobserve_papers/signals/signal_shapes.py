"""The shapes of the terms of a signal: functions of time, and their exact derivatives.

A shape is called with times [s] and with whether limits from the left are meant. Its derivative is
a shape too, or None where there is none in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive

Array = NDArray[np.float64]

# Two instants closer than this are one: grid times are products and carry rounding.
SAME_INSTANT = 1e-9


class Shape(Protocol):
    """Interface of a shape that a term needs."""

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s], with ``before`` limits from the left."""

    def derivative(self) -> Shape | None:
        """The time derivative between jumps, or None if it has no closed form."""


@dataclass(frozen=True)
class Constant:
    """``size``."""

    size: float

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        return np.full(len(time), self.size)

    def derivative(self) -> Constant:
        """Zero."""
        return Constant(0.0)


@dataclass(frozen=True)
class Sine:
    """``amplitude * sin(frequency * t + phase)``, with the frequency in rad/s."""

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        values: Array = self.amplitude * np.sin(self.frequency * time + self.phase)
        return values

    def derivative(self) -> Sine:
        """The sine a quarter of a turn ahead, larger by the frequency."""
        return Sine(self.amplitude * self.frequency, self.frequency, self.phase + 0.5 * np.pi)


@dataclass(frozen=True)
class GrowingSine:
    """The imaginary part of ``(constant + growth * t) * exp(1j * frequency * t)``.

    Both factors are complex, so that the derivatives are of the same kind.
    """

    constant: complex
    growth: complex
    frequency: float

    @classmethod
    def sine(cls, *, growth: float, frequency: float, phase: float = 0.0) -> GrowingSine:
        """``growth * t * sin(frequency * t + phase)``."""
        return cls(0j, complex(growth * np.exp(1j * phase)), frequency)

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        turned = (self.constant + self.growth * time) * np.exp(1j * self.frequency * time)
        values: Array = turned.imag
        return values

    def derivative(self) -> GrowingSine:
        """The derivative, by the product rule."""
        turn = 1j * self.frequency
        return GrowingSine(turn * self.constant + self.growth, turn * self.growth, self.frequency)


@dataclass(frozen=True)
class Ramp:
    """``slope * (t - onset)``."""

    slope: float
    onset: float

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        return self.slope * (time - self.onset)

    def derivative(self) -> Constant:
        """The slope."""
        return Constant(self.slope)


@dataclass(frozen=True, eq=False)
class Sweep:
    """A sine the frequency of which rises in a straight line, and then stays, or a derivative.

    With s = t - onset, the frequency [rad/s] is ``start`` at s = 0 and ``end`` from
    s = ``duration`` [s] on; the phase is its integral over s. The value is the imaginary part of
    ``swept(s) * exp(1j * phase)``, and from ``duration`` on of ``settled * exp(1j * phase)``: both
    factors are the amplitude for the sine itself, and for its derivatives what the product rule
    makes of it.
    """

    onset: float
    duration: float
    start: float
    end: float
    swept: Polynomial
    settled: complex

    @classmethod
    def sine(
        cls, onset: float, *, amplitude: float, start: float, end: float, duration: float
    ) -> Sweep:
        """The sine itself, in phase 0 at its onset.

        Parameters
        ----------
        onset, duration
            Where the rise starts, and how long it takes [s].
        amplitude
            In the unit of the signal.
        start, end
            The frequencies at both ends of the rise [rad/s]; it is a fall if ``end`` is less.

        Raises
        ------
        InputError
            If ``duration`` is not positive, or ``start`` or ``end`` is negative.
        """
        as_positive("duration", duration)
        for key, frequency in (("start", start), ("end", end)):
            if frequency < 0:
                raise InputError(key, f"{frequency:g} rad/s must not be negative")
        return cls(onset, duration, start, end, Polynomial([amplitude]), amplitude)

    @property
    def _frequency(self) -> Polynomial:
        return Polynomial([self.start, (self.end - self.start) / self.duration])

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s], with ``before`` limits from the left."""
        since = time - self.onset
        phase = self._frequency.integ()
        edge = SAME_INSTANT if before else -SAME_INSTANT
        last = np.searchsorted(since, self.duration + edge)
        later = phase(self.duration) + self.end * (since[last:] - self.duration)
        rising = self.swept(since[:last]) * np.exp(1j * phase(since[:last]))
        return np.concatenate([rising.imag, (self.settled * np.exp(1j * later)).imag])

    def derivative(self) -> Sweep:
        """The product rule on either side of the end of the rise."""
        swept = self.swept.deriv() + 1j * self._frequency * self.swept
        settled = 1j * self.end * self.settled
        return Sweep(self.onset, self.duration, self.start, self.end, swept, settled)

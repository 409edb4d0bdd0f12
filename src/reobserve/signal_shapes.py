"""The shapes of the terms of a signal: functions of time, and their exact derivatives.

A shape is called with times [s] and with whether limits from the left are meant. Its derivative is
a shape too, or None where there is none in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Two instants closer than this are one: grid times are products and carry rounding.
SAME_INSTANT = 1e-9


class Shape(Protocol):
    """What a term needs of its shape."""

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]; with ``before``, limits from the left."""

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
    phase: float

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        values: Array = self.amplitude * np.sin(self.frequency * time + self.phase)
        return values

    def derivative(self) -> Sine:
        """The sine a quarter of a turn ahead, larger by the frequency."""
        return Sine(self.amplitude * self.frequency, self.frequency, self.phase + 0.5 * np.pi)


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
class Held:
    """The last of ``values`` that was taken, each at its of ``instants`` [s]."""

    instants: Array
    values: Array

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]; with ``before``, what was held until then."""
        edge = -SAME_INSTANT if before else SAME_INSTANT
        return self.values[np.searchsorted(self.instants, time + edge, side="right") - 1]

    def derivative(self) -> None:
        """None: samples do not say what is between them."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Straight lines between ``values`` at ``instants`` [s]; the last value holds."""

    instants: Array
    values: Array

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        return np.interp(time, self.instants, self.values)

    def derivative(self) -> None:
        """None: samples do not say what is between them."""

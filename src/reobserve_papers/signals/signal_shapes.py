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

# The bits of a prbs, or the half periods of a square.
_MOST_LEVELS = 1_000_000

# For each number of bits n a primitive polynomial over the integers modulo 2, x^n + ... + 1, as
# the powers of x between the first and the last.
PRIMITIVE_POLYNOMIALS = {
    **{2: (1,), 3: (2,), 4: (3,), 5: (3,), 6: (5,), 7: (6,), 8: (7, 6, 1), 9: (5,), 10: (7,)},
    **{11: (9,), 12: (11, 10, 4), 13: (12, 11, 8), 14: (13, 12, 2), 15: (14,), 16: (15, 13, 4)},
}


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


@dataclass(frozen=True, eq=False)
class Held:
    """The last of ``values`` that was taken, each at its of ``instants`` [s]."""

    instants: Array
    values: Array

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s], with ``before`` what was held until then."""
        edge = -SAME_INSTANT if before else SAME_INSTANT
        return self.values[np.searchsorted(self.instants, time + edge, side="right") - 1]

    def derivative(self) -> Shape | None:
        """None: samples do not say what is between them."""
        return None


class PiecewiseConstant(Held):
    """Constant between ``instants`` [s] by definition, where held samples only seem to be."""

    @classmethod
    def square(
        cls,
        onset: float,
        end: float,
        *,
        high: float,
        period: float,
        low: float = 0.0,
        width: float | None = None,
    ) -> PiecewiseConstant:
        """``high`` for the first ``width`` [s] of each ``period`` [s], ``low`` for the rest.

        Parameters
        ----------
        onset, end
            Where the first period starts, and where no period is needed any more [s].
        high, low
            In the unit of the signal.
        period, width
            In s; None is half the period.

        Raises
        ------
        InputError
            If ``width`` is not inside ``period``, or there are too many periods before ``end``.
        """
        as_positive("period", period)
        width = 0.5 * period if width is None else width
        if not SAME_INSTANT < width < period - SAME_INSTANT:
            raise InputError("width", f"{width:g} s must be between 0 and the period {period:g} s")
        starts = np.arange(_count((end - onset) / period, "half periods", 2)) * period
        instants = onset + np.column_stack([starts, starts + width]).ravel()
        return cls._merged(instants, np.tile([high, low], len(starts)))

    @classmethod
    def prbs(
        cls, onset: float, end: float, *, amplitude: float, clock: float, order: float
    ) -> PiecewiseConstant:
        """+-``amplitude`` by a `maximum_length_sequence`, over and over, a bit each 1/``clock``.

        Parameters
        ----------
        onset, end
            Where the first bit starts, and where no bit is needed any more [s].
        amplitude
            In the unit of the signal.
        clock
            Bits a second [Hz].
        order
            The number of bits of the register.

        Raises
        ------
        InputError
            If ``clock`` or ``order`` is out of range, or there are too many bits before ``end``.
        """
        if not 0 < clock < 1 / SAME_INSTANT:
            raise InputError("clock", f"{clock:g} Hz must be between 0 and {1 / SAME_INSTANT:g} Hz")
        if order not in PRIMITIVE_POLYNOMIALS:
            least, most = min(PRIMITIVE_POLYNOMIALS), max(PRIMITIVE_POLYNOMIALS)
            raise InputError("order", f"{order:g} must be a whole number from {least} to {most}")
        bits = _count((end - onset) * clock, "bits", 1)
        levels = amplitude * np.resize(maximum_length_sequence(int(order)), bits)
        return cls._merged(onset + np.arange(bits) / clock, levels)

    @classmethod
    def _merged(cls, instants: Array, levels: Array) -> PiecewiseConstant:
        """The steps without the instants at which nothing changes."""
        kept = np.append(True, np.diff(levels) != 0)
        return cls(instants[kept], levels[kept])

    def derivative(self) -> Constant:
        """Zero."""
        return Constant(0.0)


@dataclass(frozen=True, eq=False)
class Linear:
    """Straight lines between ``values`` at ``instants`` [s], the last of which holds."""

    instants: Array
    values: Array

    def __call__(self, time: Array, before: bool) -> Array:
        """Values at increasing times [s]."""
        return np.interp(time, self.instants, self.values)

    def derivative(self) -> None:
        """None: samples do not say what is between them."""


def maximum_length_sequence(order: int) -> Array:
    """One period of +-1 from a linear feedback shift register, shape (2^order - 1,).

    The register holds the last ``order`` bits, all ones at first; the sequence starts with them.
    Each new bit is the sum modulo 2 of those that a primitive polynomial picks, so that the
    register takes every value but zero once in a period (Golomb, Shift Register Sequences, 1967).

    Parameters
    ----------
    order
        The number of bits, a key of `PRIMITIVE_POLYNOMIALS`.
    """
    delays = (order, *(order - power for power in PRIMITIVE_POLYNOMIALS[order]))
    bits = [1] * order
    for _ in range(2**order - 1 - order):
        bits.append(sum(bits[-delay] for delay in delays) % 2)
    return 2.0 * np.array(bits) - 1.0


def _count(cycles: float, noun: str, each: int) -> int:
    """The number of cycles that begin within a span of so many, one more if the last is whole."""
    if each * cycles > _MOST_LEVELS:
        raise InputError(
            "until", f"asks for {each * cycles:.9g} {noun}, must ask for {_MOST_LEVELS} or fewer"
        )
    return int(cycles) + 1

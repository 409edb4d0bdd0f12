"""Squares and pseudo-random binary sequences: signals that are constant between instants."""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive
from reobserve_papers.signals.samples import Held
from reobserve_papers.signals.signal_shapes import SAME_INSTANT, Array, Constant

# The bits of a prbs, or the half periods of a square.
_MOST_LEVELS = 1_000_000

# For each number of bits n a primitive polynomial over the integers modulo 2, x^n + ... + 1, as
# the powers of x between the first and the last.
PRIMITIVE_POLYNOMIALS = {
    **{2: (1,), 3: (2,), 4: (3,), 5: (3,), 6: (5,), 7: (6,), 8: (7, 6, 1), 9: (5,), 10: (7,)},
    **{11: (9,), 12: (11, 10, 4), 13: (12, 11, 8), 14: (13, 12, 2), 15: (14,), 16: (15, 13, 4)},
}


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

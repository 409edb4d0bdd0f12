"""The past of an input, at any instant: what a delay that nobody knows asks for.

The input comes as samples of u and u', two a step and one at the end. Within a step both are read
from the polynomial of degree five through u and u' at its start, middle and end. It gives u to
order 6 and u' to order 5 of the step; the cubic between two samples would give u' to order 3
only, lines to order 1, and a Runge-Kutta method that reads them would silently lose its own order.

The input may jump, or its slope, where a step ends and the next begins: the limits from both
sides are kept apart there. u' must be the slope of u: noise on u goes into u' between samples
as noise over step, unless it is held over whole steps and its jumps are given by their limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve.core.matrices import as_floats, as_positive, as_samples
from reobserve.core.value import Value, converter, for_loop

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class InputHistory(Value):
    """u and u' over some steps, the last of which ends now.

    Parameters
    ----------
    right
        u and u' [1/s], shape (2 m + 1, 2): at both ends and in the middle of each of m steps.
    left
        Their limits from the left, same shape; ``right`` if the input does not jump.
    sampling_period
        [s].

    Raises
    ------
    InputError
        If a shape is wrong or a sample is not finite.
    """

    right: Array
    left: Array
    sampling_period: float = field(kw_only=True, metadata=converter(as_positive))

    def __post_init__(self) -> None:
        right, left = samples_with_limits("right", self.right, self.left, "left")
        self._set("right", right)
        self._set("left", self.right if left is right else left)
        super().__post_init__()

    @property
    def steps(self) -> int:
        """m, over how many steps it goes back."""
        return len(self.right) // 2

    def followed_by(self, right: Array, left: Array) -> InputHistory:
        """The history and more steps; the first new row is the instant of the last old one.

        At that instant the limit from the left is the old one, that from the right the new one.
        """
        right, left = samples_with_limits("right", right, left, "left")
        return InputHistory(
            np.concatenate([self.right[:-1], right]),
            np.concatenate([self.left, left[1:]]),
            sampling_period=self.sampling_period,
        )

    def latest(self, steps: int) -> InputHistory:
        """Its last ``steps`` steps, copied, so that what was before can be forgotten.

        Raises
        ------
        InputError
            If there are not so many.
        """
        if not 1 <= (steps := as_whole("steps", steps, 0)) <= self.steps:
            raise InputError("steps", f"{steps} must be from 1 to the {self.steps} that there are")
        rows = 2 * steps + 1
        return InputHistory(
            self.right[-rows:].copy(),
            self.left[-rows:].copy(),
            sampling_period=self.sampling_period,
        )

    def halved(self) -> InputHistory:
        """The same over twice as many steps, each half with the polynomial of its whole."""
        rows = 2 * len(self.right) - 1
        finer = self.at((rows - 1 - np.arange(rows)) * (0.25 * self.sampling_period))
        finer[::2] = self.right
        before = finer.copy()
        before[::2] = self.left
        return InputHistory(finer, before, sampling_period=0.5 * self.sampling_period)

    def at(self, ago: ArrayLike) -> Array:
        """Values of u and u' ``ago`` seconds, shape (k,), before the end; shape (k, 2).

        Raises
        ------
        InputError
            If an instant is not inside the history.
        """
        times = as_floats("ago", ago)
        span = self.steps * self.sampling_period
        if times.ndim != 1 or np.any(times < 0) or np.any(times > span * (1 + 1e-12)):
            raise InputError("ago", f"must be a list of times from 0 to {span:g} s")
        return _at(for_loop(self.right), for_loop(self.left), self.sampling_period, times)


def samples_with_limits(
    name: str, samples: ArrayLike, before: ArrayLike | None, before_name: str | None = None
) -> tuple[Array, Array]:
    """Samples of u and u' and their limits from the left, which are the samples if not given.

    Raises
    ------
    InputError
        If one of them is not an odd number of rows, 3 or more, of two finite numbers, or their
        lengths differ; it names ``name`` or ``before_name`` (else ``name`` with ``_before``).
    """
    right = as_samples(name, samples, 2, halves=True)
    if before is None or before is samples:
        return right, right
    before_name = before_name or f"{name}_before"
    return right, as_samples(before_name, before, 2, rows=len(right), like=name)


@kernel
def past_input(
    right: Array, left: Array, now: int, fraction: float, lag: float, step: float
) -> tuple[float, float]:
    """Values of u and u', ``lag`` steps before a part of the step that starts in row ``now``.

    The part is ``fraction``, from 0 to 1; where the instant is not a number, the values are none.
    It counts back from the present step, so that the same samples give the same bits wherever they
    stand in the arrays. Before the first row and after the present step the polynomials are
    continued by one step: an integrator looks a little beyond the bounds of a delay before it
    finds that it must not.
    """
    place = fraction - lag
    if not np.isfinite(place):  # must not become an index
        return np.nan, np.nan
    cell = 0
    if place < 0.0:
        oldest = -(now // 2)
        cell = oldest if place <= oldest else int(np.floor(place))
    row = now + 2 * cell
    s = 2.0 * (place - cell) - 1.0  # -1, 0 and 1 at the three samples of the step
    s = min(max(s, -3.0), 3.0)
    half = 0.5 * step
    value, slope = right[row + 1, 0], half * right[row + 1, 1]
    first, last = half * right[row, 1], half * left[row + 2, 1]
    bend = 0.5 * (left[row + 2, 0] + right[row, 0]) - value
    rest = 0.5 * (left[row + 2, 0] - right[row, 0]) - slope
    c4 = 0.25 * (last - first) - bend
    c2 = bend - c4
    c5 = 0.5 * (0.5 * (last + first) - slope - 3.0 * rest)
    c3 = rest - c5
    u = value + s * (slope + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    rate = slope + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    return u, rate / half


@kernel
def _at(right: Array, left: Array, step: float, ago: Array) -> Array:
    """`past_input` before the end of the last step, for many times."""
    out = np.empty((len(ago), 2))
    for i in range(len(ago)):
        out[i] = past_input(right, left, len(right) - 3, 1.0, ago[i] / step, step)
    return out

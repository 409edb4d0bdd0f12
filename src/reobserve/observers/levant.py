"""Robust exact differentiator of any order n (Levant 2003; Lechappe et al. 2018, (37)).

The paper prints the last line without L, which is correct for a bound of 1 only: with L = 0.11 the
gain of the last line is then nine times too large for the other lines.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_flag, as_whole
from reobserve.core.errors import InputError, shown
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.core.matrices import as_positive, as_vector
from reobserve.core.value import Value, converter
from reobserve.observers.contract import Observer
from reobserve.observers.record import Record, Rows, check_state

Array = NDArray[np.float64]

# Levant's sequence: order n uses the last n + 1, the last line of (37) the last one.
_USUAL = (8.0, 5.0, 3.0, 2.0, 1.5, 1.1)


class LevantCoefficients(NamedTuple):
    """Coefficients of the loop.

    ``factors`` are lambda_i L^(1/(n+1-i)), ``exponents`` (n-i)/(n+1-i), ``taylor`` T^j / j! with
    j from 0; all of shape (n+1,).
    """

    factors: Array
    exponents: Array
    taylor: Array


@dataclass(frozen=True, eq=False, repr=False)
class LevantState(Value):
    """The differentiator's state: a value that may be stored, copied and stepped again.

    ``derivatives`` holds z0 to zn, shape (n+1,), at the last sample, or at the first one if there
    was none; the rest is as in `reobserve.observers.record.ObserverState`.
    """

    derivatives: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class LevantDifferentiator(Observer[LevantState]):
    """Robust exact differentiator for samples at a fixed period, in its homogeneous discretisation.

        z0' = v0,   v0 = -lambda0 L^(1/(n+1)) |z0 - u|^(n/(n+1)) sign(z0 - u) + z1
        zi' = vi,   vi = -lambdai L^(1/(n+1-i)) |zi - v(i-1)|^((n-i)/(n+1-i)) sign(zi - v(i-1))
                         + z(i+1)
        zn' = -lambdan L sign(zn - v(n-1))

    Levant 2003; Lechappe et al. 2018, (37) and (38). If the derivative of order n + 1 of u is
    bounded by L, then z0 to zn reach u and its derivatives in finite time, for lambdas that are
    large enough and lambdan above 1. The error of zi is of the order L T^(n+1-i) for samples at a
    period T, and L^(i/(n+1)) eps^((n+1-i)/(n+1)) for noise bounded by eps.

    `init` takes derivatives, n + 1 of them; left out, a run starts from the first sample and zeros.
    `run` and `step` take y, the signal u to differentiate, shape (k,), and no known input.
    Estimates: ``derivatives``, z0 to zn, shape (k, n+1), [unit of u / s^i]. The first row is the
    initial state, and a later one depends on the samples before its own only.

    Parameters
    ----------
    L
        Bound on the derivative of order n + 1 of u [unit of u / s^(n+1)].
    order
        n, the highest derivative to estimate.
    lambdas
        lambda0 to lambdan, in the order of the lines of (37). The default is the last n + 1 of
        Levant's 8, 5, 3, 2, 1.5, 1.1, for orders up to 5. The paper uses 3, 1.5, 1.
    printed
        Use the last line as printed in the paper, without L, to show that it fails.
    sampling_period
        [s].

    Raises
    ------
    InputError
        If the order is not a whole number above zero, L, the period or one of the lambdas is not
        positive, there are not n + 1 lambdas, or none are given for an order above 5.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import LevantDifferentiator
    >>> observer = LevantDifferentiator(L=1.0, order=2, sampling_period=0.01)
    >>> run = observer.run(np.sin(0.01 * np.arange(1000)))
    >>> print(run["derivatives"][-1].round(2), np.cos(9.99).round(2))
    [-0.54 -0.84  0.53] -0.84
    """

    L: float = field(kw_only=True, metadata=converter(as_positive))
    order: int = field(default=2, kw_only=True, metadata=converter(as_whole, 1))
    lambdas: ArrayLike | None = field(default=None, kw_only=True)
    printed: bool = field(default=False, kw_only=True, metadata=converter(as_flag))

    measurements: ClassVar[int] = 1
    inputs: ClassVar[int] = 0
    units: ClassVar[Mapping[str, str]] = {"derivatives": ""}

    def __post_init__(self) -> None:
        super().__post_init__()
        lines = self.order + 1
        if self.lambdas is None and lines > len(_USUAL):
            raise InputError(
                "lambdas", f"must be given for order {self.order}: the usual ones end at order 5"
            )
        usual = _USUAL[-lines:] if self.lambdas is None else self.lambdas
        chosen = as_vector("lambdas", usual, lines)
        if chosen.min() <= 0:
            raise InputError("lambdas", f"{shown(chosen.tolist())} must all be greater than zero")
        self._set("lambdas", chosen)

    @cached_property
    def _law(self) -> LevantCoefficients:
        index = np.arange(self.order + 1)
        left = self.order + 1.0 - index
        lambdas = as_vector("lambdas", self.lambdas, self.order + 1)
        factors = lambdas * self.L ** (1.0 / left)
        if self.printed:
            factors[-1] = lambdas[-1]
        # T^j / j! as a running product: no factorial to overflow.
        taylor = np.cumprod(np.concatenate([[1.0], self.sampling_period / index[1:]]))
        return LevantCoefficients(factors, (left - 1.0) / left, taylor)

    def init(self, derivatives: ArrayLike) -> LevantState:
        """The state at the first sample, from estimates of u and its derivatives, shape (n+1,).

        Raises
        ------
        InputError
            If they are not n + 1 finite numbers.
        """
        return LevantState(as_vector("derivatives", derivatives, self.order + 1))

    def _start(self, first: Array) -> LevantState:
        return self.init(np.append(first, np.zeros(self.order)))

    def _checked(self, state: Any) -> LevantState:
        problem = f"must be of a differentiator of order {self.order}"
        return check_state(state, LevantState, problem, derivatives=(self.order + 1,), sample=(1,))

    def _fill(self, state: LevantState, record: Record) -> Rows:
        last = np.empty(0) if state.sample is None else state.sample
        samples, begun = np.append(last, record.y), len(last)  # whose row is already computed
        steps = len(samples) - 1
        rows = np.empty((steps + 1, self.order + 1))
        rows[0] = state.derivatives
        finite = _run(self._law, samples, rows) - begun
        time = None if record.time is None else float(record.time[-1])
        after = LevantState(rows[-1].copy(), record.y[-1].copy(), state.count + steps, time)
        return Rows({"derivatives": rows[begun:]}, finite, after)


@kernel
def _run(law: LevantCoefficients, samples: Array, rows: Array) -> int:
    """Fill ``rows`` from its first one, and return the number of finite rows.

    Lechappe et al. 2018, (37). The chain of integrators is advanced exactly by its Taylor
    polynomial, and only the injection by Euler's rule. Euler's rule for both omits T^2/2 z2 and so
    on, which do not vanish with the error: z1 is then accurate to order 1 in T only, for any n
    (Livne & Levant 2014). With the polynomial the steps keep the homogeneity of the differentiator,
    and zi its order n + 1 - i.
    """
    lines = rows.shape[1]
    due = FIRST
    for k in range(len(rows) - 1):
        if k >= due:
            due = poll(k)
        z, after = rows[k], rows[k + 1]
        # zi - v(i-1) is minus the injection one line above, so v itself is not needed.
        error = z[0] - samples[k]
        sign = 0.0
        if error != 0.0:
            sign = 1.0 if error > 0.0 else -1.0
        size = abs(error)
        # s_i = lambda_i L^(1/(n+1-i)) s_(i-1)^((n-i)/(n+1-i)), from s_(-1) = |z0 - u|
        # z_i(k+1) = sum_j T^j/j! z_(i+j)(k) - T s_i sign(z0 - u)
        for i in range(lines):
            size = law.factors[i] * (size ** law.exponents[i] if i + 1 < lines else 1.0)
            moved = z[i]
            for j in range(1, lines - i):
                moved += law.taylor[j] * z[i + j]
            after[i] = moved - law.taylor[1] * size * sign
            if not np.isfinite(after[i]):
                return k + 1
    return len(rows)

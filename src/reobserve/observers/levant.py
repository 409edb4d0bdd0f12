"""Robust exact differentiator of any order n (Levant 2003; Lechappe et al. 2018, (37)).

    z0' = v0,   v0 = -lambda0 L^(1/(n+1)) |z0 - u|^(n/(n+1)) sign(z0 - u) + z1
    zi' = vi,   vi = -lambdai L^(1/(n+1-i)) |zi - v(i-1)|^((n-i)/(n+1-i)) sign(zi - v(i-1)) + z(i+1)
    zn' = -lambdan L sign(zn - v(n-1))

If the derivative of order n + 1 of u is bounded by L, then z0 to zn reach u and its derivatives in
finite time, for lambdas that are large enough and lambdan above 1. The error of zi is of the order
L T^(n+1-i) for samples at a period T, and L^(i/(n+1)) eps^((n+1-i)/(n+1)) for noise bounded by eps.

The paper prints the last line without L, which is right for a bound of 1 alone: with L = 0.11 the
last state is then driven nine times too hard for the others to follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError, shown
from reobserve.numerics.arguments import as_flag, as_whole
from reobserve.numerics.kernel import kernel
from reobserve.numerics.matrices import as_numbers, as_positive, as_samples, as_vector
from reobserve.observers.contract import OnDivergence, check_state, raises

Array = NDArray[np.float64]

# Levant's sequence, the last line of the differentiator at its end: order n takes the last n + 1.
_USUAL = (8.0, 5.0, 3.0, 2.0, 1.5, 1.1)


class Law(NamedTuple):
    """What the loop reads.

    ``factors`` are lambda_i L^(1/(n+1-i)), ``exponents`` (n-i)/(n+1-i), ``taylor`` T^j / j! with
    j from 0; all of shape (n+1,).
    """

    factors: Array
    exponents: Array
    taylor: Array


@dataclass(frozen=True)
class State:
    """All the differentiator remembers: a value that may be stored, copied and stepped again.

    ``estimate`` holds z0 to zn, shape (n+1,), at the next sample, made from those before it;
    ``count`` samples were taken.
    """

    estimate: Array
    count: int = 0


@dataclass(frozen=True)
class Run:
    """Estimates of u and its derivatives at the samples.

    ``estimate`` has shape (m, n+1), columns z0 to zn; a row is made from the samples before its
    own, the first is the state that the run started from. ``diverged_at`` is None, or the time
    [s] since the first sample after which the state left the range of floating-point numbers;
    then m counts the rows up to it. ``state`` is the one to go on from, or after a divergence the
    one that the run started from.
    """

    estimate: Array
    state: State
    diverged_at: float | None


@dataclass(frozen=True, eq=False)
class LevantDifferentiator:
    """The differentiator (37) for samples at a fixed period, in its homogeneous discretisation.

    Parameters
    ----------
    L
        Bound on the derivative of order n + 1 of u [unit of u / s^(n+1)].
    period
        Time between samples [s].
    order
        n, the highest derivative to estimate.
    lambdas
        lambda0 to lambdan, in the order of the lines of (37). Left out, they are the last n + 1
        of Levant's 8, 5, 3, 2, 1.5, 1.1, which serve orders up to 5. The paper takes 3, 1.5, 1.
    printed
        Take the last line as the paper prints it, without L: to show that it fails.

    Raises
    ------
    InputError
        If the order is not a whole number above zero, L, the period or one of the lambdas is not
        positive, there are not n + 1 of them, or there are none for an order above 5.
    """

    L: float
    period: float
    order: int = 2
    lambdas: ArrayLike | None = None
    printed: bool = False

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "order", as_whole("order", self.order, 1))
        put(self, "printed", as_flag("printed", self.printed))
        lines = self.order + 1
        if self.lambdas is None and lines > len(_USUAL):
            raise InputError(
                "lambdas", f"must be given for order {self.order}: the usual ones end at order 5"
            )
        usual = _USUAL[-lines:] if self.lambdas is None else self.lambdas
        chosen = as_vector("lambdas", usual, lines)
        if chosen.min() <= 0:
            raise InputError("lambdas", f"{shown(chosen.tolist())} must all be greater than zero")
        put(self, "L", as_positive("L", self.L))
        put(self, "period", as_positive("period", self.period))
        put(self, "lambdas", chosen)

    @cached_property
    def _law(self) -> Law:
        index = np.arange(self.order + 1)
        left = self.order + 1.0 - index
        lambdas = as_vector("lambdas", self.lambdas, self.order + 1)
        factors = lambdas * self.L ** (1.0 / left)
        if self.printed:
            factors[-1] = lambdas[-1]
        # T^j / j! as a running product: no factorial to overflow.
        taylor = np.cumprod(np.concatenate([[1.0], self.period / index[1:]]))
        return Law(factors, (left - 1.0) / left, taylor)

    def init(self, initial_estimate: ArrayLike | None = None) -> State:
        """The state before the first sample, from estimates of u and its derivatives, or zeros.

        Raises
        ------
        InputError
            If the estimate is not n + 1 finite numbers.
        """
        if initial_estimate is None:
            return State(np.zeros(self.order + 1))
        return State(as_vector("initial_estimate", initial_estimate, self.order + 1))

    def step(self, state: State, sample: float) -> tuple[State, Array]:
        """Take one sample of u: the next state, and the estimate at the sample, shape (n+1,).

        The estimate for the next sample, which knows this one, is the state's own. Stepping
        through samples gives the bits that `run` gives.

        Raises
        ------
        InputError
            If the sample is not one finite number, or the state is not of such a differentiator.
        DivergenceError
            As `run`.
        """
        run = self.run(as_numbers("samples", sample)[None], state)
        return run.state, run.estimate[0]

    def run(
        self, samples: ArrayLike, state: State, *, on_divergence: OnDivergence = "raise"
    ) -> Run:
        """Estimates at all samples, by one compiled loop.

        Parameters
        ----------
        samples
            u at a fixed period, shape (m,).
        state
            From `init`, or from an earlier run to go on with the sample after its last.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If the samples are not a list of finite numbers, or the state is not of such a
            differentiator.
        DivergenceError
            If an estimate leaves the range of floating-point numbers.
        """
        loud, lines = raises(on_divergence), self.order + 1
        problem = f"must be of a differentiator of order {self.order}"
        state = check_state(state, State, problem, estimate=(lines,))
        values = as_samples("samples", samples, None)
        rows = np.empty((len(values) + 1, lines))
        rows[0] = state.estimate
        finite = _run(self._law, values, rows)
        if finite == len(rows):
            return Run(rows[:-1], State(rows[-1].copy(), state.count + len(values)), None)
        diverged_at = (finite - 1) * self.period
        if loud:
            raise DivergenceError(type(self).__name__, state.count * self.period + diverged_at)
        return Run(rows[:finite], state, diverged_at)


@kernel
def _run(law: Law, samples: Array, rows: Array) -> int:
    """Fill ``rows`` from its first one; return the number of finite rows.

    The chain of integrators moves by its Taylor polynomial, exactly, and only the injection by
    Euler's rule. Euler's rule for all leaves out T^2/2 z2 and so on, which do not vanish with the
    error: then z1 is accurate to order 1 in T only, whatever n is (Livne & Levant 2014). With the
    polynomial the steps scale as the differentiator does, and zi keeps its order n + 1 - i.
    """
    lines = rows.shape[1]
    for k in range(len(samples)):
        z, after = rows[k], rows[k + 1]
        # zi - v(i-1) is minus the injection one line above: no need to form v itself.
        error = z[0] - samples[k]
        sign = 0.0
        if error != 0.0:
            sign = 1.0 if error > 0.0 else -1.0
        size = abs(error)
        for i in range(lines):
            size = law.factors[i] * (size ** law.exponents[i] if i + 1 < lines else 1.0)
            moved = z[i]
            for j in range(1, lines - i):
                moved += law.taylor[j] * z[i + j]
            after[i] = moved - law.taylor[1] * size * sign
            if not np.isfinite(after[i]):
                return k + 1
    return len(rows)

"""Identity form of a normal-form observer (Thomas, Kwatny & Chang, (11) and (12)).

    x^' = f(x^) + L(x^) (l(h(x^)) - l(y)),      l(y) = L0 y + ...

The paper prints y - h(x^) in (11); with A = F + L0 H the error then obeys F - L0 H, so the sign
here is that of (8). A truncated gain is read in one of the three ways that
`reobserve.synthesis.normal_form.gain` lists.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.kernel import kernel
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.power_series.evaluation import Polynomials, evaluate, polynomials
from reobserve.small_systems import solve_in_place
from reobserve.synthesis.normal_form.gain import GAINS

Array = NDArray[np.float64]


class Law(NamedTuple):
    """The polynomials of the right-hand side.

    ``gain`` is L, dS/dx or S by the ``kind`` 0, 1 or 2 of the gain; ``outer`` is dT/dz.
    """

    f: Polynomials
    h: Polynomials
    injection: Polynomials
    gain: Polynomials
    outer: Polynomials
    kind: int


class Work(NamedTuple):
    """Room for monomials, the output, its injection and the gain matrix, so that no step asks."""

    monomials: Array
    output: Array
    injected: Array
    matrix: Array
    coordinates: Array


@dataclass(frozen=True, eq=False)
class IdentityObserver(NormalFormObserver):
    """The observer (11), integrated by the classical Runge-Kutta method.

    ``gain`` is one of series, jacobian and composed; `InputError` if it is another.
    """

    gain: str = "series"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gain not in GAINS:
            raise InputError("gain", f"{self.gain!r} must be one of {', '.join(GAINS)}")

    @cached_property
    def _law(self) -> Law:
        form, degree = self.normal_form, self.order + 1
        problem = form.problem
        unused = polynomials(problem.injection)
        if self.gain == "series":
            matrix, outer = polynomials(form.gain.upto(max(1, self.order))), unused
            if self.order == 0:
                matrix = polynomials(form.S.upto(1).jacobian())
        elif self.gain == "jacobian":
            matrix, outer = polynomials(form.S.upto(degree).jacobian()), unused
        else:
            matrix = polynomials(form.S.upto(degree))
            outer = polynomials(form.T.upto(degree).jacobian())
        f, h = polynomials(problem.system.dynamics), polynomials(problem.system.output)
        return Law(f, h, polynomials(problem.injection), matrix, outer, GAINS.index(self.gain))

    def _start(self, estimate: Array) -> Array:
        return estimate

    def _run(self, values: Array, output: Array, rows: Array) -> int:
        law = self._law
        room = max(len(part.parent) for part in law[:-1])
        n, p = len(values), output.shape[1]
        work = Work(np.empty(room), np.empty(p), np.empty(n), np.empty(n * n), np.empty(n))
        return _run(law, work, self.step_size, output, rows)

    def _read(self, rows: Array) -> tuple[Array, None]:
        return rows, None


@kernel
def _slope(law: Law, work: Work, x: Array, measured: Array, out: Array) -> None:
    """The right-hand side of (11); ``measured`` is l(y)."""
    n = len(x)
    evaluate(law.h, x, work.monomials, work.output)
    evaluate(law.injection, work.output, work.monomials, work.injected)
    for i in range(n):
        work.injected[i] -= measured[i]
    evaluate(law.f, x, work.monomials, out)
    matrix = work.matrix
    if law.kind == 2:
        evaluate(law.gain, x, work.monomials, work.coordinates)
        evaluate(law.outer, work.coordinates, work.monomials, matrix)
    else:
        evaluate(law.gain, x, work.monomials, matrix)
    if law.kind == 1:
        solve_in_place(matrix.reshape((n, n)), work.injected)
        for i in range(n):
            out[i] += work.injected[i]
    else:
        for i in range(n):
            for j in range(n):
                out[i] += matrix[i * n + j] * work.injected[j]


@kernel
def _run(law: Law, work: Work, step: float, output: Array, rows: Array) -> int:
    """Fill ``rows`` from its first one; return the number of finite rows."""
    n = rows.shape[1]
    start, middle, end = np.empty(n), np.empty(n), np.empty(n)
    k1, k2, k3, k4, x = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    half = 0.5 * step
    for k in range(len(rows) - 1):
        evaluate(law.injection, output[2 * k], work.monomials, start)
        evaluate(law.injection, output[2 * k + 1], work.monomials, middle)
        evaluate(law.injection, output[2 * k + 2], work.monomials, end)
        _slope(law, work, rows[k], start, k1)
        for i in range(n):
            x[i] = rows[k, i] + half * k1[i]
        _slope(law, work, x, middle, k2)
        for i in range(n):
            x[i] = rows[k, i] + half * k2[i]
        _slope(law, work, x, middle, k3)
        for i in range(n):
            x[i] = rows[k, i] + step * k3[i]
        _slope(law, work, x, end, k4)
        for i in range(n):
            after = rows[k, i] + step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            if not np.isfinite(after):
                return k + 1
            rows[k + 1, i] = after
    return len(rows)

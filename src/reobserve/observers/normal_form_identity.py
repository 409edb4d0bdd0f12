"""Identity form of a normal-form observer (Thomas, Kwatny & Chang, (11) and (12)).

The paper prints y - h(x^) in (11); with A = F + L0 H the error then obeys F - L0 H, so the sign
here is that of (8). A truncated gain is read in one of the three ways that
`reobserve.synthesis.normal_form.identity_gain` lists.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_word
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.core.small_systems import solve_in_place
from reobserve.core.value import converter
from reobserve.observers.fixed_step import Samples
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.polynomials.evaluation_kernels import Polynomials, evaluate, polynomials
from reobserve.polynomials.maps import stacked
from reobserve.synthesis.normal_form.identity_gain import GAINS

Array = NDArray[np.float64]


class IdentityDynamics(NamedTuple):
    """The polynomials of the right-hand side.

    ``inner`` holds, row by row, f(x), l(h(x)) and, by the ``kind`` 0, 1 or 2 of the gain, L,
    dS/dx or S; ``outer`` is dT/dz, which kind 2 alone needs; ``injection`` is l(y) - beta(y, u).
    """

    inner: Polynomials
    outer: Polynomials
    injection: Polynomials
    kind: int


class IdentityWork(NamedTuple):
    """Arrays for one step after the other: among them ``measured``, l(y) - beta(y, u)."""

    monomials: Array
    values: Array
    matrix: Array
    measured: Array
    slopes: Array
    x: Array


@dataclass(frozen=True, eq=False, repr=False)
class IdentityObserver(NormalFormObserver):
    """Normal-form observer in identity form, integrated by the classical Runge-Kutta method.

        x^' = f(x^) + L(x^) (l(h(x^)) - l(y) + beta(y, u)),      l(y) = L0 y + ...

    Thomas, Kwatny & Chang, (11), (12) and Remark 3.12. beta injects known inputs, see
    `reobserve.synthesis.normal_form.known_inputs`; without any it is none. `normal_form_observer`
    makes one from expressions.

    `init` takes the state; left out, a run starts from x^ = 0. `run` and `step` take y, shape (k,
    p), and u, (k, m), if there are known inputs. Estimates: ``state``, x^, shape (k, n), in units
    of the system.

    Parameters
    ----------
    normal_form
        The series, of a degree above the order.
    order
        The degree up to which the gain L is kept; 0 is the constant gain.
    gain
        Meaning of a truncated gain: ``series``, ``jacobian`` or ``composed``.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If the order is not below the degree of the normal form, the period not positive, or there
        is no such gain.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import normal_form_observer
    >>> observer = normal_form_observer(["w", "-sin(a) - w/10"], ["a"], ["a", "w"],
    ...                                 poles=[-1.5, -2], order=2, sampling_period=0.02)
    >>> time = 0.02 * np.arange(500)
    >>> run = observer.run(0.3 * np.exp(-time / 20) * np.cos(0.99 * time))  # the angle a
    >>> print(type(observer).__name__, run["state"][-1].round(2))
    IdentityObserver [-0.16  0.09]
    """

    gain: str = field(default="series", kw_only=True, metadata=converter(as_word, GAINS))

    @cached_property
    def _law(self) -> IdentityDynamics:
        form, degree = self.normal_form, self.order + 1
        problem, outer = form.problem, form.problem.injection
        if self.gain == "jacobian" or self.order == 0:
            gain = form.S.upto(degree).jacobian()
        elif self.gain == "series":
            gain = form.gain.upto(self.order)
        else:
            gain, outer = form.S.upto(degree), form.T.upto(degree).jacobian()
        system, injected = problem.system, problem.injection
        fed = injected.after(system.output, injected.degree * system.output.degree)
        kind = GAINS.index(self.gain) if self.order else 0
        inner = polynomials(stacked([system.dynamics, fed, gain]))
        return IdentityDynamics(inner, polynomials(outer), polynomials(form.injected), kind)

    def _values(self, estimate: Array) -> Array:
        return estimate

    def _run(self, known: Samples, rows: Array) -> int:
        law, n = self._law, rows.shape[1]
        buffer = max(len(part.parent) for part in law[:-1])
        sizes = (buffer, len(law.inner.start) - 1, n * n, (3, n), (4, n), n)
        work = IdentityWork(*map(np.empty, sizes))
        return _run(law, work, self.sampling_period, known.right, known.left, rows)

    def _estimates(self, rows: Array) -> dict[str, Array]:
        return {"state": rows}


@kernel
def _run(  # noqa: PLR0912, see below
    law: IdentityDynamics,
    work: IdentityWork,
    step: float,
    known: Array,
    known_before: Array,
    rows: Array,
) -> int:
    """Fill ``rows`` from its first one, and return the number of finite rows.

    The slope stands inside the loop over the four stages of a step: a function of its own would
    be handed all polynomials by value at each of its calls, which takes longer than to evaluate
    them.
    """
    n = rows.shape[1]
    values, measured, slopes, x = work.values, work.measured, work.slopes, work.x
    due = FIRST
    for k in range(len(rows) - 1):
        if k >= due:
            due = poll(k)
        # l(y) - beta(y, u) at the start, the middle and the end of the step
        for j in range(2):
            evaluate(law.injection, known[2 * k + j], work.monomials, measured[j])
        evaluate(law.injection, known_before[2 * k + 2], work.monomials, measured[2])
        for stage in range(4):
            for i in range(n):
                x[i] = rows[k, i]
                if stage > 0:
                    x[i] += (step if stage == 3 else 0.5 * step) * slopes[stage - 1, i]
            # x^' = f(x^) + L(x^) e,   e = l(h(x^)) - l(y) + beta(y, u): (11)
            evaluate(law.inner, x, work.monomials, values)
            for i in range(n):
                values[n + i] -= measured[(stage + 1) // 2, i]
            # L(x^) e = (dS/dx)^-1 e
            if law.kind == 1:
                solve_in_place(values[2 * n :].reshape((n, n)), values[n : 2 * n])
                for i in range(n):
                    slopes[stage, i] = values[i] + values[n + i]
                continue
            matrix = values[2 * n :]
            # L(x^) = dT/dz at z = S(x^)
            if law.kind == 2:
                evaluate(law.outer, matrix, work.monomials, work.matrix)
                matrix = work.matrix
            for i in range(n):
                slopes[stage, i] = values[i]
                for j in range(n):
                    slopes[stage, i] += matrix[i * n + j] * values[n + j]
        # x^(t + h) = x^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
        for i in range(n):
            mean = slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i]
            after = rows[k, i] + step / 6.0 * mean
            if not np.isfinite(after):
                return k + 1
            rows[k + 1, i] = after
    return len(rows)

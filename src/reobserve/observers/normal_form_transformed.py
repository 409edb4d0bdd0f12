"""Transformed form of a normal-form observer (Thomas, Kwatny & Chang, (9), (10) and (12)).

The dynamics are linear, so they are not integrated but discretised exactly, for an injection
that runs through its three samples of a step as a parabola; that has order 4, as Simpson's rule
has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.finite import finite
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.observers.fixed_step import Samples
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.polynomials.evaluation_kernels import Polynomials, evaluate, polynomials
from reobserve.polynomials.maps import PolynomialMap

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class TransformedObserver(NormalFormObserver):
    """Normal-form observer in transformed form, with T up to the degree ``order + 1``.

        z' = A z - l(y) + beta(y, u),      x^ = T(z)

    Thomas, Kwatny & Chang, (6), (7), (9), (10), (12) and Remark 3.12. beta injects known inputs,
    see `reobserve.synthesis.normal_form.known_inputs`; without any it is none. The start is z =
    S(x^). `normal_form_observer` makes one from expressions.

    `init` takes the state x^; left out, a run starts from x^ = 0. `run` and `step` take y, shape
    (k, p), and u, (k, m), if there are known inputs. Estimates: ``state``, x^, in units of the
    system, and ``coordinates``, z, both of shape (k, n).

    Parameters
    ----------
    normal_form
        The series, of a degree above the order.
    order
        The degree up to which the gain L is kept; 0 is the constant gain.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If the order is not below the degree of the normal form, or the period not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import normal_form_observer
    >>> observer = normal_form_observer(["w", "-sin(a) - w/10"], ["a"], ["a", "w"],
    ...                                 poles=[-1.5, -2], order=2, sampling_period=0.02,
    ...                                 form="transformed")
    >>> time = 0.02 * np.arange(500)
    >>> run = observer.run(0.3 * np.exp(-time / 20) * np.cos(0.99 * time))  # the angle a
    >>> print(type(observer).__name__, run["state"][-1].round(2))
    TransformedObserver [-0.16  0.09]
    """

    units: ClassVar[Mapping[str, str]] = {"state": "", "coordinates": ""}

    @cached_property
    def T(self) -> PolynomialMap:
        """T as it is used here."""
        return self.normal_form.T.upto(self.order + 1)

    @cached_property
    def _transition(self) -> tuple[Array, Array]:
        """e^(A h), and the weights of l(y) at the start, the middle and the end of a step."""
        from scipy.linalg import expm

        A, h = self.normal_form.problem.A, self.sampling_period
        n = len(A)
        # The exponential of this block matrix holds in its first row e^(A h) and the integrals
        # of e^(A (h - s)) s^k / k! over a step, k = 0, 1, 2.
        chain = np.zeros((4 * n, 4 * n))
        chain[:n, :n] = A
        for k in range(3):
            chain[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
        row = expm(chain * h)[:n].reshape(n, 4, n)
        I0, I1, I2 = row[:, 1], row[:, 2] / h, 2.0 * row[:, 3] / h**2
        weights = np.array([I0 - 3.0 * I1 + 2.0 * I2, 4.0 * I1 - 4.0 * I2, 2.0 * I2 - I1])
        return np.ascontiguousarray(row[:, 0]), weights

    @finite("state")
    def _values(self, estimate: Array) -> Array:
        # Of series in fractions the values are no floats.
        return np.asarray(self.normal_form.S.upto(self.order + 1)(estimate), dtype=np.float64)

    def _run(self, known: Samples, rows: Array) -> int:
        transition, weights = self._transition
        injection = polynomials(self.normal_form.injected)
        work = np.empty(len(injection.parent)), np.empty((3, rows.shape[1]))
        return _run(transition, weights, injection, work, known.right, known.left, rows)

    def _estimates(self, rows: Array) -> dict[str, Array]:
        estimate, T = np.empty_like(rows), polynomials(self.T)
        _evaluate_rows(T, np.empty(len(T.parent)), rows, estimate)
        return {"state": estimate, "coordinates": rows}


@kernel
def _run(
    transition: Array,
    weights: Array,
    injection: Polynomials,
    work: tuple[Array, Array],
    known: Array,
    known_before: Array,
    rows: Array,
) -> int:
    """Fill ``rows`` from its first one, and return the number of finite rows."""
    n = rows.shape[1]
    buffer, fed = work
    due = FIRST
    for k in range(len(rows) - 1):
        if k >= due:
            due = poll(k)
        # g = l(y) - beta(y, u) at the start, the middle and the end of the step
        for j in range(2):
            evaluate(injection, known[2 * k + j], buffer, fed[j])
        evaluate(injection, known_before[2 * k + 2], buffer, fed[2])
        # z(t + h) = e^(A h) z(t) - W0 g(t) - W1 g(t + h/2) - W2 g(t + h)
        for i in range(n):
            after = 0.0
            for c in range(n):
                after += transition[i, c] * rows[k, c]
                for j in range(3):
                    after -= weights[j, i, c] * fed[j, c]
            if not np.isfinite(after):
                return k + 1
            rows[k + 1, i] = after
    return len(rows)


@kernel
def _evaluate_rows(source: Polynomials, buffer: Array, rows: Array, out: Array) -> None:
    # x^ = T(z)
    for k in range(len(rows)):
        evaluate(source, rows[k], buffer, out[k])

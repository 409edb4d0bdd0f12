"""Normal-form observers of a polynomial system (Thomas, Kwatny & Chang, (9) to (12)).

The identity form integrates x^. The paper prints y - h(x^) in (11); with A = F + L0 H the error
then obeys F - L0 H, so the sign here is that of (8). A truncated gain is read in one of the three
ways that `reobserve.synthesis.normal_form.identity_gain` lists.

The transformed form has linear dynamics, so they are not integrated but discretised exactly, for
an injection that runs through its three samples of a step as a parabola; that has order 4, as
Simpson's rule has.

`normal_form_observer` makes either of them for a user-defined system, in one call.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind, as_whole, as_word
from reobserve.core.errors import InputError, shown
from reobserve.core.finite import finite
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import kernel
from reobserve.core.matrices import as_floats, as_vector
from reobserve.core.small_systems import solve_in_place
from reobserve.core.value import Value, converter
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.fixed_step import Samples, Steps
from reobserve.observers.record import Rows, check_state
from reobserve.observers.run import Run
from reobserve.polynomials.evaluation_kernels import Polynomials, evaluate, polynomials
from reobserve.polynomials.expressions import from_expressions
from reobserve.polynomials.maps import PolynomialMap, stacked
from reobserve.synthesis.normal_form.convergence import convergence, warning
from reobserve.synthesis.normal_form.identity_gain import GAINS
from reobserve.synthesis.normal_form.known_inputs import split
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve.systems.polynomial import PolynomialSystem

Array = NDArray[np.float64]

FORMS = ("identity", "transformed")


class ConvergenceWarning(UserWarning):
    """A trajectory leaves the domain in which the series of its observer converges."""


@dataclass(frozen=True, eq=False, repr=False)
class NormalFormState(Value):
    """All an observer remembers: a value that may be stored, copied and stepped again.

    ``values`` are x^ or, for the transformed form, z, shape (n,); the rest is as in
    `reobserve.observers.record.ObserverState`.
    """

    values: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class NormalFormObserver(IntegratingObserver[NormalFormState]):
    """Base class of normal-form observers, which estimate x from y and known inputs.

    Its estimate is ``state``, x^, shape (k, n). Without a state a run starts from x^ = 0, the
    equilibrium about which the series are expanded.

    Parameters
    ----------
    normal_form
        The series, of a degree above the order.
    order
        The degree up to which the gain L is kept, as the paper counts; S and T are kept up to
        one degree more. Order 0 is the constant gain.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If the order is not from 0 to the degree of the normal form less one, or the period not
        positive.
    """

    normal_form: NormalForm = field(metadata=converter(as_kind, NormalForm))
    order: int = field(kw_only=True)

    units: ClassVar[Mapping[str, str]] = {"state": ""}

    def __post_init__(self) -> None:
        super().__post_init__()
        highest = self.normal_form.problem.degree - 1
        whole = isinstance(self.order, int | np.integer) and not isinstance(self.order, bool)
        if not whole or not 0 <= self.order <= highest:
            raise InputError(
                "order",
                f"{shown(self.order)} must be from 0 to {highest}, one less than the degree of "
                "the series",
            )
        self._set("order", int(self.order))

    @property
    def measurements(self) -> int:
        """p, the number of outputs of the system."""
        return self.normal_form.problem.system.outputs

    @property
    def inputs(self) -> int:
        """m, the number of known inputs of the system."""
        return self.normal_form.inputs

    @abstractmethod
    def _values(self, estimate: Array) -> Array:
        """The values that a state holds for an estimate of x."""

    @abstractmethod
    def _run(self, known: Samples, rows: Array) -> int:
        """Run the compiled loop, fill ``rows`` from the first, and return how many are finite.

        ``known`` has the columns of y and then those of u.
        """

    @abstractmethod
    def _estimates(self, rows: Array) -> dict[str, Array]:
        """The estimates, by name, of rows of such values."""

    def init(self, state: ArrayLike) -> NormalFormState:
        """The state at the first sample, from an estimate of x, shape (n,).

        Raises
        ------
        InputError
            If it is not n finite numbers.
        """
        n = self.normal_form.problem.system.states
        return NormalFormState(self._values(as_vector("state", state, n)))

    def _start(self, first: Array) -> NormalFormState:
        return self.init(np.zeros(self.normal_form.problem.system.states))

    def _checked(self, state: Any) -> NormalFormState:
        n = self.normal_form.problem.system.states
        p, m = self.measurements, self.inputs
        inputs_too = f", {m} inputs" if m else ""
        problem = f"must be of an observer of {n} states{inputs_too} and {p} outputs"
        return check_state(state, NormalFormState, problem, values=(n,), sample=(p + m,))

    def _integrate(self, state: NormalFormState, steps: Steps) -> Rows:
        known = steps.y
        if self.inputs:
            known = Samples(*(np.hstack(sides) for sides in zip(steps.y, steps.u, strict=True)))
        rows = np.empty((known.steps + 1, len(state.values)))
        rows[0] = state.values
        finite = self._run(known, rows)
        after = NormalFormState(rows[-1].copy(), state.sample, state.count + known.steps)
        return Rows(self._estimates(rows[:finite]), finite, after)

    def check_domain(self, run: Run[NormalFormState]) -> str | None:
        """Warn if the estimates of a run leave the domain in which S converges.

        The radius is estimated from the parts of S, for which the normal form must be of a
        degree well above the order.

        Returns
        -------
        str or None
            The sentence of the `ConvergenceWarning` that was given.

        Raises
        ------
        InputError
            If the series is too short for an estimate.
        """
        sentence = warning(convergence(self.normal_form.S), run["state"], self.sampling_period)
        if sentence is not None:
            warnings.warn(sentence, ConvergenceWarning, stacklevel=2)
        return sentence


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
        law, work = self._law, self._work(rows.shape[1])
        return _run_identity(law, work, self.sampling_period, known.right, known.left, rows)

    def _work(self, n: int) -> IdentityWork:
        """Arrays for steps of n states."""
        buffer = max(len(part.parent) for part in self._law[:-1])
        sizes: Any = (buffer, len(self._law.inner.start) - 1, n * n, (3, n), (4, n), n)
        return IdentityWork(*map(np.empty, sizes))

    def _estimates(self, rows: Array) -> dict[str, Array]:
        return {"state": rows}


@kernel
def _run_identity(  # noqa: PLR0912, see below
    law: IdentityDynamics,
    work: IdentityWork,
    step: float,
    known: Array,
    known_before: Array,
    rows: Array,
) -> int:
    """Fill ``rows``, x^, from its first one, and return the number of finite rows.

    Thomas, Kwatny & Chang, (11) and (12).

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
        return _run_transformed(transition, weights, injection, work, known.right, known.left, rows)

    def _estimates(self, rows: Array) -> dict[str, Array]:
        estimate, T = np.empty_like(rows), polynomials(self.T)
        _evaluate_rows(T, np.empty(len(T.parent)), rows, estimate)
        return {"state": estimate, "coordinates": rows}


@kernel
def _run_transformed(
    transition: Array,
    weights: Array,
    injection: Polynomials,
    work: tuple[Array, Array],
    known: Array,
    known_before: Array,
    rows: Array,
) -> int:
    """Fill ``rows``, z, from its first one, and return the number of finite rows.

    Thomas, Kwatny & Chang, (9) and (12).
    """
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
    """Write the estimates of rows (Thomas, Kwatny & Chang, (10))."""
    # x^ = T(z)
    for k in range(len(rows)):
        evaluate(source, rows[k], buffer, out[k])


def normal_form_observer(
    dynamics: Sequence[Any],
    output: Sequence[Any],
    variables: Sequence[Any],
    *,
    order: int,
    sampling_period: float,
    poles: Sequence[complex] | None = None,
    injection: ArrayLike | None = None,
    form: str = "identity",
    gain: str = "series",
    degree: int | None = None,
    expanded: int = 9,
    inputs: Sequence[Any] = (),
    higher: Sequence[Any] | None = None,
) -> NormalFormObserver:
    """The normal-form observer of a system x' = f(x), y = h(x) given by expressions.

    Thomas, Kwatny & Chang, (9) to (11). Its error is linear in the coordinates z = S(x): it moves
    as e' = A e, where A = F + L0 H has the poles.

    Known inputs may enter the dynamics wherever the errors stay linear for it: see
    `reobserve.synthesis.normal_form.known_inputs`, and ``degree``, up to which that is checked.

    Parameters
    ----------
    dynamics, output
        f(x) and h(x): expressions of sympy, or text that it reads; zero at the origin.
    variables
        The n states: symbols, or their names.
    order
        Of the gain; 0 is the constant gain.
    sampling_period
        [s].
    poles
        The eigenvalues [1/s] of the error dynamics, n of them.
    injection
        Or instead of poles: L0, shape (n, p).
    form
        ``identity`` or ``transformed``.
    gain
        How an identity observer reads a truncated gain: ``series``, ``jacobian``, ``composed``.
    degree
        Of the series; ``order + 1`` if it is left out, which is all that the observer needs. A
        higher one lets `NormalFormObserver.check_domain` estimate where they converge.
    expanded
        The degree up to which f and h are expanded, at least that of the series: what is no
        polynomial of this degree is truncated, also in the model that the observer runs on.
    inputs
        Known inputs that stand in the dynamics: symbols, or their names.
    higher
        n expressions in y1 to yp: the terms of l(y) beyond the linear ones.

    Raises
    ------
    InputError
        That says what of the system, the poles or the injection cannot be used, and why.

    Examples
    --------
    >>> from reobserve import normal_form_observer
    >>> observer = normal_form_observer(["w", "-sin(a) - w/10"], ["a"], ["a", "w"],
    ...                                 poles=[-1.5, -2], order=2, sampling_period=0.02)
    >>> print(observer.run([0.3, 0.3, 0.3])["state"][-1].round(3))
    [0.039 0.018]
    """
    as_word("form", form, FORMS)
    order = as_whole("order", order, 0)
    for name, value in (("variables", variables), ("inputs", inputs)):
        if not isinstance(value, list | tuple):
            raise InputError(name, f"{shown(value)} must be a list")
    driven, gain = len(inputs) > 0, as_word("gain", gain, GAINS)
    # What inputs must not do shows one degree above what the observer needs.
    least = order + 1 + driven
    highest = max(least, 0 if degree is None else as_whole("degree", degree, 0))
    expansion = max(highest, as_whole("expanded", expanded, 0))
    effect = None
    if driven:
        known = [*variables, *inputs]
        field = from_expressions("dynamics", dynamics, known, expansion)
        autonomous, effect = split(field, len(variables))
        read = from_expressions("output", output, variables, expansion)
        system = PolynomialSystem(autonomous, read)
    else:
        system = PolynomialSystem.from_expressions(dynamics, output, variables, expansion)
    matrix = None
    if injection is not None:
        values = as_floats("injection", injection)
        if values.shape != (system.states, system.outputs):
            raise InputError(
                "injection",
                f"has shape {values.shape}, must be {(system.states, system.outputs)}",
            )
        matrix = PolynomialMap.linear(values)
    added = None
    if higher is not None:
        outputs = [f"y{place + 1}" for place in range(system.outputs)]
        added = _higher(from_expressions("higher", higher, outputs, expansion), system.states)
    names = [str(symbol) for symbol in (*variables, *inputs)]
    series = normal_form(
        system, highest, injection=matrix, poles=poles, higher=added, effect=effect, names=names
    )
    if form == "identity":
        return IdentityObserver(series, order=order, gain=gain, sampling_period=sampling_period)
    return TransformedObserver(series, order=order, sampling_period=sampling_period)


def _higher(terms: PolynomialMap, states: int) -> PolynomialMap:
    """The terms of l(y) beyond the linear ones, as many components as there are states."""
    if terms.components != states:
        raise InputError("higher", f"has {terms.components} expressions, must have {states}")
    low = terms.coefficients[:, : terms.variables + 1].any(axis=1)
    if low.any():
        raise InputError(
            f"higher[{int(low.argmax())}]", "has terms below degree 2, which the poles decide"
        )
    return terms

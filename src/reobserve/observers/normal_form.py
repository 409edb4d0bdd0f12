"""A normal-form observer for a user-defined system, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from reobserve.core.arguments import as_whole, as_word
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.observers.normal_form_transformed import TransformedObserver
from reobserve.polynomials.expressions import from_expressions
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.known_inputs import split
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.systems.polynomial import PolynomialSystem

FORMS = ("identity", "transformed")


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
    driven = len(inputs) > 0
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

"""Known inputs of a normal-form observer: when the errors stay linear, and what is injected then.

Of x' = f(x) + b(x, u), y = h(x) with b(x, 0) = 0, the coordinates z = S(x) of the system without
inputs move by

    z' = A z - l(y) + S'(x) b(x, u).

Where the last term is a function beta(y, u) of what is known, the observer injects it too, and

    z^' = A z^ - l(y) + beta(y, u)

has the same error dynamics (z - z^)' = A (z - z^) whatever the input does. Where it is not, no
observer of this form has linear errors: another l(y) gives another S, for which it may be.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.polynomials.arithmetic import add_applied, zeros
from reobserve.polynomials.maps import PolynomialMap, stacked
from reobserve.polynomials.monomials import monomials

_ZERO = 1e-9  # of the largest coefficient: what counts as none after the series


def split(field: PolynomialMap, states: int) -> tuple[PolynomialMap, PolynomialMap]:
    """f(x) in the first variables alone, and b(x, u): the terms of a field that have an input."""
    driven = field.basis.exponents[:, states:].any(axis=1)
    basis = monomials(states, field.degree)
    table = zeros((field.components, len(basis.exponents)), field.coefficients)
    for place in np.flatnonzero(~driven):
        powers = tuple(int(power) for power in field.basis.exponents[place, :states])
        table[:, basis.place(powers)] = field.coefficients[:, place]
    effect = np.where(driven, field.coefficients, 0.0)
    return PolynomialMap(basis, table), PolynomialMap(field.basis, effect)


def input_injection(
    S: PolynomialMap, output: PolynomialMap, effect: PolynomialMap, names: Sequence[str] = ()
) -> PolynomialMap:
    """beta(y, u), n components in p + m variables.

    It is found, and the condition checked, up to the degree in x up to which S'(x) is known, one
    less than that of S.

    Parameters
    ----------
    S, output
        S(x) and h(x), in n variables.
    effect
        b(x, u), in n + m variables.
    names
        Of states and inputs, for the message.
    """
    n, m = S.variables, effect.variables - S.variables
    known, powers = S.degree - 1, effect.basis.exponents
    present = np.any(effect.coefficients != 0, axis=0)
    most = int(powers[present, n:].sum(axis=1).max(initial=1))
    degree = max(known + most, 1)
    basis = monomials(n + m, degree)
    slope = _lifted(S.jacobian(), n + m, degree).coefficients
    wanted = np.zeros((n, len(basis.exponents)))
    driving = effect.upto(degree).coefficients
    for total in range(degree + 1):
        for r in range(total + 1):
            add_applied(basis, slope, driving, r, total - r, wanted)

    read = stacked([_lifted(output, n + m, degree), _inputs(n, m, degree)])
    p = output.components
    outer = monomials(p + m, degree)
    fed = (outer.exponents[:, p:].sum(axis=1) > 0) & (outer.exponents[:, :p].sum(axis=1) <= known)
    terms = np.flatnonzero(fed)
    each = PolynomialMap(outer, np.eye(len(outer.exponents))[terms]).after(read, degree)
    right = basis.exponents[:, :n].sum(axis=1) <= known
    fit, *_ = np.linalg.lstsq(each.coefficients[:, right].T, wanted[:, right].T, rcond=None)
    off = (fit.T @ each.coefficients - wanted)[:, right]
    scale = float(np.abs(wanted[:, right]).max(initial=0.0))
    if off.size and float(np.abs(off).max()) > _ZERO * scale:
        row, column = np.unravel_index(int(np.argmax(np.abs(off))), off.shape)
        term = _spelled(basis.exponents[right][column], names)
        raise InputError(
            "inputs",
            "must enter so that S'(x) b(x, u) is a function of y and u, for the error to stay "
            f"linear; its component {row + 1} has a term in {term} that is none: measure more, or "
            "choose an injection l(y) with another S",
        )
    table = np.zeros((n, len(outer.exponents)))
    table[:, terms] = fit.T
    table[np.abs(table) <= 1e-13 * scale] = 0.0  # rounding of what is solved for
    return PolynomialMap(outer, table)


def joined(injection: PolynomialMap, beta: PolynomialMap) -> PolynomialMap:
    """l(y) - beta(y, u): what an observer injects of a row of y and u."""
    degree = max(injection.degree, beta.degree)
    known = _lifted(injection, beta.variables, degree)
    return PolynomialMap(known.basis, known.coefficients - beta.upto(degree).coefficients)


def _lifted(source: PolynomialMap, variables: int, degree: int) -> PolynomialMap:
    """The same polynomials up to a degree, with more variables after their own."""
    basis = monomials(variables, degree)
    more = (0,) * (variables - source.variables)
    kept = source.upto(degree)
    places = [
        basis.place((*(int(power) for power in powers), *more)) for powers in kept.basis.exponents
    ]
    table = np.zeros((source.components, len(basis.exponents)))
    table[:, places] = kept.coefficients
    return PolynomialMap(basis, table)


def _inputs(states: int, inputs: int, degree: int) -> PolynomialMap:
    """The inputs themselves, among states and inputs."""
    return PolynomialMap.linear(np.eye(states + inputs)[states:]).upto(degree)


def _spelled(powers: NDArray[np.int32], names: Sequence[str]) -> str:
    listed = names or [f"v{place + 1}" for place in range(len(powers))]
    return " ".join(
        name if power == 1 else f"{name}^{power}"
        for name, power in zip(listed, powers, strict=True)
        if power
    )

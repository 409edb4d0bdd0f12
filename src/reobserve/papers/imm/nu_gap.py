"""The nu-gap between two linear plants with one input and one output (Vinnicombe 1993).

It measures how differently two plants can behave in closed loop: a controller that stabilises one
of them with a margin above the gap also stabilises the other (Zhou & Doyle 1998, chapter 17).

For P_i = n_i / d_i of order m_i it is, if a winding condition holds, the maximum chordal distance
of P_1(j omega) and P_2(j omega) on the Riemann sphere, over all omega,

    kappa = |n_1 d_2 - n_2 d_1| / (|g_1| |g_2|),    |g_i|^2 = |n_i|^2 + |d_i|^2,

and 1 otherwise. The condition: with stable g_i, the normalised graph symbols G_i = (n_i, d_i) / g_i
must give a G_2^* G_1 = phi(s) / (g_2(-s) g_1(s)) of winding number 0 and no zero on the axis, where

    phi(s) = n_2(-s) n_1(s) + d_2(-s) d_1(s).

The m_1 roots of g_1(s) are on the left and the m_2 of g_2(-s) on the right. So must those of phi
be: m_1 on the left, m_2 on the right. Divided by d_2(-s) d_1(s), whose roots are poles of P_1 and
mirrored poles of P_2, this is Vinnicombe's wno(1 + P_2^* P_1) + eta(P_1) - eta~(P_2) = 0, for poles
in the open and the closed right half plane and clockwise turns. As |phi|^2 / (|g_1| |g_2|)^2 is
1 - kappa^2, a root of phi on the axis, or at infinity, means a gap of 1 in either case.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise, zip_longest

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Plant = tuple[Array, Array]  # numerator and denominator, of one length
Exact = list[Fraction]  # a polynomial from the highest power down, the first not zero


def nu_gap(first: tuple[ArrayLike, ArrayLike], second: tuple[ArrayLike, ArrayLike]) -> float:
    """The nu-gap, from 0 (equal plants) to 1.

    Parameters
    ----------
    first, second
        Numerator and denominator of a proper transfer function in continuous time [s in 1/s]: real
        coefficients from the highest power down. Common factors and the winding condition are
        computed from them exactly.

    Raises
    ------
    InputError
        If a polynomial is no list of finite numbers or is zero, a numerator is of higher degree
        than its denominator, or the two have a factor in common.
    """
    plants = _plant("first", first), _plant("second", second)
    if not _winding_condition(*plants):
        return 1.0
    return _maximum_distance(*_scaled(*plants))


def _plant(name: str, pair: tuple[ArrayLike, ArrayLike]) -> Plant:
    if not isinstance(pair, list | tuple):
        raise InputError(name, f"{shown(pair)} must be a pair of numerator and denominator")
    if len(pair) != 2:
        raise InputError(name, f"has {len(pair)} entries, must be a numerator and a denominator")
    numerator = _polynomial(f"{name}.numerator", pair[0])
    denominator = _polynomial(f"{name}.denominator", pair[1])
    padding = len(denominator) - len(numerator)
    if padding < 0:
        raise InputError(
            name,
            f"has a numerator of degree {len(numerator) - 1}, "
            f"must not exceed that of the denominator, {len(denominator) - 1}",
        )
    common = _remainders(_exact(denominator), _exact(numerator))[-1]
    if len(common) > 1:
        listed = [float(c / common[0]) for c in common]
        raise InputError(
            name, f"has the factor {listed} in numerator and denominator, must have none in common"
        )
    return np.pad(numerator, (padding, 0)), denominator


def _polynomial(name: str, coefficients: ArrayLike) -> Array:
    array = as_floats(name, coefficients)
    if array.ndim != 1 or not array.any():
        raise InputError(
            name, f"{array.tolist()} must be a list of coefficients, one of them not zero"
        )
    return np.trim_zeros(array, "f")


# --- The winding condition, in rational arithmetic ----------------------------------------------


def _winding_condition(first: Plant, second: Plant) -> bool:
    """Whether the phase of phi(j omega) rises by (m_1 - m_2) pi, but for roots on the axis.

    Exact, because rounding could move roots of phi of lightly damped plants across the axis.
    """
    phi = [Fraction(0)] * (len(first[1]) + len(second[1]) - 1)
    for one, other in zip(first, second, strict=True):
        for i, a in enumerate(_exact(one)[::-1]):
            for j, b in enumerate(_exact(other)[::-1]):
                phi[i + j] += (-1) ** j * a * b
    # Real and imaginary part of phi(j omega), as polynomials in omega.
    real = [(1, 0, -1, 0)[k % 4] * c for k, c in enumerate(phi)]
    imaginary = [(0, 1, 0, -1)[k % 4] * c for k, c in enumerate(phi)]
    turns = _half_turns(_trimmed(real[::-1]), _trimmed(imaginary[::-1]))
    return turns == len(first[1]) - len(second[1])


def _half_turns(real: Exact, imaginary: Exact) -> int:
    """By how many times pi the phase of real + j imaginary rises over the axis (Sturm, Cauchy)."""
    if len(imaginary) > len(real):  # a quarter turn back: the phase rises as much
        real, imaginary = imaginary, [-c for c in real]
    chain = _remainders(real, imaginary)
    after = [p[0] > 0 for p in chain if p]
    before = [(p[0] > 0) == (len(p) % 2 == 1) for p in chain if p]
    return sum(a != b for a, b in pairwise(after)) - sum(a != b for a, b in pairwise(before))


def _remainders(p: Exact, q: Exact) -> list[Exact]:
    """p, q and the negated remainders of Euclid's division: a Sturm chain, the last one the gcd."""
    chain = [p]
    while q:
        chain.append(q)
        rest = p
        while len(rest) >= len(q):
            factor = rest[0] / q[0]
            pairs = zip_longest(rest, q, fillvalue=Fraction(0))
            rest = [a - factor * b for a, b in pairs][1:]
        p, q = q, _trimmed([-c for c in rest])
    return chain


def _exact(polynomial: Array) -> Exact:
    return _trimmed([Fraction(float(c)) for c in polynomial])


def _trimmed(polynomial: Sequence[Fraction]) -> Exact:
    start = next((i for i, c in enumerate(polynomial) if c), len(polynomial))
    return list(polynomial[start:])


# --- The maximum chordal distance ---------------------------------------------------------------


def _scaled(first: Plant, second: Plant) -> tuple[Plant, Plant]:
    """The plants with frequency in units of the geometric mean of the roots of g_1 and g_2.

    This leaves a supremum over all frequencies as it is, and makes coefficients similar in size.
    """
    plants = first, second
    order = sum(len(d) - 1 for _, d in plants)
    ends = [np.log(np.hypot(n[-1], d[-1]) / np.hypot(n[0], d[0])) for n, d in plants]
    unit = np.exp(sum(ends) / max(order, 1))

    def scale(numerator: Array, denominator: Array) -> Plant:
        powers = unit ** np.arange(len(denominator) - 1.0, -1, -1)
        size = np.max(np.abs([numerator * powers, denominator * powers]))
        return numerator * powers / size, denominator * powers / size

    return scale(*first), scale(*second)


def _maximum_distance(first: Plant, second: Plant) -> float:
    """The supremum of kappa over omega = tan(angle), for angles from 0 to pi/2.

    Between neighbouring stationary points kappa is monotone. They are roots of a polynomial and
    thus rounded, so each is refined by a search up to its neighbours on both sides.
    """
    stationary = np.arctan(_stationary_frequencies(first, second))
    angles = np.concatenate([[0.0], np.sort(stationary), [np.pi / 2]])
    low = np.concatenate([angles[:1], angles[:-1]])
    high = np.concatenate([angles[1:], angles[-1:]])
    maximum = float(np.max(_distance(first, second, angles)))
    columns = np.arange(len(angles))
    for _ in range(12):  # each narrows the intervals by 16
        grid = np.linspace(low, high, 33)
        distance = _distance(first, second, grid)
        maximum = max(maximum, float(np.max(distance)))
        best = np.argmax(distance, axis=0)
        low = grid[np.maximum(best - 1, 0), columns]
        high = grid[np.minimum(best + 1, 32), columns]
    return min(maximum, 1.0)


def _stationary_frequencies(first: Plant, second: Plant) -> Array:
    """Absolute values of all omega, complex ones too, where the derivative of kappa^2 is zero."""
    (n1, d1), (n2, d2) = first, second
    above = _square(np.convolve(n1, d2) - np.convolve(n2, d1))
    below = np.convolve(_square(n1) + _square(d1), _square(n2) + _square(d2))
    powers = np.arange(len(above) - 1.0, -1, -1)  # the derivatives: times its power, one place on
    rise = np.convolve(np.roll(above * powers, 1), below)
    fall = np.convolve(above, np.roll(below * powers, 1))
    found: Array = np.sqrt(np.abs(np.roots(rise - fall)))
    return found


def _square(polynomial: Array) -> Array:
    """|p(j omega)|^2 as a polynomial in omega^2."""
    signs = (-1.0) ** np.arange(len(polynomial))
    square: Array = np.convolve(polynomial, polynomial * signs)[::2] * signs
    return square


def _distance(first: Plant, second: Plant, angle: Array) -> Array:
    """kappa at omega = tan(angle), without dividing: poles and pi/2 are angles like any other."""
    (n1, d1), (n2, d2) = (
        (_on_circle(numerator, angle), _on_circle(denominator, angle))
        for numerator, denominator in (first, second)
    )
    lengths = np.hypot(np.abs(n1), np.abs(d1)) * np.hypot(np.abs(n2), np.abs(d2))
    distance: Array = np.abs(n1 * d2 - n2 * d1) / lengths
    return distance


def _on_circle(polynomial: Array, angle: Array) -> Complex:
    """p(j tan(angle)) cos(angle)^m for a polynomial with m + 1 coefficients, by Horner's rule."""
    cosine, sine = np.cos(angle), 1j * np.sin(angle)
    value = np.full(angle.shape, polynomial[0], dtype=np.complex128)
    power = np.ones(angle.shape)
    for coefficient in polynomial[1:]:
        power = power * cosine
        value = value * sine + coefficient * power
    return value

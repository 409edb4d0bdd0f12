"""Taylor coefficients of functions of one argument, by the recurrences of their equations.

Numbers are those of mpmath, with so many digits that what is left after rounding to floats is
right: the functions are quotients, integrals and powers of a few simple series.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Series = list[Any]

DIGITS = 60


def taylor(name: str, centre: str, degree: int) -> Series:
    """The coefficients of the function ``name`` at a real centre, up to a degree.

    Raises
    ------
    ValueError
        If it has no real Taylor series there.
    """
    import mpmath

    with mpmath.workdps(DIGITS + degree):
        return _SERIES[name](mpmath.mpf(centre), degree)


def power(exponent: str, centre: str, degree: int) -> Series:
    """The coefficients of t^exponent at a real centre; `ValueError` if there are none."""
    import mpmath

    with mpmath.workdps(DIGITS + degree):
        a, c = mpmath.mpf(exponent), mpmath.mpf(centre)
        if c == 0 or (c < 0 and a != int(a)):
            raise ValueError
        return _raised([c, mpmath.mpf(1)], a, degree)


def _raised(p: Series, a: Any, degree: int) -> Series:
    """p^a for a polynomial p with p(0) not zero, by p (p^a)' = a p' p^a."""
    if p[0] == 0 or (p[0] < 0 and a != int(a)):
        raise ValueError
    out = [p[0] ** (int(a) if a == int(a) else a)]
    for k in range(1, degree + 1):
        terms = range(1, min(k, len(p) - 1) + 1)
        out.append(sum((a * i - (k - i)) * p[i] * out[k - i] for i in terms) / (k * p[0]))
    return out


def _quotient(above: Series, below: Series) -> Series:
    if below[0] == 0:
        raise ValueError
    out: Series = []
    for k, value in enumerate(above):
        out.append((value - sum(below[i] * out[k - i] for i in range(1, k + 1))) / below[0])
    return out


def _integral(start: Any, slope: Series) -> Series:
    return [start, *(value / (k + 1) for k, value in enumerate(slope))]


def _exponential(c: Any, degree: int, *, signs: tuple[Any, ...] = ()) -> Series:
    """Of f with the derivatives ``signs`` at the centre, over and over again."""
    import mpmath

    values = signs or (mpmath.exp(c),)
    return [values[k % len(values)] / mpmath.factorial(k) for k in range(degree + 1)]


def _trigonometric(c: Any, degree: int) -> tuple[Series, Series]:
    import mpmath

    s, k = mpmath.sin(c), mpmath.cos(c)
    return _exponential(c, degree, signs=(s, k, -s, -k)), _exponential(
        c, degree, signs=(k, -s, -k, s)
    )


def _hyperbolic(c: Any, degree: int) -> tuple[Series, Series]:
    import mpmath

    s, k = mpmath.sinh(c), mpmath.cosh(c)
    return _exponential(c, degree, signs=(s, k)), _exponential(c, degree, signs=(k, s))


def _ratio(pair: Callable[[Any, int], tuple[Series, Series]], above: int | None, below: int) -> Any:
    """One of the two functions over the other, or one over it."""

    def series(c: Any, degree: int) -> Series:
        both = pair(c, degree)
        one = [c * 0 + 1] + [c * 0] * degree
        return _quotient(one if above is None else both[above], both[below])

    return series


def _inverse(name: str, square: int, constant: int, exponent: float, sign: int = 1) -> Any:
    """A function whose slope is sign (constant + square u^2)^exponent."""

    def series(c: Any, degree: int) -> Series:
        import mpmath

        inner = [constant + square * c * c, 2 * square * c, mpmath.mpf(square)]
        if inner[0] <= 0 or (name == "acosh" and c <= 1):
            raise ValueError
        slope = _raised(inner, mpmath.mpf(exponent), max(degree - 1, 0))
        return _integral(getattr(mpmath, name)(c), [sign * value for value in slope])[: degree + 1]

    return series


def _log(c: Any, degree: int) -> Series:
    import mpmath

    if c <= 0:
        raise ValueError
    return [mpmath.log(c), *((-1) ** (k + 1) / (k * c**k) for k in range(1, degree + 1))]


def _erf(c: Any, degree: int) -> Series:
    import mpmath

    slope = [2 / mpmath.sqrt(mpmath.pi) * mpmath.exp(-c * c)]
    for k in range(1, degree + 1):  # of exp(p): the slope is p' times it, p' = -2 (c + t)
        before = slope[k - 2] if k > 1 else 0
        slope.append(-2 * (c * slope[k - 1] + before) / k)
    return _integral(mpmath.erf(c), slope)[: degree + 1]


def _sinc(c: Any, degree: int) -> Series:
    import mpmath

    if c == 0:
        return [
            (-1) ** (k // 2) / mpmath.factorial(k + 1) if k % 2 == 0 else mpmath.mpf(0)
            for k in range(degree + 1)
        ]
    return _quotient(_trigonometric(c, degree)[0], [c, mpmath.mpf(1)] + [c * 0] * degree)


_SERIES: dict[str, Callable[[Any, int], Series]] = {
    "exp": _exponential,
    "log": _log,
    "sin": lambda c, degree: _trigonometric(c, degree)[0],
    "cos": lambda c, degree: _trigonometric(c, degree)[1],
    "tan": _ratio(_trigonometric, 0, 1),
    "cot": _ratio(_trigonometric, 1, 0),
    "sec": _ratio(_trigonometric, None, 1),
    "csc": _ratio(_trigonometric, None, 0),
    "sinh": lambda c, degree: _hyperbolic(c, degree)[0],
    "cosh": lambda c, degree: _hyperbolic(c, degree)[1],
    "tanh": _ratio(_hyperbolic, 0, 1),
    "coth": _ratio(_hyperbolic, 1, 0),
    "sech": _ratio(_hyperbolic, None, 1),
    "csch": _ratio(_hyperbolic, None, 0),
    "asin": _inverse("asin", -1, 1, -0.5),
    "acos": _inverse("acos", -1, 1, -0.5, -1),
    "atan": _inverse("atan", 1, 1, -1),
    "asinh": _inverse("asinh", 1, 1, -0.5),
    "acosh": _inverse("acosh", 1, -1, -0.5),
    "atanh": _inverse("atanh", -1, 1, -1),
    "erf": _erf,
    "sinc": _sinc,
}

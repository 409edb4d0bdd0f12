"""Taylor coefficients of functions of one argument, by the power series of python-flint.

Coefficients are balls of so many digits that what is left after rounding to floats is right. A
function that has no real Taylor series at a centre has a coefficient that is not finite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

DIGITS = 60
_SINC_TERMS = 80  # 1 / 80! is below 1e-118


def taylor(name: str, centre: str, degree: int) -> list[Any]:
    """The coefficients of the function ``name`` at a real centre, up to a degree.

    Raises
    ------
    ValueError
        If it has no real Taylor series there.
    """
    return _coefficients(_SERIES[name], centre, degree)


def power(exponent: str, centre: str, degree: int) -> list[Any]:
    """The coefficients of t^exponent at a real centre; `ValueError` if there are none."""
    return _coefficients(lambda flint, t: t ** flint.arb(exponent), centre, degree)


def _coefficients(function: Callable[[Any, Any], Any], centre: str, degree: int) -> list[Any]:
    import flint

    before = flint.ctx.cap
    flint.ctx.cap = degree + 1
    try:
        with flint.ctx.workdps(DIGITS + degree + 10):
            series = function(flint, flint.arb_series([flint.arb(centre), 1]))
            found = [series[k] for k in range(degree + 1)]
    finally:
        flint.ctx.cap = before
    if not all(value.is_finite() for value in found):
        raise ValueError
    return [flint.arb(0) if value.contains(0) else value for value in found]


def _hyperbolic(flint: Any, t: Any) -> tuple[Any, Any]:
    """sinh and cosh; half of exp(t) - exp(-t) would cancel."""
    degree = flint.ctx.cap - 1
    both = t[0].sinh(), t[0].cosh()
    derivatives = [[both[(k + first) % 2] / flint.arb.fac_ui(k) for k in range(degree + 1)]
                   for first in (0, 1)]  # fmt: skip
    return flint.arb_series(derivatives[0]), flint.arb_series(derivatives[1])


def _integral(start: Any, slope: Any) -> Any:
    return slope.integral() + start


def _sinc(flint: Any, t: Any) -> Any:
    if abs(t[0]) > 1:
        return t.sin() / t
    # sinc(t) = 1 - t^2 / 3! + t^4 / 5! - ..., as the quotient cancels near zero
    terms = flint.ctx.cap + _SINC_TERMS
    alternating = [(1, 0, -1, 0)[k % 4] / flint.arb.fac_ui(k + 1) for k in range(terms)]
    return flint.arb_series(flint.arb_poly(alternating)(flint.arb_poly([t[0], 1])).coeffs())


_SERIES: dict[str, Callable[[Any, Any], Any]] = {
    "exp": lambda _, t: t.exp(),
    "log": lambda _, t: t.log(),
    "sin": lambda _, t: t.sin(),
    "cos": lambda _, t: t.cos(),
    "tan": lambda _, t: t.tan(),
    "cot": lambda _, t: t.cos() / t.sin(),
    "sec": lambda _, t: 1 / t.cos(),
    "csc": lambda _, t: 1 / t.sin(),
    "asin": lambda _, t: t.asin(),
    "acos": lambda _, t: t.acos(),
    "atan": lambda _, t: t.atan(),
    "sinh": lambda flint, t: _hyperbolic(flint, t)[0],
    "cosh": lambda flint, t: _hyperbolic(flint, t)[1],
    "tanh": lambda flint, t: _hyperbolic(flint, t)[0] / _hyperbolic(flint, t)[1],
    "coth": lambda flint, t: _hyperbolic(flint, t)[1] / _hyperbolic(flint, t)[0],
    "sech": lambda flint, t: 1 / _hyperbolic(flint, t)[1],
    "csch": lambda flint, t: 1 / _hyperbolic(flint, t)[0],
    "asinh": lambda _, t: _integral(t[0].asinh(), (1 + t * t).rsqrt()),
    "acosh": lambda _, t: _integral(t[0].acosh(), (t * t - 1).rsqrt()),
    "atanh": lambda _, t: _integral(t[0].atanh(), 1 / (1 - t * t)),
    "erf": lambda _, t: t.erf(),
    "sinc": _sinc,
}

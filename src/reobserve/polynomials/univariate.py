"""Taylor coefficients of functions of one argument, by the power series of python-flint.

A function that has no real Taylor series at a centre has a coefficient that is not finite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

DIGITS = 60  # of the balls
LARGEST = 1e308  # value at a centre
_SINC_TERMS = 80  # 1 / 80! is below 1e-118


def coefficients(function: Callable[[Any], Any], centre: Any, degree: int) -> list[Any] | None:
    """The coefficients at a centre up to a degree, all balls, or none if one of them is not finite.

    ``function`` takes a series of python-flint to another, as those in `FUNCTIONS` do.
    """
    from flint import arb, arb_series, ctx

    before, ctx.cap = ctx.cap, degree + 1
    try:
        series = function(arb_series([centre, 1]))
        values = [series[k] for k in range(degree + 1)]
    except (ValueError, ZeroDivisionError):  # of a quotient
        return None
    finally:
        ctx.cap = before
    if not all(value.is_finite() for value in values):
        return None
    return [arb(0) if value.contains(0) else value for value in values]


def _hyperbolic(t: Any) -> tuple[Any, Any]:
    """The series of sinh and cosh, without half of exp(t) - exp(-t), which would cancel."""
    from flint import arb, arb_series, ctx

    both = t[0].sinh(), t[0].cosh()
    rows = [[both[(k + i) % 2] / arb.fac_ui(k) for k in range(ctx.cap)] for i in (0, 1)]
    return arb_series(rows[0]), arb_series(rows[1])


def _quotient(pair: tuple[Any, Any]) -> Any:
    return pair[0] / pair[1]


def _sinc(t: Any) -> Any:
    from flint import arb, arb_poly, arb_series, ctx

    if abs(t[0]) > 1:
        return t.sin() / t
    # sinc(t) = 1 - t^2 / 3! + t^4 / 5! - ..., as the quotient cancels near zero
    terms = range(ctx.cap + _SINC_TERMS)
    near = arb_poly([(1, 0, -1, 0)[k % 4] / arb.fac_ui(k + 1) for k in terms])
    return arb_series(near(arb_poly([t[0], 1])).coeffs())


FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "exp": lambda t: t.exp(),
    "log": lambda t: t.log(),
    "sin": lambda t: t.sin(),
    "cos": lambda t: t.cos(),
    "tan": lambda t: t.tan(),
    "cot": lambda t: t.cos() / t.sin(),
    "sec": lambda t: 1 / t.cos(),
    "csc": lambda t: 1 / t.sin(),
    "asin": lambda t: t.asin(),
    "acos": lambda t: t.acos(),
    "atan": lambda t: t.atan(),
    "sinh": lambda t: _hyperbolic(t)[0],
    "cosh": lambda t: _hyperbolic(t)[1],
    "tanh": lambda t: _quotient(_hyperbolic(t)),
    "coth": lambda t: _quotient(_hyperbolic(t)[::-1]),
    "sech": lambda t: 1 / _hyperbolic(t)[1],
    "csch": lambda t: 1 / _hyperbolic(t)[0],
    "asinh": lambda t: (1 + t * t).rsqrt().integral() + t[0].asinh(),
    "acosh": lambda t: (t * t - 1).rsqrt().integral() + t[0].acosh(),
    "atanh": lambda t: (1 / (1 - t * t)).integral() + t[0].atanh(),
    "erf": lambda t: t.erf(),
    "sinc": _sinc,
}

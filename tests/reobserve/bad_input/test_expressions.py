"""Right-hand sides as text: valid, invalid and hostile."""

from __future__ import annotations

from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve.observers.normal_form import normal_form_observer

from .outcome import is_accepted

HOSTILE = [
    "__import__('os').system('touch escaped')", "().__class__.__bases__[0].__subclasses__()",
    "exec('import os')", "open('escaped', 'w')", "lambda: 0", "a if a else w", "a**100000000",
    "a**a**a**a", "2**2**2**2**2**2**2", "9" * 5000, "(" * 500 + "a" + ")" * 500,
    "-" * 3000 + "a", "+".join(["a"] * 3000), "*".join(["a"] * 500),
    "sin(" * 100 + "a" + ")" * 100, "1/0", "1/a", "0**0", "0**-1", "log(a)", "sqrt(a)", "1e400*a",
    "1e-400*a", "oo*a", "nan", "I*a", "a/(w-w)", "a.w", "a[0]", "a,w", "a;w", "a=w", "a==w", "a<w",
    "a and w", "[a]", "{a}", "f'{a}'", "'a'", "a\nw", "a#w", "", " ", "\x00", "sin", "sin()",
    "sin(a,w)", "sin a", "pi*a", "E**a", "exp(exp(exp(a)))", "a!", "a w", "2a", "a**0.5", "a**-1",
    "a**(1/3)", "a**w", "(1+a)**1000", "(1+a)**0.5", "(1+a)**1e9", "u", "t*a", "Symbol('a')",
    "Integral(a, a)", "Sum(a,(w,1,9))", "factorial(a)", "abs(a)", "sign(a)", "a@w", "~a", "ａ",
    "α", "a\u0301", "\u202ea", "0x10*a", "1_0*a", "1j*a", "0b1*a", "True*a", "None", "a:=w", "*a",
    "tan(1.5707963267948966+a)", "erf(a)", "sinc(a)", "1e308*a*10", "a%w", "a//w", "a<<1", "S(1)*a",
]  # fmt: skip
VALID: dict[str, Any] = {
    "dynamics": ["w", "-sin(a) - w/10"], "output": ["a"], "variables": ["a", "w"], "order": 2,
    "sampling_period": 0.01, "poles": [-1.5, -2], "expanded": 3,
}  # fmt: skip


def accepts(**changes: Any) -> bool:
    return is_accepted(lambda: normal_form_observer(**{**VALID, **changes}))


@pytest.mark.parametrize("text", HOSTILE)
def test_listed_expressions_are_accepted_or_refused(text: str) -> None:
    accepts(dynamics=["w", text])
    accepts(dynamics=["w", f"-sin(a) - w/10 + a**2*({text})"])


@pytest.mark.parametrize("text", ["1e-308/0.0", "1/0.0**0.5", "0.0/0.0", "0.5**(1/0)"])
def test_expressions_that_sympy_cannot_compute_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^dynamics\[1\]: .*(without a value|no Taylor series)"):
        normal_form_observer(**{**VALID, "dynamics": ["w", text]})


@pytest.mark.parametrize("text", ["atan(1/0)", "sin(atanh(1))", "atan(log(0))", "a*atan(1/0)"])
def test_constant_without_a_value_is_refused_as_coefficient(text: str) -> None:
    with pytest.raises(InputError, match=r"^dynamics\[1\]: .* has no Taylor series at the origin"):
        normal_form_observer(**{**VALID, "dynamics": ["w", text]})

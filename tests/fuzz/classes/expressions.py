"""Right-hand sides as text: of the grammar, beside it, and hostile."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Any

from reobserve.observers.normal_form import normal_form_observer

from .. import mutations
from ..case import Case

_HOSTILE = [
    "__import__('os').system('touch escaped')", "().__class__.__bases__[0].__subclasses__()",
    "exec('import os')", "open('escaped', 'w')", "lambda: 0", "a if a else w", "a**100000000",
    "a**a**a**a", "2**2**2**2**2**2**2", "9" * 5000, "(" * 500 + "a" + ")" * 500, "-" * 3000 + "a",
    "+".join(["a"] * 3000), "*".join(["a"] * 500), "sin(" * 100 + "a" + ")" * 100, "1/0", "1/a",
    "0**0",
    "0**-1", "log(a)", "sqrt(a)", "1e400*a", "1e-400*a", "oo*a", "nan", "I*a", "a/(w-w)", "a.w",
    "a[0]",
    "a,w", "a;w", "a=w", "a==w", "a<w", "a and w", "[a]", "{a}", "f'{a}'", "'a'", "a\nw", "a#w", "",
    " ", "\x00", "sin", "sin()", "sin(a,w)", "sin a", "pi*a", "E**a", "exp(exp(exp(a)))", "a!",
    "a w",
    "2a", "a**0.5", "a**-1", "a**(1/3)", "a**w", "(1+a)**1000", "(1+a)**0.5", "(1+a)**1e9", "u",
    "t*a",
    "Symbol('a')", "Integral(a, a)", "Sum(a,(w,1,9))", "factorial(a)", "abs(a)", "sign(a)", "a@w",
    "~a",
    "ａ", "α", "a\u0301", "\u202ea", "0x10*a", "1_0*a", "1j*a", "0b1*a", "True*a", "None", "a:=w",
    "*a",
    "tan(1.5707963267948966+a)", "erf(a)", "sinc(a)", "1e308*a*10", "a%w", "a//w", "a<<1", "S(1)*a",
]  # fmt: skip
_FUNCTIONS = [
    "sin",
    "cos",
    "exp",
    "log",
    "tan",
    "sqrt",
    "atan",
    "cosh",
    "sinh",
    "Abs",
    "gamma",
    "f",
]
_ATOMS = ["a", "w", "1", "0", "-2", "0.1", "1e-3", "3/2", "pi", "b", "1e30", "a**2", "w**3"]


def make(random: Random) -> Case:
    """A system with a text of its own; sometimes other arguments beside it are odd, too."""
    texts = [_text(random), _text(random)] if random.random() < 0.2 else ["w", _text(random)]
    changed: dict[str, Any] = {}
    if random.random() < 0.3:
        name = random.choice(
            ["order", "poles", "sampling_period", "variables", "output", "degree", "expanded"]
        )
        odd = [
            0,
            1,
            2,
            7,
            200,
            10**9,
            -1,
            1.5,
            None,
            True,
            "a",
            [],
            ["a"],
            [-1],
            [-1, "x"],
            [-1, -1],
        ]
        odd += [
            [1, 2],
            [-1 + 1j, -1 - 1j],
            [-1 + 1j, -2],
            ["a", "a"],
            ["sin", "w"],
            ["lambda", "w"],
        ]
        changed[name] = random.choice([*odd, mutations.value(random)])
    return case(texts, changed)


def examples() -> Iterator[Case]:
    """The pendulum of the README."""
    yield case(["w", "-sin(a) - w/10"], {})


def case(texts: list[str], changed: dict[str, Any]) -> Case:
    """Make an observer from it."""
    arguments: dict[str, Any] = {
        "dynamics": texts, "output": ["a"], "variables": ["a", "w"], "order": 2,
        "sampling_period": 0.01, "poles": [-1.5, -2], "expanded": 3, **changed,
    }  # fmt: skip
    return Case(f"{texts!r:.200} {changed!r:.100}", lambda: normal_form_observer(**arguments))


def _text(random: Random) -> str:
    act = random.randrange(4)
    if act == 0:
        return random.choice(_HOSTILE)
    text = _grown(random, random.choice([1, 2, 3, 5]))
    if act == 1 and random.random() < 0.3:
        return text
    if act <= 2:
        return f"-sin(a) - w/10 + a**2*({text})"
    at = random.randrange(len(text) + 1)
    piece = random.choice([*"()+-*/,.[]'_\\^=", "**", mutations.word(random)[:50], "((", "1e"])
    return text[:at] + piece + text[at + random.choice([0, 1]) :]


def _grown(random: Random, levels: int) -> str:
    if levels == 0 or random.random() < 0.2:
        return random.choice(_ATOMS)
    act = random.randrange(4)
    if act == 0:
        return f"{random.choice(_FUNCTIONS)}({_grown(random, levels - 1)})"
    if act == 1:
        return (
            f"({_grown(random, levels - 1)})**{random.choice(['2', '3', '-1', '0.5', 'a', '40'])}"
        )
    sign = random.choice(["+", "-", "*", "/", " + "])
    return f"({_grown(random, levels - 1)}{sign}{_grown(random, levels - 1)})"

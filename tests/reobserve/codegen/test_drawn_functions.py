"""Drawn functions in Python: C gives the numbers of Python, or a line is refused."""

from __future__ import annotations

import linecache
import shutil
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from tests.reobserve.codegen.in_c import in_c

SIZE = 8
POINTS = [np.random.default_rng(seed).normal(size=SIZE).round(1) for seed in range(6)]
POINTS += [np.zeros(SIZE), np.array([np.nan, 1.0, -1.0, np.inf, 0.0, -0.0, 2.0, -3.0])]

# Numbers, whole numbers and conditions, each made of parts in its braces, and statements of them.
REAL = [
    "x[{n}]", "out[{n}]", "a", "b", "-0.0", "2.5", "({r} + {r})", "({r} - {r})", "({r} * {r})",
    "-{r}", "({v} / {v})", "({r} if {c} else {v})", "min({r}, {v})", "max({v}, {r}, {r})",
    "abs({r})", "({r} ** 2)", "({r} or {v})", "({v} and {r})", "TABLE[{n}]", "(a, 2.0, {r})[{n}]",
]  # fmt: skip
WHOLE = [
    "i", "i", "k", "0", "1", "2", "-1", "({n} - 1)", "({n} + {n})", "(2 - {n})", "(2 * {n})",
    "-{n}", "({n} // 2)", "({n} % 3)", "min({n}, {n})", "max({n}, 0)", "({n} if {c} else {n})",
    "PLACES[{n}]", "(1 * {c} + 2 * {c})", "({n} or {n})", "({n} ** 2)",
]  # fmt: skip
CONDITION = [
    "({r} < {n})", "({n} > 0)", "({r} <= {n} != {r})", "(not {c})", "(not {v})", "({c} and {c})",
    "({c} or {c})", "({n} == 2)", "({n} in (2, {n}))", "(i + 1 < 8 and x[i + 1] ** 2 > {r})",
    "((a, k) == (b, {n}))", "({c} and {v})",
]  # fmt: skip
SIMPLE = [
    "a = {v}", "b = {r}", "k = {n}", "a += {v}", "a *= {r}", "b /= {v}", "b //= {r}", "k -= {n}",
    "k //= 2", "k = 1 - k", "out[{n}] = {v}", "out[{n}] += {v}", "out[{n}] -= {r}",
    "out[{n}] //= {r}", "a, b = b, {r}", "out[0], out[1] = out[1], out[{n}]", "a = b = {v}",
    "a, (b, k) = {r}, (a, {n})", "part = x[1:]", "part = out[{n}:{n}]", "a = part[{n}]",
    "part[{n}] = {r}", "TABLE = {r}", "part = x",
]  # fmt: skip
LOOPS = ["range({n})", "range(1, 4)", "range(3, -1, -1)", "range(k, {n})", "range(i)", "range(2)"]


@st.composite
def text(draw: st.DrawFn, forms: list[str], depth: int) -> str:
    """An expression, or a statement in a line, of which parts are drawn as well."""
    kinds = {
        "r": REAL,
        "n": WHOLE,
        "c": CONDITION,
        "v": draw(st.sampled_from([REAL, WHOLE, CONDITION])),
    }
    form = draw(st.sampled_from([one for one in forms if depth > 0 or one.count("{") < 2]))
    while "{" in form:
        before, _, rest = form.partition("{")
        form = before + draw(text(kinds[rest[0]], depth - 1)) + rest[2:]
    return form


@st.composite
def block(draw: st.DrawFn, depth: int, loop: bool = False) -> list[str]:
    """Lines of statements."""
    lines: list[str] = []
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(["simple", "simple", "if", "for"] if depth else ["simple"]))
        if kind == "simple":
            lines.append(draw(text(SIMPLE, 2)))
        elif kind == "for":
            lines.append(f"for {draw(st.sampled_from('ij'))} in {draw(text(LOOPS, 1))}:")
            lines += ["    " + line for line in draw(block(depth - 1, True))]
        else:
            lines.append(f"if {draw(text(CONDITION, 2))}:")
            lines += ["    " + line for line in draw(block(depth - 1, loop))]
            jump = draw(st.sampled_from(["", "", "return 0", *["break", "continue"] * loop]))
            lines += [f"    {jump}"] * bool(jump)
            if draw(st.booleans()):
                lines += ["else:", *("    " + line for line in draw(block(depth - 1, loop)))]
    return lines


def check(lines: list[str]) -> bool:
    """Compare C with Python; False if a line is refused."""
    start = [
        "a, b, k, i = x[0], 1.5, 2, 1",
        "for j in range(8):",
        "    out[j] = x[7 - j]",
        "part = x[:4]",
    ]
    body = "".join(f"    {line}\n" for line in [*start, *lines, "return 0"])
    code, name = f"def drawn(x, out):\n{body}", f"<drawn {hash(body)}>"
    linecache.cache[name] = (len(code), None, code.splitlines(keepends=True), name)
    known: dict[str, Any] = {
        "TABLE": np.array([1.5, -2.0, 3.0, 0.5]),
        "PLACES": np.array([2, -1, 0]),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exec(compile(code, name, "exec"), known)
    try:
        found = in_c(known["drawn"], np.empty(SIZE), np.empty(SIZE))
    except InputError as error:
        assert f"cannot be exported: {name}, line " in str(error)  # noqa: PT017
        return False
    for x in POINTS:
        out = np.empty(SIZE)
        try:
            with np.errstate(all="ignore"):
                known["drawn"](x.copy(), out)
        except (ArithmeticError, IndexError, ValueError, NameError):
            continue
        same = np.where(np.isnan(out), np.isnan(found(x)), found(x) == out)
        assert same.all(), (code, x, out, found(x))
    return True


# Statements with which C is likely to compute something else, and whether they are translated.
LIKELY = {
    "out[0] = a or b": True, "out[0] = 5.0 and a": True, "out[0] = a and 5.0": True,
    "out[0] = not not a": True, "out[0] //= 2.0": False, "out[0] = max((a, b))": False,
    "for i in range(8):\n    out[i] = 1.0 if 2 in (i, 2) else 0.0": True,
    "for TABLE in range(4):\n    out[TABLE] = 1.0\nout[5] = TABLE": False,
    "for i in range(3):\n    out[i] = x[PLACES[i]] + x[i - 1]": True,
    "for i in range(8):\n    out[i] = PLACES[i % 3] // 2": False,
    "if (a, b) == (a, b + 0.0):\n    out[0] = 2.5": False,
    "for i in range(k):\n    k += 1\n    out[0] += 1.0": True,
    "for i in range(8):\n    out[i] = (x[i + 1] + 1.0) ** 2 if i + 1 < 8 else 0.0": True,
    "for i in range(8):\n    for a in x[i : i + 3]:\n        out[i] += a": False,
    "for i in range(8):\n    k += 100000 * i * 100000\nout[0] = k": False,
    "for i in range(8):\n    out[i] = x[i] ** i": False,
    "for i in range(8):\n    out[i] = (i + 2) ** -1": False,
    "out[0] = x": False, "part += 1.0": False, "out[0] = 10**12 * a": True,
}  # fmt: skip


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@given(block(2))
@settings(max_examples=150, deadline=None)
def test_drawn_function_gives_in_c_what_python_gives_or_is_refused(lines: list[str]) -> None:
    check(lines)


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("text", LIKELY)
def test_function_gives_in_c_what_python_gives_or_is_refused(text: str) -> None:
    assert check(text.split("\n")) is LIKELY[text]

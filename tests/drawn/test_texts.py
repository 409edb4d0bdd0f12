"""Texts of models: each is refused in a sentence or has its value, in Python, by numba and in C.

So do its derivatives. The values are those of mpmath by a walk through the text of its own, whose
difference from the same walk with fewer bits says what rounding may change.
"""

from __future__ import annotations

import ast
import math
import shutil
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import product
from typing import Any

import mpmath
import numba
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from reobserve.core.errors import InputError
from reobserve.core.vector_field import VECTOR_FIELD
from reobserve.observers.normal_form import normal_form_observer
from reobserve.polynomials.grammar import FUNCTIONS
from reobserve.systems.nonlinear_text import Names, text_jacobian, text_rows
from reobserve_papers.parameters.parameter_file import Titled, parse_file
from tests.reobserve.codegen.in_c import rows_in_c

from . import times

POINTS = [(0.3, -0.7), (1.6, 2.5), (-1.2, 0.4), (0.0, 1.0), (25.0, -40.0), (-1e-9, 1e6)]
LONGEST = 20  # seconds of one text, of which most take some milliseconds
ONES = [name for name in FUNCTIONS if name != "atan2"]
NAMES = Names(("a", "w"), (), ())
Dual = tuple[Any, Any, Any]  # a value and its derivatives by a and w


class UndefinedError(Exception):
    """A part that is no real number, or so large or small that floats may lose it."""


@contextmanager
def bounded_time() -> Iterator[None]:
    def late(*_: Any) -> None:
        raise AssertionError("a text takes too long")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def real(value: Any) -> Any:
    if not isinstance(value, mpmath.mpf) or not (value == 0 or 1e-100 < abs(value) < 1e100):
        raise UndefinedError
    return value


def slope(function: Callable[[Any], Any], at: Any) -> Any:
    """A derivative, with as many digits as a formula that cancels would give."""
    with mpmath.workprec(300):
        found = real(mpmath.diff(function, at))
    return found + (1 + abs(found)) * mpmath.ldexp(1, 3 - mpmath.mp.prec)


def applied(function: Callable[..., Any], *parts: Dual) -> Dual:
    """A function of duals, by its derivative for each of them."""
    at = [part[0] for part in parts]
    total = [mpmath.mpf(0)] * 2
    for i, part in enumerate(parts):
        if any(part[1:]):
            one = slope(lambda v, i=i: function(*at[:i], v, *at[i + 1 :]), at[i])
            total = [real(t + one * s) for t, s in zip(total, part[1:], strict=True)]
    return (real(function(*at)), *total)  # type: ignore[return-value]


def raised(base: Dual, power: Dual, constant: bool) -> Dual:
    b, p = base[0], power[0]
    if constant and p == int(p):  # (-1)**p has a value
        return applied(lambda v: v ** int(p), base)
    if b <= 0:
        raise UndefinedError
    return applied(lambda v, e: v**e, base, power)


def absolute(value: Any) -> Any:
    if value == 0:
        raise UndefinedError
    return abs(value)


def angle(y: Any, x: Any) -> Any:
    if y == 0 and x <= 0:
        raise UndefinedError
    return mpmath.atan2(y, x)


CALLS = {name: getattr(mpmath, name, None) for name in FUNCTIONS}
CALLS |= {"abs": absolute, "atan2": angle}


def dual(part: ast.expr, point: dict[str, Dual]) -> Dual:
    """The value and derivatives of a text that Python has read."""
    if isinstance(part, ast.Constant):
        return (real(mpmath.mpf(repr(part.value))), mpmath.mpf(0), mpmath.mpf(0))
    if isinstance(part, ast.Name):
        return point[part.id]
    if isinstance(part, ast.UnaryOp):
        return tuple(-v for v in dual(part.operand, point))  # type: ignore[return-value]
    if isinstance(part, ast.Call):
        assert isinstance(part.func, ast.Name)
        return applied(CALLS[part.func.id], *(dual(one, point) for one in part.args))
    assert isinstance(part, ast.BinOp)
    (u, du, dw), (v, dv, dx) = both = dual(part.left, point), dual(part.right, point)
    if isinstance(part.op, ast.Pow):
        constant = not {"a", "w"} & {getattr(one, "id", "") for one in ast.walk(part.right)}
        return raised(*both, constant)
    if isinstance(part.op, ast.Add | ast.Sub):
        sign = 1 if isinstance(part.op, ast.Add) else -1
        found = (u + sign * v, du + sign * dv, dw + sign * dx)
    elif isinstance(part.op, ast.Mult):
        found = (u * v, u * dv + v * du, u * dx + v * dw)
    else:
        found = (u / v, (du - u / v * dv) / v, (dw - u / v * dx) / v)
    return tuple(map(real, found))  # type: ignore[return-value]


def wanted(text: str, point: Sequence[float], bits: int) -> Any:
    """Value and derivatives with so many bits, or None where there are none."""
    with mpmath.workprec(bits):
        a, w = map(mpmath.mpf, point)
        one, zero = mpmath.mpf(1), mpmath.mpf(0)
        names = {"a": (a, one, zero), "w": (w, zero, one)}
        names |= {"pi": (+mpmath.pi, zero, zero), "E": (+mpmath.e, zero, zero)}
        try:
            return np.array(dual(ast.parse(text.replace("^", "**"), mode="eval").body, names))
        except (UndefinedError, ArithmeticError, ValueError, TypeError):
            return None


def rows_of(text: str) -> tuple[str, ...] | None:
    """The code of a text and of its derivatives, or None where it is refused."""
    said = ""
    with bounded_time():
        try:
            return (*text_rows("f", [text], (1,), NAMES), *text_jacobian("f", (text,), NAMES))
        except InputError as error:
            said = str(error)
    assert said.startswith(("f[0]: ", "d f[0] / d ")), said
    assert "\n" not in said
    assert len(said) < 400
    return None


def in_python(rows: Sequence[str]) -> Any:
    found = np.full((len(POINTS), len(rows)), np.nan)
    for k, point in enumerate(POINTS):
        for i, row in enumerate(rows):
            try:
                found[k, i] = eval(row, {"math": math}, {"x": point})
            except OverflowError:
                found[k, i] = np.inf
            except (ArithmeticError, ValueError, TypeError):  # a complex number is no float
                found[k, i] = np.nan
    return found


def by_numba(rows: Sequence[str]) -> Any:
    """As `compiled_rows` compiles them, which keeps its code on disk."""
    body = "".join(f"    out[{i}] = {row}\n" for i, row in enumerate(rows))
    namespace: dict[str, Any] = {"math": math}
    exec(f"def field(x, parameters, out):\n{body}", namespace)
    field = numba.njit(VECTOR_FIELD, error_model="numpy")(namespace["field"])
    found = np.empty((len(POINTS), len(rows)))
    for k, point in enumerate(POINTS):
        field(np.array(point), np.empty(0), found[k])
    return found


def by_cc(rows: Sequence[str]) -> Any:
    function = rows_in_c(rows, 2)
    return np.array([function(np.array(point)) for point in POINTS])


WAYS = {"python": in_python, "numba": by_numba} | ({"c": by_cc} if shutil.which("cc") else {})


def check(texts: Sequence[str], *ways: str) -> int:
    """Compare the texts that are accepted by the named ways; their number."""
    read = {text: rows for text in texts if (rows := rows_of(text)) is not None}
    rows = [row for group in read.values() for row in group]
    shape = (len(POINTS), len(read), 3)
    found = {way: WAYS[way](rows).reshape(shape) for way in ways if rows}
    for k, point in enumerate(POINTS):
        for i, text in enumerate(read):
            exact, *rough = (wanted(text, point, bits) for bits in (200, 53, 42, 40))
            if exact is None or any(one is None for one in rough):
                continue
            error = np.max([np.abs(exact - one) for one in rough], axis=0)
            if (error > 1e-3 * (1 + np.abs(exact))).any():  # no digit is sure
                continue
            error = 4 * error + 1e-11 * np.abs(exact) + 1e-99
            for way, values in found.items():
                found_here = values[k, i]
                beyond = (way == "python") & np.isinf(found_here)  # which Python raises
                good = beyond | (np.abs(np.where(beyond, 0, found_here) - exact) <= error)
                assert good.all(), (way, text, point, values[k, i], exact.astype(float), read[text])
    return len(read)


numbers = (
    st.sampled_from(["0", "1", "2", "-3", "0.1", "1/3", "pi", "E", "1e-308", "1e308", "0.0", "40"])
    | st.integers(-(10**20), 10**20).map(str)
    | st.floats(allow_nan=False, allow_infinity=False).map(repr)
)
grown = st.recursive(
    st.sampled_from(["a", "w"]) | numbers,
    lambda part: (
        st.builds("{}({})".format, st.sampled_from(ONES), part)
        | st.builds("atan2({}, {})".format, part, part)
        | st.builds("({}{}{})".format, part, st.sampled_from("+-*/"), part)
        | st.builds("({}){}({})".format, part, st.sampled_from(["**", "^"]), part)
        | st.builds("-{}**{}".format, part, st.sampled_from(["2", "-1", "0.5", "-40", "200", "w"]))
    ),
    max_leaves=7,
)
nested = st.builds("{}({}({}(a)))".format, *[st.sampled_from(ONES)] * 3)


@pytest.mark.nightly_cases("numba")
@pytest.mark.parametrize("way", WAYS)
def test_all_pairs_of_functions_have_their_values(way: str) -> None:
    pairs = [f"{outer}({inner}(a))" for outer, inner in product(ONES, ONES)]
    some = pairs[:: 1 if settings().max_examples >= 100 else 17]
    assert check(some, way) == len(some)


@given(st.lists(nested, min_size=4, max_size=4))
@times(1 / 4)
def test_triples_of_functions_have_their_values(texts: list[str]) -> None:
    assert check(texts, *WAYS) == len(set(texts))


@given(st.lists(grown, min_size=6, max_size=6))
@example(["sin(cosh((w + pi)**-40))", "cos(tanh((a + w + 1)**200))", "cosh((sqrt(w) + pi)**-40)"])
@example(["(sinh(-125**-40))**(-pi**2)", "(-2)**0.5", "a*(-1e-84)**-9.87"])
@example(["atan2(csch(w), sin(3.799359903131718e+16))"])  # 37993599031317180 is no float
@example(["asin(sin((pi + E + sqrt(2) + log(2) + log(3))**90))*a", "(-1)**w", "2**a", "a**-w"])
@times(1 / 3)
def test_texts_are_refused_or_have_their_values(texts: list[str]) -> None:
    check(texts, *WAYS)


@given(grown)
@example("sin(cosh((w + pi)**-40))")
@example("cos(tanh((a + w + 1)**200))")
@example("atan2(0.1, (-1)**0.1)")
def test_texts_are_expanded_or_refused_in_bounded_time(text: str) -> None:
    with bounded_time(), suppress(InputError):
        normal_form_observer(
            ["w", f"-sin(a) - w/10 + a*({text})"], ["a"], ["a", "w"], order=2, expanded=3,
            sampling_period=0.01, poles=[-1.5, -2],
        )  # fmt: skip


@given(st.text(st.sampled_from("$_^{}x \\"), max_size=12))
@example("$x_$")
@example("$\\frac{$")
@example("$" + "{" * 500 + "$")
@example("$x_1$ and $5")
def test_labels_are_drawn_or_refused(text: str) -> None:
    try:
        parse_file(Titled, {"title": text}, "scenarios", "own")
    except InputError as error:
        assert error.parameter == "scenarios.own.title"  # noqa: PT017
        return
    figure = Figure()
    figure.text(0.5, 0.5, text)
    FigureCanvasAgg(figure).draw()

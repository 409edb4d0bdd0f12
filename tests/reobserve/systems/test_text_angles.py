"""atan2 and abs in texts of models: in Python, by numba and in C, against mpmath; bearings."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve import (
    ExtendedKalmanFilter,
    InputError,
    NonlinearModel,
    UnscentedKalmanFilter,
    simulate,
)
from reobserve.core.direct_call import call
from reobserve.core.kernel import kernel
from reobserve.polynomials.expressions import from_expressions
from tests.reobserve.codegen.in_c import rows_in_c

Array = NDArray[np.float64]

# Numbers in both axes, so that there are points in all quadrants, on all half-axes and at zero.
GRID = [(a, b) for a in (-3.0, -0.25, 0.0, 1.0, 1e8) for b in (-2.0, -1e-3, 0.0, 0.5, 7.0)]


def over(a: Any, b: Any, number: Any) -> Any:
    square = a * a + b * b
    return number / square if square else mpmath.nan


# Each text with its value, and its derivatives by a and b.
TEXTS: dict[str, Callable[[Any, Any], tuple[Any, Any, Any]]] = {
    "atan2(a, b)": lambda a, b: (mpmath.atan2(a, b), over(a, b, b), over(a, b, -a)),
    "atan2(2*b, 1 - a) + 1": lambda a, b: (
        mpmath.atan2(2 * b, 1 - a) + 1, over(2 * b, 1 - a, 2 * b), over(2 * b, 1 - a, 2 * (1 - a))
    ),
    "atan2(1, a)": lambda a, b: (mpmath.atan2(1, a), -1 / (1 + a * a), mpmath.mpf(0)),
    "abs(a)": lambda a, b: (abs(a), mpmath.sign(a), mpmath.mpf(0)),
    "b*abs(a*b - 1)": lambda a, b: (
        b * abs(a * b - 1), b * b * mpmath.sign(a * b - 1),
        abs(a * b - 1) + a * b * mpmath.sign(a * b - 1),
    ),
    "sqrt(a**2)": lambda a, b: (abs(a), mpmath.sign(a), mpmath.mpf(0)),
    "abs(abs(a) - 1)": lambda a, b: (
        abs(abs(a) - 1), mpmath.sign(abs(a) - 1) * mpmath.sign(a), mpmath.mpf(0)
    ),
}  # fmt: skip
MODEL = NonlinearModel(
    ["a", "b"], list(TEXTS), 0.0, 1.0, state_names=["a", "b"], outputs=len(TEXTS)
)


def sought() -> Array:
    """Values and derivatives of all texts at all points, (points, texts, 3)."""
    with mpmath.workdps(40):
        rows = [
            [[float(v) for v in exact(mpmath.mpf(a), mpmath.mpf(b))] for exact in TEXTS.values()]
            for a, b in GRID
        ]
    return np.array(rows)


def codes() -> list[str]:
    """The code of each value and its derivatives, text by text."""
    h, H = MODEL.code("h"), MODEL.code("H")
    assert h is not None
    assert H is not None
    return [code for i in range(len(TEXTS)) for code in (h[i], H[2 * i], H[2 * i + 1])]


def agree(found: Any) -> None:
    wanted = sought()
    values = np.array(found, dtype=float).reshape(wanted.shape)
    # A derivative of 0/0 is no number, whatever its sign.
    np.testing.assert_allclose(values, wanted, rtol=1e-12, atol=1e-15)


def test_python_gives_the_values_of_mpmath() -> None:
    def value(code: str, x: Array) -> float:
        with np.errstate(all="ignore"):
            return float(eval(code, {"math": math}, {"x": x}))

    agree([[value(code, np.array(point)) for code in codes()] for point in GRID])


@kernel
def evaluate(function: Any, x: Array, u: Array, out: Array) -> None:
    call(function, (x, u, out))


def test_compiled_code_gives_the_values_of_mpmath() -> None:
    found = np.empty((len(GRID), len(TEXTS), 3))
    for k, point in enumerate(GRID):
        h, H = np.empty(len(TEXTS)), np.empty(2 * len(TEXTS))
        evaluate(MODEL.functions.h, np.array(point), np.empty(0), h)
        evaluate(MODEL.functions.H, np.array(point), np.empty(0), H)
        found[k, :, 0], found[k, :, 1:] = h, H.reshape(-1, 2)
    agree(found)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
def test_exported_code_gives_the_values_of_mpmath() -> None:
    function = rows_in_c(list(codes()), 2)
    agree([function(np.array(point)) for point in GRID])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("atan2(a)", "'atan2(a)' is no expression, at ')', character 8"),
        ("atan2(a, b, a)", "'atan2(a, b, a)' is no expression, at ',', character 11"),
        ("sin(a, b)", "'sin(a, b)' is no expression, at ',', character 6"),
        ("a, b", "'a, b' is no expression, at ',', character 2"),
        ("abs + 1", "'abs + 1' is no expression, at '+', character 5"),
        ("arctan2(a, b)", "'arctan2' is not expanded; what can be are sums, "),
    ],
)
def test_wrong_calls_are_no_expressions(text: str, said: str) -> None:
    with pytest.raises(InputError) as error:
        NonlinearModel([text, "b"], ["a"], 0.0, 1.0, state_names=["a", "b"])
    assert str(error.value).startswith(f"f[0]: {said}")


@pytest.mark.parametrize("text", ["abs(a)", "atan2(a, b)"])
def test_series_have_none_of_them(text: str) -> None:
    with pytest.raises(
        InputError, match=r"^f\[0\]: .* is not expanded; what can be are sums, prod"
    ):
        from_expressions("f", [text], ["a", "b"], 3)


# A target passes two sensors at (0, 0) and (4, -1), which measure bearings.
STATES = ["px", "py", "vx", "vy"]
NOISE = {"Q": [0.0, 0.0, 1e-4, 1e-4], "R": 1e-4, "output_periods": [2 * np.pi] * 2}


def moved(x: Array, u: Array) -> Array:
    return np.array([x[0] + 0.1 * x[2], x[1] + 0.1 * x[3], x[2], x[3]])


def bearings(x: Array, u: Array) -> Array:
    return np.array([math.atan2(x[1], x[0]), math.atan2(x[1] + 1.0, x[0] - 4.0)])


def slopes(x: Array, u: Array) -> Array:
    H = np.zeros((2, 4))
    for row, (dx, dy) in enumerate(((x[0], x[1]), (x[0] - 4.0, x[1] + 1.0))):
        square = dx * dx + dy * dy
        H[row, 0], H[row, 1] = -dy / square, dx / square
    return H


TEXT = NonlinearModel(
    ["px + 0.1*vx", "py + 0.1*vy", "vx", "vy"], ["atan2(py, px)", "atan2(py + 1, px - 4)"],
    state_names=STATES, **NOISE,  # type: ignore[arg-type]
)  # fmt: skip
START, P = [-3.0, 2.0, 0.2, -1.0], [0.1, 0.1, 0.01, 0.01]


def test_target_is_tracked_by_bearings_as_by_a_plain_filter() -> None:
    true = simulate(TEXT, 60, START, P, seed=2)
    assert np.abs(np.diff(true["y"][:, 0])).max() > 6.0  # it jumps by a turn
    one = ExtendedKalmanFilter(TEXT)
    run = one.run(true["y"], start=one.init(START, P))
    x, C, u = np.array(START), np.diag(P), np.empty(0)
    A, Q, R = np.eye(4) + 0.1 * np.eye(4, k=2), np.diag(NOISE["Q"]), 1e-4 * np.eye(2)  # type: ignore[arg-type]
    for k, y in enumerate(true["y"]):
        if k:
            x, C = A @ x, A @ C @ A.T + Q
        H = slopes(x, u)
        e = (y - bearings(x, u) + np.pi) % (2 * np.pi) - np.pi
        gain = np.linalg.solve(H @ C @ H.T + R, H @ C).T
        x, C = x + gain @ e, (np.eye(4) - gain @ H) @ C
        assert run["state"][k] == pytest.approx(x, rel=1e-8, abs=1e-8)
        assert run["covariance"][k] == pytest.approx(C, rel=1e-6, abs=1e-9)
    error = run["state"] - true["state"]
    distances = np.einsum("ka,kab,kb->k", error, np.linalg.inv(run["covariance"]), error)
    assert distances.mean() < 8.0  # twice the number of states


@pytest.mark.nightly
@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_target_is_tracked_by_bearings_as_with_functions(kind: Any) -> None:
    python = NonlinearModel(moved, bearings, H=slopes, states=4, outputs=2, **NOISE)  # type: ignore[arg-type]
    y = simulate(TEXT, 60, START, P, seed=2)["y"]
    runs = [one.run(y, start=one.init(START, P)) for one in (kind(TEXT), kind(python))]
    for name in ("state", "covariance", "innovation", "log_likelihood"):
        assert runs[0][name] == pytest.approx(runs[1][name], rel=1e-8, abs=1e-10)

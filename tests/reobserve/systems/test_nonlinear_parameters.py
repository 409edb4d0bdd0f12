"""Parameters of nonlinear models at run time, and functions that are compiled once."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.ccallback import CFunc
from numpy.typing import ArrayLike, NDArray

from reobserve import (
    IMM,
    ExtendedKalmanFilter,
    InputError,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.systems.nonlinear_arguments import values_by_row

Array = NDArray[np.float64]

KINDS = [ExtendedKalmanFilter, UnscentedKalmanFilter]
NOISE: dict[str, Any] = {"Q": 1e-3, "R": 1e-2}
TEXT: dict[str, Any] = {**NOISE, "state_names": ["a", "w"], "input_names": ["u"]}
SIZES: dict[str, Any] = {**NOISE, "states": 2, "inputs": 1, "outputs": 1}
VALUES = {"g": 2.5, "dt": 0.1, "unused": 7.0, "c": 0.3}
Y, U = np.sin(np.arange(30.0)), np.cos(np.arange(30.0))
GAIN = 2.5


def estimates(model: NonlinearModel, kind: Any = ExtendedKalmanFilter) -> Array:
    """States and covariances of a run, smoothed states, and a step by its two halves."""
    one = kind(model)
    start = one.init([0.1, 0.2], 1.0)
    run = one.run(Y, U, start=start)
    ahead = one.predict(start.posterior, [0.3])
    after = one.correct(ahead, [0.2], [0.3]).posterior
    parts = [run["state"], run["covariance"], rts_smoother(run)["state"]]
    parts += [ahead.mean, ahead.covariance, after.mean, after.covariance]
    return np.concatenate([part.ravel() for part in parts])


TEXTS: dict[str, tuple[Any, Any, dict[str, Any]]] = {
    "derived Jacobians": (["a + dt*w", "w - dt*g*sin(a) + dt*u - dt*c*w^3"], "g*a", {}),
    "given Jacobians": (
        ["a + dt*w", "w - dt*g*sin(a) + dt*u - dt*c*w^3"], "g*a",
        {"F": [["1", "dt"], ["-dt*g*cos(a)", "1 - 3*dt*c*w^2"]], "H": [["g", "0"]]},
    ),
    "differential equation": (["w", "u - g*sin(a) - c*w^3"], "g*a", {"substeps": 2,
        "sampling_period": 0.1}),
}  # fmt: skip


def written(text: Any) -> Any:
    """Texts with numbers in place of names of parameters."""
    if not isinstance(text, str):
        return [written(one) for one in text]
    for name, value in {"dt": 0.1, "g": 2.5, "c": 0.3}.items():
        text = text.replace(f"{name}*", f"{value}*") if text != name else str(value)
    return text


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", TEXTS)
def test_parameter_is_the_same_as_its_number_in_the_text(case: str, kind: Any) -> None:
    f, h, options = TEXTS[case]
    model = NonlinearModel(f, h, parameters=VALUES, **options, **TEXT)
    jacobians: Any = {name: written(options[name]) for name in ("F", "H") if name in options}
    numbers = NonlinearModel(written(f), written(h), **{**options, **jacobians}, **TEXT)
    np.testing.assert_allclose(
        estimates(model, kind), estimates(numbers, kind), rtol=1e-12, atol=1e-12
    )
    for found, wanted in zip(direct(model), direct(numbers), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-14)


def direct(model: NonlinearModel) -> Iterator[Array]:
    """The functions' own values, each called through its pointer."""
    x, v = np.array([0.7, -0.4]), np.array([0.3, *model.parameter_values])
    functions = model.functions
    for function, size in (
        (functions.f, 2), (functions.F, 4), (functions.h, 1), (functions.H, 2),
    ):  # fmt: skip
        out = np.empty(size)
        through(function, x, v, out)
        yield out


@njit
def through(function: Any, x: Array, v: Array, out: Array) -> None:
    function(x, v, out)


@pytest.mark.parametrize(
    ("power", "value", "wanted"),
    [("w^k", 2.0, 0.0), ("w^k", 1.0, 1.0), ("(3*w)^k", 1.0, 3.0), ("sin(w)^(k + 1)", 1.0, 0.0)],
)
def test_derivative_of_a_power_is_that_at_zero(power: str, value: float, wanted: float) -> None:
    """Not k w^k / w, which is nan there."""
    model = NonlinearModel(["a", power], "a", parameters={"k": value}, **TEXT)
    out = np.empty(4)
    through(model.functions.F, np.zeros(2), np.array([0.0, value]), out)
    assert out.tolist() == [1.0, 0.0, 0.0, wanted]


def test_derivative_of_sinc_is_zero_at_zero() -> None:
    model = NonlinearModel(["a", "sinc(2*w)"], "a + sinc(w)", **TEXT)
    far = (np.cos(0.6) - np.sin(0.6) / 0.6) / 0.3
    for w, wanted in ((0.0, 0.0), (1e-300, -4e-300 / 3), (0.3, far)):
        out = np.empty(4)
        through(model.functions.F, np.array([0.0, w]), np.zeros(1), out)
        np.testing.assert_allclose(out, [1.0, 0.0, 0.0, wanted], rtol=1e-12)
    found = ExtendedKalmanFilter(model)
    run = found.run(np.ones((3, 1)), np.zeros((3, 1)), start=found.init([0.0, 0.0], 1.0))
    assert np.isfinite(run["state"]).all()


# --- Python functions ---------------------------------------------------------------------------


def sine(value: float) -> float:
    """A function that numba cannot call, since it is not compiled."""
    return math.sin(value)


def closures(g: float, dt: float, unused: float, c: float) -> dict[str, Callable[..., Any]]:
    """The functions with parameters as constants."""
    return {
        "f": lambda x, u: [x[0] + dt * x[1], x[1] - dt * g * math.sin(x[0]) + dt * u[0]],
        "h": lambda x: g * x[0],
        "F": lambda x, u: [[1.0, dt], [-dt * g * math.cos(x[0]), 1.0]],
        "H": lambda x, u: np.array([[g, 0.0]]),
    }


OF_PARAMETERS: dict[str, Callable[..., Any]] = {
    "f": lambda x, u, p: [x[0] + p[1] * x[1], x[1] - p[1] * p[0] * math.sin(x[0]) + p[1] * u[0]],
    "h": lambda x, u, p: p[0] * x[0],
    "F": lambda x, u, p: [[1.0, p[1]], [-p[1] * p[0] * math.cos(x[0]), 1.0]],
    "H": lambda x, u, p: np.array([[p[0], 0.0]]),
}


def called(x: Array, u: Array, p: Array) -> list[float]:
    return [x[0] + p[1] * x[1], x[1] - p[1] * p[0] * sine(x[0]) + p[1] * u[0]]


@pytest.mark.nightly_cases("compiled-fhFH-ExtendedKalmanFilter")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("names", ["fh", "fhFH"])
@pytest.mark.parametrize(
    "f", [OF_PARAMETERS["f"], njit(OF_PARAMETERS["f"]), called], ids=["compiled", "njit", "called"]
)
def test_function_of_parameters_is_a_closure_over_their_values(
    f: Any, names: str, kind: Any
) -> None:
    functions: Any = {name: OF_PARAMETERS[name] for name in names} | {"f": f}
    model = NonlinearModel(**functions, parameters=VALUES, **SIZES)
    assert set(model.uncompiled) == ({"f"} if f is called else set())
    constants: Any = {name: closures(**VALUES)[name] for name in names}
    constant = NonlinearModel(**constants, **SIZES)
    np.testing.assert_allclose(
        estimates(model, kind), estimates(constant, kind), rtol=1e-12, atol=1e-12
    )


def test_function_of_x_and_u_gets_no_parameters() -> None:
    """Nor does an argument that has a default."""
    sizes: list[tuple[int, ...]] = []

    def f(x: Array, u: Array, gain: ArrayLike = 2.0) -> Array:
        sizes.append((*x.shape, *u.shape, *np.shape(gain)))
        return x

    def h(x: Array, u: Array) -> float:
        return x[0] * len(u)  # type: ignore[no-any-return]

    model = NonlinearModel(f, h, parameters=VALUES, **SIZES)
    estimates(model)
    assert set(model.uncompiled) == {"f"}
    assert set(sizes) == {(2, 1)}
    plain = NonlinearModel(lambda x: x, lambda x: x[0], **SIZES)
    assert np.array_equal(estimates(model), estimates(plain))


def test_functions_are_checked_with_the_values_of_the_parameters() -> None:
    seen = []

    def f(x: Array, u: Array, p: Array) -> Array:
        seen.append((u.tolist(), p.tolist()))
        return x

    NonlinearModel(f, "a", parameters=VALUES, **TEXT)
    assert seen == [([1.0], [2.5, 0.1, 7.0, 0.3])]


def test_text_and_python_functions_share_parameters() -> None:
    f, h, _ = TEXTS["derived Jacobians"]
    mixed = NonlinearModel(f, OF_PARAMETERS["h"], parameters=VALUES, **TEXT, outputs=1)
    text = NonlinearModel(f, h, parameters=VALUES, **TEXT)
    np.testing.assert_allclose(estimates(mixed), estimates(text), rtol=1e-9)


def test_each_filter_of_a_bank_has_its_own_values() -> None:
    f, h, _ = TEXTS["derived Jacobians"]
    models = [NonlinearModel(f, h, parameters={**VALUES, "g": g}, **TEXT) for g in (2.5, 5.0)]
    alone = [ExtendedKalmanFilter(one) for one in models]
    bank = IMM(alone, np.eye(2), mixing=False)
    found = bank.run(Y, U, start=bank.init([0.1, 0.2], 1.0))["innovation"]
    for j, one in enumerate(alone):
        run = one.run(Y, U, start=one.init([0.1, 0.2], 1.0))
        np.testing.assert_allclose(found[:, j], run["innovation"], rtol=1e-14)


# --- What is compiled ---------------------------------------------------------------------------


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[CFunc]:
    """The function pointers that numba compiles during a test."""
    found: list[CFunc] = []
    compile_once = CFunc.compile

    def compile_and_note(one: CFunc) -> None:
        found.append(one)
        compile_once(one)

    monkeypatch.setattr(CFunc, "compile", compile_and_note)
    return found


def python_model(gain: float, Q: float = 1e-3) -> NonlinearModel:
    """Functions that are made again in each call."""

    def f(x: Array, u: Array, p: Array) -> list[float]:
        return [x[0] + p[0] * x[1] * gain, x[1] + u[0]]

    return NonlinearModel(f, lambda x: x[0], Q, 1e-2, parameters={"dt": Q}, **{
        name: SIZES[name] for name in ("states", "inputs", "outputs")
    })  # fmt: skip


def text_model(g: float, Q: float = 1e-3) -> NonlinearModel:
    f, h, _ = TEXTS["derived Jacobians"]
    return NonlinearModel(f, h, Q, 1e-2, state_names=["a", "w"], input_names=["u"],
                          parameters={**VALUES, "g": g})  # fmt: skip


def test_other_values_and_noise_compile_nothing(compiled: list[CFunc]) -> None:
    first = [text_model(1.0), python_model(1.0)]
    before = [estimates(one) for one in first]
    compiled.clear()
    others = [text_model(2.0), text_model(1.0, 2e-3), python_model(1.0, 2e-3)]
    changes: list[dict[str, Any]] = [{"parameters": {**VALUES, "g": 3.0}}, {"R": 1.0}]
    others += [replace(first[0], **change) for change in changes]
    others += [pickle.loads(pickle.dumps(first[0]))]
    found = [estimates(one) for one in others]
    assert not compiled
    assert np.array_equal(found[-1], before[0])
    for one in found[:-1]:
        assert not any(np.array_equal(one, other) for other in before)


def test_other_constants_are_compiled(compiled: list[CFunc]) -> None:
    estimates(python_model(1.5))
    compiled.clear()
    found = estimates(python_model(1.25))
    assert len(compiled) == 1  # f alone: h is the same
    assert not np.array_equal(found, estimates(python_model(1.5)))
    assert len(compiled) == 1


def reads_global(x: Array, u: Array) -> list[float]:
    return [x[0] + GAIN * x[1], x[1] + u[0]]


def test_new_model_reads_a_global_that_has_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    def model() -> NonlinearModel:
        return NonlinearModel(reads_global, lambda x: x[0], **SIZES)

    first = model()
    before = estimates(first)
    monkeypatch.setitem(globals(), "GAIN", 1.25)
    after = estimates(model())
    assert np.array_equal(estimates(first), before)
    same = NonlinearModel(lambda x, u: [x[0] + 1.25 * x[1], x[1] + u[0]], lambda x: x[0], **SIZES)
    assert np.array_equal(after, estimates(same))


FACTORS = (1.0, 3.0)
SCALES = np.array([1.0, 2.0])
SHIFTS = ModuleType("shifts")
SHIFTS.shift = 0.5  # type: ignore[attr-defined]


@njit
def inner_helper(x: float) -> float:
    return GAIN * x * FACTORS[1]


@njit
def helper(x: float) -> float:
    return inner_helper(x) * SCALES[1] + SHIFTS.shift  # type: ignore[no-any-return]


def calls_helper(x: Array, u: Array) -> list[float]:
    return [helper(x[0]), x[1] + u[0]]


CHANGES: list[Callable[[pytest.MonkeyPatch], None]] = [
    lambda patch: patch.setitem(globals(), "GAIN", 1.25),
    lambda patch: patch.setitem(globals(), "FACTORS", (1.0, 4.0)),
    lambda patch: patch.setitem(globals(), "SCALES", SCALES.copy()),
    lambda patch: SCALES.__setitem__(1, 5.0),
    lambda patch: patch.setattr(SHIFTS, "shift", 0.75),
    lambda patch: patch.setitem(globals(), "inner_helper", njit(lambda x: x - GAIN)),
]


def test_new_model_reads_what_has_changed_behind_helpers(
    monkeypatch: pytest.MonkeyPatch, compiled: list[CFunc]
) -> None:
    """Of the six changes the third is to a copy of an array, of which numba makes the same."""

    def predicted() -> float:
        model = NonlinearModel(calls_helper, lambda x: x[0], **SIZES)
        one = ExtendedKalmanFilter(model)
        return float(one.predict(one.init([0.7, 0.2], 1.0).posterior, [0.3]).mean[0])

    predicted()
    for number, change in enumerate(CHANGES):
        compiled.clear()
        change(monkeypatch)
        scaled = 0.7 - GAIN if number == 5 else GAIN * 0.7 * FACTORS[1]
        assert predicted() == scaled * SCALES[1] + SHIFTS.shift
        assert len(compiled) == (number != 2)


def fails_at_two(x: Array, u: Array, p: Array) -> list[float]:
    if p[0] == 2:
        raise KeyError("lost")
    return [sine(x[0]), x[1]]


def test_error_of_one_model_is_not_raised_in_another() -> None:
    good = NonlinearModel(fails_at_two, lambda x: x[0], parameters={"k": 1.0}, **SIZES)
    other = NonlinearModel(fails_at_two, lambda x: x[0], parameters={"k": 3.0}, **SIZES)
    out, pointer = np.empty(2), other.functions.f
    with pytest.raises(InputError, match="f: raises KeyError: 'lost' at x ="):
        _through_after(good, pointer, out)
    assert np.isnan(out).all()
    estimates(other)


def _through_after(good: NonlinearModel, pointer: Any, out: Array) -> None:
    with RaisedAfterLoop():
        through(pointer, np.ones(2), np.array([0.0, 2.0]), out)
        estimates(good)


# --- Values of a run ----------------------------------------------------------------------------


def test_values_of_a_run_stand_in_the_order_of_the_parameters() -> None:
    model = text_model(2.5)
    assert model.parameter_names == ("g", "dt", "unused", "c")
    assert model.parameter_values.tolist() == [2.5, 0.1, 7.0, 0.3]
    with pytest.raises(ValueError, match="read-only"):
        model.parameter_values[0] = 1.0
    assert values_by_row(model.parameters, {}, 3).tolist() == [[2.5, 0.1, 7.0, 0.3]]
    assert values_by_row(model.parameters, {"c": 1, "g": 4.0}, 3).tolist() == [[4.0, 0.1, 7.0, 1.0]]
    found = values_by_row(model.parameters, {"dt": [1, 2, 3], "c": np.float64(4.0)}, 3)
    assert found.tolist() == [[2.5, dt, 7.0, 4.0] for dt in (1.0, 2.0, 3.0)]
    assert found.flags.carray


def test_model_without_parameters_has_none() -> None:
    empty: Any = {}
    for given in (empty, None):
        model = NonlinearModel(["a", "w"], "a", parameters=given, **TEXT)
        assert model.parameter_names == ()
        assert model.parameter_values.shape == (0,)
        assert values_by_row(model.parameters, {}, 3).shape == (1, 0)


REFUSED: list[tuple[Any, str]] = [
    (3.0, "parameters: 3.0 must be numbers by name"),
    ({"gg": 1.0}, "parameters.gg: is no parameter of the model; did you mean 'g'?"),
    ({"x": 1.0}, "parameters.x: is no parameter of the model; there are: g, dt, unused, c"),
    ({"g": [1.0, 2.0]}, "parameters.g: has shape (2,), must be one number or (3,)"),
    ({"g": np.ones((3, 1))}, "parameters.g: has shape (3, 1), must be one number or (3,)"),
    ({"g": [1.0, np.nan, 2.0]}, "parameters.g[1]: nan must be a finite number"),
    ({"g": np.inf}, "parameters.g: inf must be a finite number"),
    ({"g": "x"}, "parameters.g: 'x' is not a number or an array of numbers"),
]


@pytest.mark.parametrize(("given", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_invalid_values_of_a_run_are_refused(given: Any, said: str) -> None:
    with pytest.raises(InputError) as error:
        values_by_row(text_model(2.5).parameters, given, 3)
    assert str(error.value) == said

"""Nonlinear models: their arguments, compilation of functions, and errors."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from reobserve import (
    DivergenceError,
    ExtendedKalmanFilter,
    InputError,
    NonlinearModel,
    UnscentedKalmanFilter,
)

Array = NDArray[np.float64]

NOISE: dict[str, Any] = {"Q": 1e-3, "R": 1e-2}
TEXT: dict[str, Any] = {**NOISE, "state_names": ["a", "w"], "input_names": ["u"]}
SIZES: dict[str, Any] = {**NOISE, "states": 2, "inputs": 1, "outputs": 1}


def helper(value: float) -> float:
    """A function that numba cannot call, since it is not compiled."""
    return math.sin(value)


def as_array(x: Array, u: Array) -> Array:
    return np.array([x[0] + 0.1 * x[1], x[1] - 0.1 * np.sin(x[0]) + 0.1 * u[0]])


def as_list(x: Array, u: Array) -> list[float]:
    return [x[0] + 0.1 * x[1], x[1] - 0.1 * math.sin(x[0]) + 0.1 * u[0]]


def as_tuple(x: Array, u: Array) -> tuple[float, float]:
    return x[0] + 0.1 * x[1], x[1] - 0.1 * math.sin(x[0]) + 0.1 * u[0]


def calls_another(x: Array, u: Array) -> list[float]:
    return [x[0] + 0.1 * x[1], x[1] - 0.1 * helper(x[0]) + 0.1 * u[0]]


def jacobian(x: Array, u: Array) -> list[list[float]]:
    return [[1.0, 0.1], [-0.1 * math.cos(x[0]), 1.0]]


def angle(x: Array) -> float:
    return x[0]  # type: ignore[no-any-return]


FORMS: dict[str, tuple[Any, str]] = {
    "array": (as_array, ""),
    "list": (as_list, ""),
    "tuple": (as_tuple, ""),
    "compiled by the user": (njit(as_array), ""),
    "calls another": (calls_another, "helper"),
}
Y, U = np.sin(np.arange(30.0)), np.cos(np.arange(30.0))


def state_of(model: NonlinearModel, kind: Any = ExtendedKalmanFilter) -> Array:
    one = kind(model)
    found: Array = one.run(Y, U, start=one.init([0.1, 0.2], 1.0))["state"]
    return found


@pytest.mark.parametrize("form", FORMS)
def test_python_function_agrees_with_text_for_any_return_type(form: str) -> None:
    function, why = FORMS[form]
    text = NonlinearModel(["a + w/10", "w - sin(a)/10 + u/10"], "a", **TEXT)
    model = NonlinearModel(function, angle, F=jacobian, H=lambda x: [[1.0, 0.0]], **SIZES)
    np.testing.assert_allclose(state_of(model), state_of(text), rtol=1e-13, atol=1e-14)
    differences = NonlinearModel(function, angle, **SIZES)
    np.testing.assert_allclose(state_of(differences), state_of(text), rtol=1e-10, atol=1e-10)
    assert set(model.uncompiled) == ({"f"} if why else set())
    assert why in model.uncompiled.get("f", "")
    assert repr(model) == (
        "NonlinearModel(2 states, 1 input, 1 output, sampling_period=1; "
        + ("f called from Python)" if why else "compiled)")
    )


def test_called_and_compiled_functions_are_bitwise_identical() -> None:
    called, compiled = (NonlinearModel(one, angle, **SIZES) for one in (calls_another, as_list))
    for kind in (ExtendedKalmanFilter, UnscentedKalmanFilter):
        np.testing.assert_allclose(
            state_of(called, kind), state_of(compiled, kind), rtol=1e-14, atol=1e-15
        )


def test_text_model_accepts_given_jacobians() -> None:
    given = NonlinearModel(
        ["a + w/10", "w - g*sin(a)/10 + u/10"], "a", F=[["1", "1/10"], ["-g*cos(a)/10", "1"]],
        H=[["1", "0"]], parameters={"g": 2.5}, **TEXT,
    )  # fmt: skip
    derived = NonlinearModel(["a + w/10", "w - 2.5*sin(a)/10 + u/10"], "a", **TEXT)
    np.testing.assert_allclose(state_of(given), state_of(derived), rtol=1e-13, atol=1e-14)
    assert repr(given).endswith("from text, compiled)")


def test_finite_differences_scale_with_the_states() -> None:
    """A state in micrometres: with unit steps the sine would appear constant."""
    model = NonlinearModel(
        lambda x: np.array([math.sin(1e6 * x[0]) / 1e6]), angle, 0.0, 1.0, states=1, outputs=1,
        scale=1e-6,
    )  # fmt: skip
    one = ExtendedKalmanFilter(model)
    found = one.predict(one.init([0.5e-6], 1.0).posterior)
    assert found.covariance[0, 0] == pytest.approx(math.cos(0.5) ** 2, rel=1e-11)


def test_model_can_be_pickled() -> None:
    for f in (["a + w/10", "w - sin(a)/10"], as_list):
        options = SIZES if callable(f) else TEXT
        model = NonlinearModel(f, angle if callable(f) else "a", **options)
        wanted = state_of(model)
        again = pickle.loads(pickle.dumps(model))
        assert repr(again) == repr(model)
        assert np.array_equal(state_of(again), wanted)


def test_names_reach_data_frames_and_plots() -> None:
    model = NonlinearModel(
        ["a + w/10", "w - sin(a)/10 + u/10"], "a", output_names=["encoder"], **TEXT
    )
    one = ExtendedKalmanFilter(model)
    run = one.run(Y, U, start=one.init([0.1, 0.2], 1.0))
    assert list(run.to_pandas()) == [
        "state_a", "state_w", "variance_a", "variance_w", "covariance_a_a", "covariance_a_w",
        "covariance_w_a", "covariance_w_w", "innovation_encoder",
        "innovation_covariance_encoder_encoder", "log_likelihood",
    ]  # fmt: skip
    figure = run.plot(["state", "covariance", "innovation", "log_likelihood"])
    axes = figure.axes
    labels = [[line.get_label() for line in ax.lines] for ax in axes]
    assert labels[0] == ["a", "w"]
    assert labels[1][1] == "a, w"
    assert labels[2:] == [["encoder"], ["log_likelihood"]]
    assert [ax.get_ylabel() for ax in axes[:2]] == ["state", "covariance"]
    figure.draw_without_rendering()  # legends are outside the axes and within the figure
    for ax in axes[:3]:
        legend = ax.get_legend().get_window_extent()
        assert ax.bbox.x1 < legend.x0 < legend.x1 < figure.bbox.x1


# --- Errors -------------------------------------------------------------------------------------


def changes(x: Array, u: Array) -> Array:
    x += 1.0
    return x


def changes_p(x: Array, u: Array, p: Array) -> Array:
    p[0] = 2.0
    return x


def model(f: Any = as_list, h: Any = angle, **changed: Any) -> Callable[[], NonlinearModel]:
    return lambda: NonlinearModel(f, h, **{**SIZES, **changed})


def text(f: Any = ("a + w", "w"), h: Any = "a", **changed: Any) -> Callable[[], NonlinearModel]:
    return lambda: NonlinearModel(list(f), h, **{**TEXT, **changed})


REFUSED: list[tuple[Callable[[], Any], str]] = [
    (model(lambda x, u: x[:1]), "f: returns an array of shape (1,), must return 2 numbers"),
    (model(h=lambda x: x), "h: returns an array of shape (2,), must return 1 number"),
    (model(lambda x, u: "a"), "f: returns 'a' at x = [1.0, 1.0], must return 2 numbers"),
    (model(lambda x, u: None), "f: returns None at x = [1.0, 1.0], must return 2 numbers"),
    (model(lambda x, u: 1j * x), "f: returns array([0.+1.j, 0.+1.j]) at x = [1.0, 1.0], must"),
    (model(lambda x, u: x[7]), "f: raises IndexError: index 7 is out of bounds for axis 0 with"),
    (model(lambda: 1.0), "f: must be a function of x and u, or of x alone"),
    (model(changes), "f: changes the arrays it is given, must leave x and u alone"),
    (
        model(lambda: 1.0, parameters={"k": 1.0}),
        "f: must be a function of x and u, or of x alone, or",
    ),
    (model(lambda x, u, p: x), "f: takes p, but the model has no parameters"),
    (
        model(lambda x, u, p: p[:1], parameters={"k": 1.0}),
        "f: returns an array of shape (1,), must",
    ),
    (
        model(changes_p, parameters={"k": 1.0}),
        "f: changes the arrays it is given, must leave x, u and",
    ),
    (model(3.0), "f: 3.0 must be a function of x and u, or a list of texts"),
    (model(F=lambda x, u: x), "F: returns an array of shape (2,), must return 2 rows of 2"),
    (model(H=[["1", "0"]]), "state_names: are left out, must name what the texts are of"),
    (model(states=None), "states: is left out, must be the number of them"),
    (model(outputs=0), "outputs: 0 must be a whole number, from 1 to 1000"),
    (model(state_names=["a"]), "state_names: are 1, must be 2"),
    (model(scale=[1.0, 0.0]), "scale: [1.0, 0.0] must be one positive number, or 2"),
    (model(scale=[1.0] * 3), "scale: [1.0, 1.0, 1.0] must be one positive number, or 2"),
    (model(R=-1.0), "R: must be positive semidefinite, its eigenvalues are -1"),
    (model(Q=[1.0] * 3), "Q: has shape (3,), must be one number (times the identity), 2 numbers"),
    (model(sampling_period=0.0), "sampling_period: 0 must be greater than zero"),
    (model(substeps=-1), "substeps: -1 must be a whole number, from 0 to 10000"),
    (text(f=["a", "a +"]), "f[1]: 'a +' is no expression, at its end"),
    (text(f=["a", "z"]), "f[1]: 'z' names z, must name nothing but a, w, u"),
    (text(f=["a"]), "f: has 1 texts, must have 2"),
    (text(f=["a", "w"], states=3), "state_names: are 2, must be 3"),
    (text(h=["a", 1.0]), "h: ['a', 1.0] must be a function of x and u, or a list of texts"),
    (text(F=[["1", "0"]]), "F: [['1', '0']] must be a function, or 2 rows of 2 texts"),
    (text(F=[["1", 0.0], ["0", "1"]]), "F: [['1', 0.0], ['0', '1']] must be a function, or 2 rows"),
    (text(H=[["1", "q"]]), "H[0][1]: 'q' names q, must name nothing but a, w, u"),
    (text(input_names=["a"]), "input_names: ['a', 'w', 'a'] must be different names"),
    (text(input_names=["1"]), "input_names: ['1'] must be different names, as those of variables"),
    (text(parameters=3.0), "parameters: 3.0 must be numbers by name"),
    (text(parameters={"a": 1.0}), "parameters: ['a', 'w', 'u', 'a'] must be different names"),
    (text(parameters={"g": "x"}), "parameters.g: 'x' is not a number or an array of numbers"),
    (
        lambda: NonlinearModel.from_ode(["w", "-a"], "a", **TEXT, sampling_period=1.0, substeps=0),
        "substeps: 0 must be a whole number, from 1 to 10000",
    ),
    (lambda: ExtendedKalmanFilter(3.0), "model: 3.0 must be of type NonlinearModel"),  # type: ignore[arg-type]
    (lambda: UnscentedKalmanFilter(text()(), alpha=0.0), "alpha: 0 must be greater than zero"),
    (lambda: UnscentedKalmanFilter(text()(), alpha=2.0), "alpha: 2 must be from 1e-6 to 1"),
    (lambda: UnscentedKalmanFilter(text()(), kappa=-2.0), "kappa: -2 must be above -2, minus n"),
]


@pytest.mark.parametrize(("call", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_invalid_model_is_refused(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(said)


NOISE_REFUSED = [
    ({"Q": np.ones((3, 2, 2))}, "Q: has shape (3, 2, 2), must be one covariance or (30, 2, 2)"),
    ({"Q": -1.0}, "Q: must be positive semidefinite, its eigenvalues are -1, -1"),
    ({"R": np.full(30, -1.0)}, "R[0]: must be positive semidefinite, its eigenvalues are -1"),
    ({"Q": np.tile([[1.0, 1.0], [0.0, 1.0]], (30, 1, 1))}, "Q[0]: [[1.0, 1.0], [0.0, 1.0]] must"),
]


@pytest.mark.parametrize(("noise", "said"), NOISE_REFUSED)
def test_invalid_noise_is_refused(noise: dict[str, Any], said: str) -> None:
    one = ExtendedKalmanFilter(text()())
    with pytest.raises(InputError) as error:
        one.run(Y, U, start=one.init([0.0, 0.0], 1.0), **noise)
    assert str(error.value).startswith(said)


def later(x: Array, u: Array) -> list[float]:
    """Like `calls_another`, until the input changes."""
    if u[0] == 3:
        raise KeyError("lost")
    return calls_another(x, u)[: 1 if u[0] == 2 else 2]


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
@pytest.mark.parametrize(
    ("value", "said"),
    [(2.0, "f: returns an array of shape (1,), must return 2 numbers"),
     (3.0, "f: raises KeyError: 'lost' at x = [")],
)  # fmt: skip
def test_function_failing_in_a_run_is_named(kind: Any, value: float, said: str) -> None:
    one = kind(NonlinearModel(later, angle, **SIZES))
    start = one.init([0.1, 0.2], 1.0)
    u = np.zeros(30)
    u[10] = value
    with pytest.raises(InputError) as error:
        one.run(Y, u, start=start)
    assert str(error.value).startswith(said)
    assert len(one.run(Y, np.zeros(30), start=start)) == 30  # and nothing of it remains
    with pytest.raises(InputError):
        one.predict(start.posterior, [value])


def breaks(x: Array, u: Array) -> list[float]:
    return [x[0] / (u[0] - 1.0), x[1]]


def breaks_called(x: Array, u: Array) -> list[float]:
    return [float(x[0]) / (float(u[0]) - 1.0), helper(x[1])]


DIVERGES = [
    (breaks, angle, "f, or the covariance after it, is not finite at the next sample"),
    (breaks_called, angle, "f, or the covariance after it, is not finite at the next sample"),
    (as_list, lambda x, u: x[0] / (u[0] - 1.0), "h is not finite at the next sample"),
]


@pytest.mark.parametrize(("f", "h", "why"), DIVERGES)
@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_non_finite_value_is_reported_with_the_time(kind: Any, f: Any, h: Any, why: str) -> None:
    one = kind(NonlinearModel(f, h, **SIZES, sampling_period=0.5))
    u = np.zeros(30)
    u[10] = 1.0
    start = one.init([0.1, 0.2], 1.0)
    with pytest.raises(DivergenceError) as error:
        one.run(Y, u, start=start)
    last = (
        5.0 if why.startswith("f") else 4.5
    )  # f leads from row 10 to the next, h belongs to row 10
    assert error.value.time == last
    assert error.value.finding == why
    run = one.run(Y, u, start=start, on_divergence="return")
    assert run.diverged_at == run.time[-1] == last


def test_indefinite_covariance_is_reported() -> None:
    """With a large negative central weight the variance of a parabola becomes negative."""
    model = NonlinearModel("x^2", "x", 0.0, 1.0, state_names=["x"])
    one = UnscentedKalmanFilter(model, alpha=1.0, beta=-2.0, kappa=-0.5)
    posterior = one.init([0.0], 1.0).posterior
    with pytest.raises(DivergenceError, match="no longer positive semidefinite, so that it has no"):
        one.predict(posterior)

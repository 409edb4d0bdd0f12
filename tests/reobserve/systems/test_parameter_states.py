"""Parameters as states: the same model by hand, and known parameters found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from reobserve import ExtendedKalmanFilter, NonlinearModel, UnscentedKalmanFilter
from reobserve.core.errors import InputError

T = 0.05
NAMES = {"state_names": ["angle", "rate"], "input_names": ["torque"]}


def pendulum(as_text: bool, length: float = 1.0) -> NonlinearModel:
    options = {
        "Q": [1e-10, 1e-8], "R": 1e-6, "sampling_period": T,
        "parameters": {"damping": 0.1, "length": length},
    }  # fmt: skip
    if as_text:
        return NonlinearModel.from_ode(
            ["rate", "torque - damping*rate - 9.81/length*sin(angle)"], ["angle"], **NAMES,
            **options,
        )  # fmt: skip
    return NonlinearModel.from_ode(
        lambda x, u, p: np.array([x[1], u[0] - p[0] * x[1] - 9.81 / p[1] * np.sin(x[0])]),
        lambda x: x[0], states=2, inputs=1, outputs=1, **options,
    )  # fmt: skip


def record(rows: int = 400) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    u, x, y = 0.3 * rng.standard_normal(rows), np.array([0.8, 0.0]), np.empty(rows)
    for k in range(rows):
        y[k] = x[0] + 1e-3 * rng.standard_normal()
        slope = lambda t, s, v=u[k]: [s[1], v - 0.1 * s[1] - 9.81 / 1.3 * np.sin(s[0])]  # noqa: E731
        x = solve_ivp(slope, (0, T), x, rtol=1e-10, atol=1e-12).y[:, -1]
    return y, u


@pytest.mark.nightly_cases("UnscentedKalmanFilter")
@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_length_of_a_pendulum_is_found(kind: type) -> None:
    y, u = record()
    found = []
    for as_text in (True, False):
        model = pendulum(as_text).with_parameter_states({"length": 0.0})
        assert not model.uncompiled
        assert model.parameter_names == ("damping",)
        observer = kind(model)
        start = observer.init([0.8, 0, 1.0], [1e-4, 1e-4, 0.1])
        found.append(observer.run(y, u, start=start))
    text, python = found
    assert text["state"][-1, 2] == pytest.approx(1.3, abs=4 * np.sqrt(text["variance"][-1, 2]))
    assert np.sqrt(text["variance"][-1, 2]) < 1e-3
    np.testing.assert_allclose(python["state"], text["state"], rtol=1e-6, atol=1e-8)
    # By hand, with the parameter as a third state.
    whole = NonlinearModel.from_ode(
        ["rate", "torque - 0.1*rate - 9.81/length*sin(angle)", "0"], ["angle"],
        Q=[1e-10, 1e-8, 0], R=1e-6, sampling_period=T,
        state_names=["angle", "rate", "length"], input_names=["torque"],
    )  # fmt: skip
    other = kind(whole)
    expected = other.run(y, u, start=other.init([0.8, 0, 1.0], [1e-4, 1e-4, 0.1]))
    np.testing.assert_allclose(text["state"], expected["state"], rtol=1e-10, atol=1e-12)


def test_all_parameters_and_discrete_models() -> None:
    def discrete(as_text: bool) -> NonlinearModel:
        f = ["a*x + b*u"] if as_text else (lambda x, u, p: [p[0] * x[0] + p[1] * u[0]])
        h = ["x"] if as_text else (lambda x: x)
        names = {"state_names": ["x"], "input_names": ["u"]}
        sizes = {"states": 1, "inputs": 1, "outputs": 1}
        return NonlinearModel(
            f, h, 1e-8, 1e-4, parameters={"a": 0.5, "b": 0.5}, **(names if as_text else sizes)
        )

    rng = np.random.default_rng(0)
    u, x, y = rng.standard_normal(500), 0.0, np.empty(500)
    for k in range(500):
        y[k] = x + 0.01 * rng.standard_normal()
        x = 0.8 * x + 1.5 * u[k]
    states = []
    for as_text in (True, False):
        model = discrete(as_text).with_parameter_states({"b": 1e-9, "a": 0.0})
        assert (model.states, model.parameters) == (3, None)
        assert model.Q.diagonal().tolist() == [1e-8, 1e-9, 0.0]
        observer = ExtendedKalmanFilter(model)
        run = observer.run(y, u, start=observer.init([0, 0.5, 0.5], 1.0))
        states.append(run["state"])
        off = run["state"][-1, 1:] - [1.5, 0.8]
        assert (np.abs(off) < 4 * np.sqrt(run["variance"][-1, 1:])).all()
    np.testing.assert_allclose(states[0], states[1], atol=1e-7)


def test_density_and_periods_are_kept() -> None:
    model = NonlinearModel.from_ode(
        ["rate", "-k*sin(angle)"], ["angle"], density=[1e-6, 1e-4], R=1.0, sampling_period=0.5,
        state_names=["angle", "rate"], parameters={"k": 2.0}, state_periods={"angle": 6.28},
        output_periods=[6.28],
    ).with_parameter_states({"k": 1e-3})  # fmt: skip
    assert model.density is not None
    np.testing.assert_allclose(model.density.diagonal(), [1e-6, 1e-4, 1e-3])
    assert model.state_periods is not None
    assert model.state_periods.tolist() == [6.28, 0, 0]


def test_walks_of_what_is_no_parameter_are_refused() -> None:
    for walks, message in (
        ({"lenght": 1.0}, r"random_walk\.lenght: .*length"),
        ({"length": -1.0}, r"random_walk\.length: -1 must be 0 or more"),
        ({}, "random_walk"),
    ):
        with pytest.raises(InputError, match=message):
            pendulum(True).with_parameter_states(walks)

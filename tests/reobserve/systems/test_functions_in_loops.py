"""Functions of users and of text as compiled loops call them: copies, bounds and errors."""

from __future__ import annotations

import copy
import math
import pickle
import threading
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve import (
    DivergenceError,
    ExtendedKalmanFilter,
    InputError,
    NonlinearModel,
    UnscentedKalmanFilter,
)
from reobserve.core.covariances import as_covariance, as_covariances
from reobserve.core.vector_field import vector_field
from reobserve.observers.high_gain import HighGainObserver
from reobserve.systems.triangular import TriangularModel
from reobserve.systems.triangular_text import triangular_model

Array = NDArray[np.float64]
FILTERS = (ExtendedKalmanFilter, UnscentedKalmanFilter)
TABLE = np.array([1.0, 2.0, 4.0])


@numba.njit
def looked_up(x: float) -> float:
    return TABLE[int(x)]


def estimates(kind: Any, f: Any, y: list[float], start: float = 0.0) -> Array:
    """States of a filter that takes the measurements as they are."""
    model = NonlinearModel(f, lambda x: x[0], 1.0, 1e-9, F=lambda x: [[1.0]], states=1, outputs=1)
    filtered = kind(model)
    state: Array = filtered.run(y, start=filtered.init([start], 1e-3))["state"]
    return state


# Functions of numba in modules, and such a function that calls one.
TABLES, PACKAGE = ModuleType("tables"), ModuleType("package")
vars(TABLES).update(looked_up=looked_up, scale=1.0)
vars(PACKAGE).update(tables=TABLES)


@numba.njit
def looked_up_there(x: float) -> float:
    return TABLES.looked_up(x)  # type: ignore[no-any-return]


class Uncompiled:
    """What numba does not compile."""

    def __init__(self, f: Callable[[Array], Any]) -> None:
        self.f = f

    def __call__(self, x: Array) -> Any:
        return self.f(x)


@pytest.mark.nightly_cases("<lambda>2-ExtendedKalmanFilter")
@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize(
    "f",
    [
        lambda x: TABLE[int(x[0])],
        lambda x: looked_up(x[0]),
        lambda x: TABLES.scale * TABLES.looked_up(x[0]),
        lambda x: PACKAGE.tables.looked_up(x[0]),
        lambda x: looked_up_there(x[0]),
        Uncompiled(lambda x: TABLE[int(x[0])]),
    ],
)
def test_index_beyond_a_table_has_the_words_of_python(kind: Any, f: Any) -> None:
    looked_up_there(1.0)  # compiled before, as is what it calls, without checks
    assert estimates(kind, f, [0.5, 1.5, 2.5])[-1, 0] == pytest.approx(2.5)
    with pytest.raises(InputError, match="f: raises IndexError: index 7 is out of bounds"):
        estimates(kind, f, [0.5, 7.5, 2.5])


def refuses(x: Array) -> Any:
    if x[0] > 5:
        raise ZeroDivisionError("the tank is outside its domain")
    return x


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("wrap", [lambda f: f, Uncompiled])
def test_statement_that_raises_is_heard_once(kind: Any, wrap: Any) -> None:
    for _ in range(2):
        with pytest.raises(InputError, match="ZeroDivisionError: the tank is outside its domain"):
            estimates(kind, wrap(refuses), [1.0, 6.0, 1.0])
        assert np.isfinite(estimates(kind, wrap(refuses), [1.0, 2.0])).all()


def test_wrong_number_of_values_is_said() -> None:
    def grows(x: Array) -> Any:
        return np.ones(2 if x[0] > 5 else 1)

    with pytest.raises(InputError, match=r"f: returns an array of shape \(2,\)"):
        estimates(ExtendedKalmanFilter, grows, [1.0, 6.0, 1.0])


@pytest.mark.parametrize("wrap", [lambda f: f, Uncompiled])
def test_function_cannot_write_into_the_filter(wrap: Any) -> None:
    def limited(x: Array) -> float:
        if x[0] > 3:
            x[0] = 3.0
        return x[0]

    model = NonlinearModel(
        lambda x: x, wrap(limited), 1e-2, 1.0, F=lambda x: [[1.0]], H=lambda x: [[0.0]],
        states=1, outputs=1,
    )  # fmt: skip
    kalman = ExtendedKalmanFilter(model)
    assert kalman.run([8.0], start=kalman.init([8.0], 1.0))["state"].tolist() == [[8.0]]


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("power", ["1/u**2", "u**(-3)", "1/u**4", "1.0/u"])
def test_division_by_zero_in_a_text_is_infinite(kind: Any, power: str) -> None:
    model = NonlinearModel(
        [f"w/2 + {power}"], ["w"], 1.0, 1.0, state_names=["w"], input_names=["u"], inputs=1
    )
    out = np.full(1, 7.0)
    model.functions.f(np.ones(1), np.zeros(1), out)  # as Python calls it
    filtered = kind(model)
    with pytest.raises(DivergenceError):
        filtered.run([1.0, 1.0, 1.0], [1.0, 0.0, 1.0], start=filtered.init([0.0], 1.0))
    run = filtered.run([0.0, 0.0], [2.0, 2.0], start=filtered.init([0.0], 0.0))
    sought = {"1/u**2": 0.25, "u**(-3)": 0.125, "1/u**4": 0.0625, "1.0/u": 0.5}[power]
    S = run["innovation_covariance"][1, 0, 0]
    assert run["state"][1, 0] == pytest.approx(sought / S, rel=1e-12)


def test_error_is_raised_in_the_thread_of_its_run() -> None:
    heard: list[str] = []

    def go(y: list[float], good: bool) -> None:
        for _ in range(20):
            try:
                estimates(ExtendedKalmanFilter, refuses, y)
            except InputError:
                if good:
                    heard.append("a good run raised")
            else:
                if not good:
                    heard.append("a bad run said nothing")

    threads = [
        threading.Thread(target=go, args=(y, good))
        for y, good in (([1.0] * 50, True), ([9.0] * 50, False)) * 2
    ]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert heard == []


def test_parts_of_many_records_raise_what_a_thread_raised() -> None:
    model = NonlinearModel(
        lambda x: TABLE[int(x[0])], lambda x: x[0], 1.0, 1e-9, F=lambda x: [[1.0]], states=1,
        outputs=1,
    )  # fmt: skip
    kalman = ExtendedKalmanFilter(model)
    y = np.full((4, 5000, 1), 1.5)
    y[3, 4000] = 9.5
    with pytest.raises(InputError, match="IndexError: index 9 is out of bounds"):
        kalman.run(y, start=kalman.init([0.0], 1e-3))


@vector_field
def beyond(x: Any, parameters: Any, out: Any) -> None:
    x[0] = 100.0
    out[0] = -parameters[int(out[0] * 0.0)]


@vector_field
def table_gain(x: Any, parameters: Any, out: Any) -> None:
    out[0] = parameters[int(x[0])]


def test_vector_field_reports_an_index_and_leaves_the_state_alone() -> None:
    model = TriangularModel(1, beyond, table_gain, [1.0, 1.0])
    observer = HighGainObserver(model, rho=1.0, sampling_period=0.1)
    good = observer.run([0.0, 1.0, 0.0], [0.0] * 3, start=observer.init([0.0]))
    assert abs(good["state"]).max() < 1.0
    with pytest.raises(InputError, match="table_gain: raises IndexError: index 2 is out of bounds"):
        observer.run([0.0, 5.0, 0.0], [0.0] * 3, start=observer.init([0.0]))


def test_text_models_can_be_pickled_and_copied() -> None:
    model = triangular_model(["a", "b"], ["0", "-sin(a)"], "1")
    observer = HighGainObserver(model, rho=1.0, sampling_period=0.1)
    y, u = np.sin(np.arange(10.0)), np.zeros(10)
    sought = observer.run(y, u, start=observer.init([0.0, 0.0]))["state"]
    for one in (pickle.loads(pickle.dumps(observer)), copy.deepcopy(observer)):
        assert np.array_equal(one.run(y, u, start=one.init([0.0, 0.0]))["state"], sought)


# --- Covariances --------------------------------------------------------------------------------


def test_covariance_is_decided_in_units_of_its_deviations() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        n = int(rng.integers(2, 6))
        root = (10.0 ** rng.uniform(-9, 9, n))[:, None] * rng.normal(size=(n, n - 1))
        P = root @ root.T
        assert np.allclose(as_covariance("P", P, n), P, rtol=1e-15)
        wrong = P.copy()
        wrong[0, 1] = wrong[1, 0] = 1.001 * math.sqrt(P[0, 0] * P[1, 1])
        with pytest.raises(InputError, match="P: must be positive semidefinite"):
            as_covariance("P", wrong, n)
    with pytest.raises(InputError, match=r"variance at \[1, 1\] is -1e-09"):
        as_covariance("P", [1e20, -1e-9], 2)
    with pytest.raises(InputError, match=r"Q\[1\].*variance at"):
        as_covariances("Q", np.array([np.eye(2), np.diag([1e20, -1e-9])]), 2, 2)
    with pytest.raises(InputError, match="variance of 0"):
        as_covariance("P", [[1e20, 1e-9], [1e-9, 0.0]], 2)

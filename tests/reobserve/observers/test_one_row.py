"""Steps on plain numbers: bitwise what the way of all records gives, refusals included."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
)
from reobserve.core.errors import ReobserveError
from reobserve.observers import one_row
from reobserve.observers.contract import Observer
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import KalmanState
from reobserve.observers.record import Record, Rows

CHAIN = [[0.9, 0.1], [0.2, 0.8]]


def model(n: int, m: int, p: int) -> LinearModel:
    """A chain of n states of which the first m are measured and p driven."""
    A = 0.9 * np.eye(n) + 0.1 * np.eye(n, k=1)
    B, C = np.eye(n)[:, :p], np.eye(n)[:m]
    return LinearModel(A, B if p else None, C, Q=1e-2, R=1e-1, sampling_period=0.1)


def swing(**options: Any) -> NonlinearModel:
    """A pendulum with a parameter, of which the angle is measured."""
    return NonlinearModel(
        ["a + 0.1*w", "w - g*sin(a) + v"], ["a"], [1e-4, 1e-3], 1e-2,
        state_names=["a", "w"], input_names=["v"], parameters={"g": 0.5}, sampling_period=0.1,
        **options,
    )  # fmt: skip


def python_swing() -> NonlinearModel:
    """A function that numba does not compile, so that loops call Python."""
    return NonlinearModel(
        lambda x, u: np.array([x[0] + 0.1 * x[1], x[1] - 0.5 * math.sin(float(str(x[0])))]),
        lambda x: x[:1], [1e-4, 1e-3], 1e-2, states=2, inputs=1, outputs=1,
    )  # fmt: skip


RULES: tuple[dict[str, Any], ...] = (
    {}, {"gate": 1.0}, {"gate": 1.0, "outliers": "inflate"}, {"noise_memory": 20.0},
)  # fmt: skip
OBSERVERS: dict[str, Any] = {
    **{
        f"Kalman {n} {m} {p} {tuple(rules.items())}": lambda n=n, m=m, p=p, rules=rules: (
            KalmanFilter(model(n, m, p), **rules)
        )
        for (n, m, p), rules in product(((2, 1, 0), (2, 1, 1), (3, 2, 2)), RULES)
    },
    **{
        f"EKF {tuple(rules.items())}": lambda rules=rules: ExtendedKalmanFilter(swing(), **rules)
        for rules in RULES
    },
    "UKF": lambda: UnscentedKalmanFilter(swing(), gate=1.0),
    "EKF of Python": lambda: ExtendedKalmanFilter(python_swing()),
    "angles": lambda: ExtendedKalmanFilter(swing(state_periods={"a": 2 * np.pi})),
    "SVSF": lambda: SmoothVariableStructureFilter(
        model(2, 1, 1), boundary_layer=0.5, convergence_rate=0.1
    ),
    "augmented": lambda: AugmentedKalmanFilter(
        model(2, 1, 1), fault_matrix=[[0.0], [0.1]], random_walk=1e-3
    ),
    **{
        f"IMM {n} {m} {p} {tuple(rules.items())}": lambda n=n, m=m, p=p, rules=rules: IMM(
            [KalmanFilter(model(n, m, p)), KalmanFilter(model(n, m, p))], CHAIN, **rules
        )
        for (n, m, p), rules in product(
            ((2, 1, 0), (2, 1, 1)),
            ({}, {"gate": 1.0}, {"noise_memory": 20.0}, {"mixing": False}),
        )
    },
}


@pytest.fixture(params=OBSERVERS, scope="module")
def observer(request: pytest.FixtureRequest) -> Any:
    return OBSERVERS[request.param]()


def begun(observer: Any, rows: int = 12) -> Any:
    """A state after more rows than there are states."""
    n, m, p = sizes(observer)
    rng = np.random.default_rng(1)
    y, u = rng.normal(size=(rows, m)), rng.normal(size=(rows, p))
    return observer.run(y, u, start=observer.init([0.1] * n, 1.0)).end


def sizes(observer: Any) -> tuple[int, int, int]:
    one = observer.filters[0].model if isinstance(observer, IMM) else observer.model
    return one.states, one.outputs, one.inputs


def stepped(observer: Any, state: Any, y: Any, u: Any) -> list[object]:
    """All bits of a step, or the error that refuses it."""
    try:
        state, estimate = observer.step(state, y, u)
    except (ReobserveError, TypeError, ValueError) as error:
        return [type(error), str(error)]
    if isinstance(observer, IMM):
        posterior = [state.means, state.covariances, state.errors, state.log_probabilities]
    else:
        posterior = [*vars(state.posterior).values()]
    after = [*posterior, state.sample, state.noise]
    values = [(name, np.asarray(value).tobytes()) for name, value in estimate.estimates.items()]
    bits = [None if each is None else (each.shape, each.tobytes()) for each in after]
    return [values, bits, state.count, state.time, state.held, estimate.time, estimate.units]


def by_record(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have steps go the way of all records."""
    for kind in (GaussianFilter, IMM):
        monkeypatch.setattr(kind, "_quick_step", Observer._quick_step)


@pytest.mark.parametrize("entry", [True, False], ids=["machine code", "dispatcher"])
def test_steps_are_those_of_records(
    observer: Any, entry: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With numba's entry point, and where it has none."""
    if not entry:
        monkeypatch.setattr(one_row, "_machine_code", lambda *_: None)
    vars(observer).pop("_spare_rows", None)
    _, m, p = sizes(observer)
    rng = np.random.default_rng(2)
    rows = [(rng.normal(size=m), rng.normal(size=p)) for _ in range(8)]
    rows[3] = (np.full(m, np.nan), rows[3][1])
    rows[5][0][0] = np.nan
    rows[6][0][0] = 50.0  # beyond a gate
    states = [begun(observer)]
    quick = []
    for y, u in rows:
        quick.append(stepped(observer, states[-1], y, u))
        states.append(observer.step(states[-1], y, u)[0])
    assert vars(observer)["_spare_rows"], "no step was quick"
    with monkeypatch.context() as patched:
        by_record(patched)
        for (y, u), state, found in zip(rows, states, quick, strict=False):
            assert stepped(observer, state, y, u) == found


def odd_rows(m: int, p: int) -> list[tuple[Any, Any]]:
    """Rows of other types and shapes, some of which are taken and some refused."""
    y, u = np.linspace(0.1, 0.2, m), np.linspace(0.3, 0.4, p)
    return [
        (list(y), list(u)), (y.astype(np.float32), u), (np.arange(m), u), (y, u.astype(object)),
        (np.append(y, 1.0), u), (y[:-1], u), (y[None], u[None]), (y, np.append(u, 1.0)), (y, None),
        (np.full(m, np.inf), u), (np.full(m, 1e200), u), (y, np.full(p, np.nan)), ("text", u),
        (y.astype(str), u), (None, u), (y[::-1], u), (np.array(0.5), u), (y + 0j, u),
        (np.ma.masked_invalid(np.full(m, np.nan)), u), (y, np.full(p, 1e308)),
    ]  # fmt: skip


def test_odd_rows_are_taken_or_refused_alike(
    observer: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, m, p = sizes(observer)
    state, rows = begun(observer), odd_rows(m, p)
    found = [stepped(observer, state, y, u) for y, u in rows]
    by_record(monkeypatch)
    assert found == [stepped(observer, state, y, u) for y, u in rows]


def test_states_are_not_changed_and_estimates_are_their_own(observer: Any) -> None:
    _, m, p = sizes(observer)
    first, row = begun(observer), (np.full(m, 0.1), np.full(p, 0.2))
    before = stepped(observer, first, *row)
    kept = observer.step(first, *row)[1]
    bits = {name: np.asarray(value).tobytes() for name, value in kept.estimates.items()}
    for _ in range(3):
        observer.step(begun(observer, 20), np.full(m, 5.0), np.full(p, -1.0))
    assert {name: np.asarray(value).tobytes() for name, value in kept.estimates.items()} == bits
    assert stepped(observer, first, *row) == before


class Mirrored(KalmanFilter):
    """A user's filter that calls the loop in a way of its own."""

    def _fill(self, state: KalmanState, record: Record) -> Rows:
        return super()._fill(state, record._replace(y=-record.y))


class MirroredBank(IMM):
    """A user's bank that calls the loop in a way of its own."""

    def _fill(self, state: Any, record: Record) -> Rows:
        return super()._fill(state, record._replace(y=-record.y))


@pytest.mark.parametrize(
    "observer",
    [
        Mirrored(model(2, 1, 0)),
        MirroredBank([KalmanFilter(model(2, 1, 0))] * 2, CHAIN),
    ],
)
def test_step_calls_the_loop_as_a_subclass_does(observer: Any) -> None:
    state, y = begun(observer), np.array([0.3])
    run = observer.run(y[None], start=state)
    assert np.array_equal(observer.step(state, y)[1]["state"], run["state"][0])


def test_error_of_a_function_is_raised_and_the_next_step_is_right() -> None:
    fails = [False]

    def f(x: Any, u: Any) -> Any:
        if fails[0]:
            raise RuntimeError(f"no sensor at {str(x[0])[:0]}")
        return 0.9 * x

    observer = ExtendedKalmanFilter(
        NonlinearModel(f, lambda x: x, 1e-2, 1e-1, states=1, inputs=0, outputs=1)
    )
    state, y = begun(observer), np.array([0.1])
    before = stepped(observer, state, y, None)
    fails[0] = True
    assert "no sensor" in str(stepped(observer, state, y, None)[1])
    fails[0] = False
    assert stepped(observer, state, y, None) == before

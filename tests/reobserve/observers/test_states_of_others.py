"""A state that another filter made: refused, or taken as an unmarked copy of it is."""

from __future__ import annotations

import pickle
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    FaultBank,
    FixedGainObserver,
    GridFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
)
from reobserve.core.errors import InputError, ReobserveError

CHAIN = [[0.9, 0.1], [0.2, 0.8]]


class Own:
    """A user's filter, whose error after a correction is no number."""

    def __init__(self, kalman: KalmanFilter) -> None:
        self.kalman, self.model = kalman, kalman.model

    def predict(self, posterior: Any, u: Any) -> Any:
        return self.kalman.predict(posterior._with(error=np.zeros(1)), u)

    def correct(self, posterior: Any, y: Any, u: Any) -> Any:
        found = self.kalman.correct(posterior._with(error=np.zeros(1)), y, u)
        return found._with(posterior=found.posterior._with(error=np.array([np.nan])))


@cache
def observers() -> dict[str, Any]:
    """Filters of two states, one input and one output, or of other sizes by their kind."""
    plant = LinearModel.from_ode([[-1]], [[1]], [[1]], Q=1e-4, R=1e-2, sampling_period=0.1)
    model = LinearModel([[1, 0.1], [0, 0.9]], [[0], [1]], [[1, 0]], Q=1e-4, R=1e-2)
    text = NonlinearModel(
        ["a + 0.1*b", "0.9*b + v"], ["a"], 1e-4, 1e-2, state_names=["a", "b"], input_names=["v"],
        sampling_period=1.0,
    )  # fmt: skip
    kalman = KalmanFilter(model)
    grid = GridFilter.of_delay(plant, delays=[0.0, 0.1], random_walk=0.01)
    return {
        "kalman": kalman,
        "learning": KalmanFilter(model, noise_memory=50.0),
        "svsf": SmoothVariableStructureFilter(model, boundary_layer=0.5, convergence_rate=0.1),
        "augmented": AugmentedKalmanFilter(plant, fault_matrix=[[1.0]], random_walk=1e-4),
        "fixed": FixedGainObserver(model, gain=[[0.5], [0.5]]),
        "extended": ExtendedKalmanFilter(text),
        "bank": IMM([kalman, kalman], CHAIN),
        "learning bank": IMM([kalman, kalman], CHAIN, noise_memory=50.0),
        "own": IMM([Own(kalman), Own(kalman)], CHAIN),
        "grid": grid,
        "bank of the grid": IMM(grid.filters, grid.transition),
        "faults": FaultBank(
            plant, fault_matrix=[[1.0]], drift=0.1, jump=1.0, jump_rate=0.1, jump_time=1.0
        ),
    }


def begun(name: str) -> list[Any]:
    """States of a filter: from init, with an input before, and after two rows."""
    observer = observers()[name]
    first = observer.filters[0].model if hasattr(observer, "filters") else observer.model
    n = first.states
    mean = [0.0] * (1 if name == "faults" else n)
    spread = () if name == "fixed" else (1.0,)
    start = observer.init(mean, *spread)
    after = observer.run(np.zeros(2), np.ones((2, observer.inputs)), start=start).end
    return [start, observer.init(mean, *spread, u=[0.5] * observer.inputs), after]


def outcome(observer: Any, state: Any) -> list[object]:
    """What a run and a step from a state give, or the sentence that refuses it."""
    u, found = np.ones((3, observer.inputs)), []
    for call in (
        lambda: observer.run(np.zeros(3), u, start=state).estimates,
        lambda: dict(observer.step(state, [0.0], u[0])[1].estimates),
    ):
        try:
            found.append({name: array.tobytes() for name, array in call().items()})
        except ReobserveError as error:
            found.append(str(error))
    return found


@pytest.mark.parametrize("maker", observers())
def test_state_is_judged_as_an_unmarked_copy_of_it(maker: str) -> None:
    for state, (name, observer) in product(begun(maker), observers().items()):
        copy = pickle.loads(pickle.dumps(state))
        assert outcome(observer, state) == outcome(observer, copy), name


@pytest.mark.parametrize("value", [np.array(["raise", "return"]), pd.NA, np.array(["raise"]), None])
def test_what_is_no_word_is_refused(value: Any) -> None:
    kalman = observers()["kalman"]
    with pytest.raises(InputError, match=r"^on_divergence: "):
        kalman.run([0.0], [0.0], start=kalman.init([0, 0], 1.0), on_divergence=value)


@pytest.mark.parametrize("columns", [1, 3])
def test_frame_is_refused_for_its_shape_before_its_times(columns: int) -> None:
    """Also one without rows, whose index has no first time."""
    model = LinearModel([[0.9]], C=[[1]], Q=1e-4, R=1e-2, sampling_period=0.1)
    kalman = KalmanFilter(model)
    index = pd.date_range("2024-01-01", periods=2, freq="100ms")
    state = kalman.run(pd.DataFrame({"y": [0.0, 0.0]}, index=index), start=kalman.init([0], 1)).end
    later = pd.date_range("2024-01-02", periods=0 if columns == 1 else 2, freq="100ms")
    frame = pd.DataFrame(np.zeros((len(later), columns)), index=later)
    with pytest.raises(InputError, match=r"^y: has shape"):
        kalman.run(frame, start=state)

"""Estimators of the delay of x' = -a x + b u(t - tau)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from reobserve.core.errors import located
from reobserve.core.matrices import FloatArray
from reobserve.estimation.kinds.setup import Estimates, Setup
from reobserve.observers.delay_adaptive import AdaptiveDelayEstimator
from reobserve.observers.delay_estimator import DelayEstimator
from reobserve.observers.delay_least_squares import LeastSquaresDelayEstimator
from reobserve.observers.delay_variable_structure import VariableStructureDelayEstimator

Array = FloatArray


@dataclass(frozen=True)
class Start:
    """The delay [s] at first, and the input that stood still before the record began.

    x at the first row is measured.
    """

    delay: float
    past_input: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Delay:
    """What they have in common: the plant, and the interval [s] of the delay.

    x' and u' may stand in columns of their own; left out, they are found from the samples.
    """

    decay: float
    input_gain: float
    delay_bounds: tuple[float, float]
    start: Start

    def _ready(self, observer: DelayEstimator) -> Setup:
        past = np.full(observer.history_steps + 1, self.start.past_input)

        def begin(y: Array) -> Any:
            return observer.init(float(y[0]), self.start.delay, past)

        with located("start"):
            begin(np.zeros(1))
        return delay_setup(observer, begin)


def delay_setup(observer: DelayEstimator, start: Callable[[Array], Any]) -> Setup:
    """The setup of any of the three."""
    measured = (1, 2) if observer.measurements == 2 else (1,)
    foretells = isinstance(observer, LeastSquaresDelayEstimator)
    return Setup(
        observer, start, _model_error if foretells else None, units={"delay": ("s",)},
        left_out=("values",), widths=(measured, (1, 2)), holds_inputs=False,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AdaptiveDelay(_Delay):
    """By filtered regressors and a gradient."""

    kind: Literal["delay_adaptive"]
    filter_time: float
    forgetting: float
    adaptation_gain: float

    def set_up(self, period: float) -> Setup:
        """The estimator."""
        return self._ready(
            AdaptiveDelayEstimator(
                self.decay, self.input_gain, self.delay_bounds, self.filter_time,
                self.forgetting, self.adaptation_gain, sampling_period=period,
            )
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class VariableStructureDelay(_Delay):
    """By a relay on the delay or on its inverse."""

    kind: Literal["delay_variable_structure"]
    relay_gain: float
    relay_on: str

    def set_up(self, period: float) -> Setup:
        """The estimator."""
        return self._ready(
            VariableStructureDelayEstimator(
                self.decay, self.input_gain, self.delay_bounds, self.relay_gain,
                self.relay_on, sampling_period=period,
            )
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LeastSquaresDelay(_Delay):
    """By recursive least squares of the output error."""

    kind: Literal["delay_least_squares"]
    initial_covariance: float
    forgetting: float

    def set_up(self, period: float) -> Setup:
        """The estimator."""
        return self._ready(
            LeastSquaresDelayEstimator(
                self.decay, self.input_gain, self.delay_bounds, self.initial_covariance,
                self.forgetting, sampling_period=period,
            )
        )  # fmt: skip


def _model_error(y: Array, estimates: Estimates) -> Array:
    """What the model beside the plant does not foretell."""
    found: Array = y - estimates["values"][:, 1:2]
    return found

"""Stage observe: one observer on the record of one scenario."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from reobserve.errors import InputError
from reobserve.grid import stride
from reobserve.matrices import as_scalar
from reobserve.observers.delay_adaptive import AdaptiveDelayEstimator
from reobserve.observers.delay_estimator import DelayEstimator
from reobserve.observers.delay_least_squares import LeastSquaresDelayEstimator
from reobserve.observers.delay_variable_structure import VariableStructureDelayEstimator
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.high_gain import HighGainObserver
from reobserve.papers.delay import records
from reobserve.papers.delay.setup import UNITS, build_model, delay_bounds
from reobserve.series import Channel, Series

Settings = dict[str, Any]

_EXTENDED = (
    *("model", "order", "rho", "initial_estimate", "initial_delay", "initial_matrix"),
    *("threshold", "switched", "derivatives", "step_size"),
)
# The parameters of each algorithm; those in the second list may be left out.
PARAMETERS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "extended": (_EXTENDED, ("lambdas", "L", "sampling")),
    "standard": (("model", "rho", "mean_delay", "initial_estimate", "step_size"), ()),
    "least_squares": (("initial_covariance", "forgetting", "initial_delay", "step_size"), ()),
    "adaptive": (
        ("filter_time", "forgetting", "adaptation_gain", "initial_delay", "step_size"),
        (),
    ),
    "relay": (("relay_gain", "relay_on", "initial_delay", "step_size"), ()),
}
ESTIMATORS: dict[str, type[DelayEstimator]] = {
    "least_squares": LeastSquaresDelayEstimator,
    "adaptive": AdaptiveDelayEstimator,
    "relay": VariableStructureDelayEstimator,
}


def check_keys(settings: Settings) -> None:
    """Refuse an unknown algorithm, a missing parameter or an unknown one, by name."""
    algorithm = settings["algorithm"]
    if algorithm not in PARAMETERS:
        raise InputError("algorithm", f"{algorithm!r} must be one of {', '.join(PARAMETERS)}")
    needed, optional = PARAMETERS[algorithm]
    for name in needed:
        if name not in settings:
            raise InputError(name, f"is missing; the algorithm {algorithm} needs it")
    allowed = {"algorithm", "label", *needed, *optional}
    for name in settings:
        if name not in allowed:
            raise InputError(name, f"unknown key; {algorithm} takes {', '.join(sorted(allowed))}")


def estimate(settings: Settings, plant: Series) -> Series:
    """Estimated state and delay [s] at the ends of the observer's steps, as far as it has them.

    ``off`` is the share of each step for which the gain is switched off, up to the row's time.

    Raises
    ------
    InputError
        If a parameter of the observer cannot be used.
    DivergenceError
        If the estimate leaves the range of floating-point numbers.
    """
    observer = settings["observer"]
    check_keys(observer)
    every = stride(settings["plant"], observer["step_size"])
    channels = _RUNS[observer["algorithm"]](settings, plant, every)
    return Series(plant.time[:: 2 * every], channels, plant.events)


def build_extended(settings: Settings) -> ExtendedHighGainObserver:
    """The extended observer that an ``observers`` branch states; `InputError` if it cannot be."""
    observer = settings["observer"]
    check_keys(observer)
    built = ExtendedHighGainObserver(
        build_model(settings["plant"], observer["model"]),
        observer["step_size"],
        observer["rho"],
        observer["order"],
        delay_bounds(settings["plant"]),
        observer["threshold"],
        observer["switched"],
        None if observer["initial_matrix"] == "algebraic" else observer["initial_matrix"],
    )
    built.init(observer["initial_estimate"], observer["initial_delay"])
    return built


def build_standard(settings: Settings) -> HighGainObserver:
    """The standard observer that an ``observers`` branch states; `InputError` if it cannot be."""
    observer = settings["observer"]
    check_keys(observer)
    model = build_model(settings["plant"], observer["model"])
    built = HighGainObserver(model, observer["rho"], observer["step_size"])
    built.init(observer["initial_estimate"])
    return built


def build_estimator(settings: Settings) -> DelayEstimator:
    """The estimator of the delay alone that an ``observers`` branch states, for the scalar plant.

    Raises
    ------
    InputError
        If a parameter is missing, unknown or out of bounds.
    """
    observer = settings["observer"]
    check_keys(observer)
    own = [
        n for n in PARAMETERS[observer["algorithm"]][0] if n not in ("initial_delay", "step_size")
    ]
    rate, gain = build_model(settings["plant"], "lag").parameters
    return ESTIMATORS[observer["algorithm"]](
        float(rate),
        float(gain),
        delay_bounds(settings["plant"]),
        observer["step_size"],
        **{name: observer[name] for name in own},
    )


def build(settings: Settings) -> Any:
    """Whatever observer a branch states, with what it starts from checked; `InputError` if not."""
    observer = settings["observer"]
    check_keys(observer)
    if observer["algorithm"] == "extended":
        built = build_extended(settings)
        records.check_derivatives(settings, observer)
        return built
    if observer["algorithm"] == "standard":
        records.check_mean_delay(settings, observer["mean_delay"])
        return build_standard(settings)
    estimator = build_estimator(settings)
    least, most = delay_bounds(settings["plant"])
    first = as_scalar("initial_delay", observer["initial_delay"])
    if not least <= first <= most:
        raise InputError("initial_delay", f"{first:g} s must be from {least:g} to {most:g} s")
    return estimator


Found = dict[str, Channel]


def _extended(settings: Settings, plant: Series, every: int) -> Found:
    observer = settings["observer"]
    built = build_extended(settings)
    y, y_before = records.output(plant)
    u, u_before = records.inputs(settings, observer, plant)
    run = built.run(
        y[::every],
        u[::every],
        built.init(observer["initial_estimate"], observer["initial_delay"]),
        y_before[::every],
        u_before[::every],
    )
    unit = UNITS[observer["model"]][0]
    off = np.concatenate([[0.0], run.switched_off])
    return {
        "state": Channel(run.estimate, unit),
        "delay": Channel(run.delay, "s"),
        "off": Channel(off, "1"),
    }


def _standard(settings: Settings, plant: Series, every: int) -> Found:
    observer = settings["observer"]
    built = build_standard(settings)
    y, y_before = records.output(plant)
    u, u_before = records.delayed_input(settings, plant, observer["mean_delay"])
    start = built.init(observer["initial_estimate"])
    run = built.run(y[::every], u[::every], start, y_before[::every], u_before[::every])
    return {"state": Channel(run.estimate, UNITS[observer["model"]][0])}


def _estimator(settings: Settings, plant: Series, every: int) -> Found:
    observer = settings["observer"]
    built = build_estimator(settings)
    x = plant["state"]
    if built.output_columns == 2:
        rate, gain = build_model(settings["plant"], "lag").parameters
        x = np.column_stack([x, gain * plant["delayed_input"] - rate * x[:, 0]])
    past, control = records.past_and_present(settings, plant, every)
    run = built.run(
        x[::every], control, built.init(observer["initial_delay"], float(x[0, 0]), past)
    )
    return {"delay": Channel(run.delay, "s")}


_RUNS: dict[str, Callable[[Settings, Series, int], Found]] = {
    "extended": _extended,
    "standard": _standard,
    **dict.fromkeys(ESTIMATORS, _estimator),
}

"""Estimates do not depend on units: in others, those of each observer are scaled, and no more.

All factors are powers of two, which rounding does not notice, so that results of the filters are
scaled to the last bit. Where a solver finds gains, or text is evaluated, they are to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve import (
    ILO,
    IMM,
    AdaptiveObserver,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    ExtendedStateObserver,
    HighGainObserver,
    KalmanFilter,
    LevantDifferentiator,
    LinearModel,
    NonlinearModel,
    RigidBody,
    SampledILO,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
    luenberger,
    normal_form_observer,
    rts_smoother,
    steady_kalman,
)
from reobserve.observers.augmented_kalman import CROSS
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.systems.triangular_text import triangular_model
from tests.reobserve.observers.by_row import MODEL, OTHER, record

Array = NDArray[np.float64]

MEAN, SPREAD, STAYS = np.array([0.3, -0.2, 0.1]), 0.5, [[0.9, 0.1], [0.2, 0.8]]
INERTIA = np.array([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
y, u = record(40)


class Units(NamedTuple):
    """How large units are: of states, inputs, measurements, and unknown inputs or faults."""

    x: Array
    u: Array
    y: Array
    d: float


class Case(NamedTuple):
    """An observer and its record in some units, and in which its estimates are."""

    observer: Any
    state: Any
    y: Array
    u: Array | None
    scales: Mapping[str, Any]


def linear(make: Callable[[LinearModel, Units], Any], of: Units) -> Case:
    """A filter of `MODEL`, or one with an unknown input."""
    one = make(MODEL, of)
    unknown: dict[str, Any] = {}
    if isinstance(one, AugmentedKalmanFilter):
        unknown = {"unknown_input": [0.1 / of.d], "unknown_input_covariance": 0.3 / of.d**2}
    start = one.init(MEAN / of.x, np.diag(SPREAD / of.x**2), **unknown)
    return Case(one, start, y / of.y, u / of.u, named(of.x, of))


def named(x: Array, of: Units) -> dict[str, Any]:
    """The units of all estimates of filters."""
    return {
        "state": x, "variance": x**2, "covariance": np.outer(x, x), "innovation": of.y,
        "innovation_covariance": np.outer(of.y, of.y), "probability": 1.0,
        "unknown_input": of.d, "unknown_input_variance": of.d**2,
        "unknown_input_covariance": of.d**2, CROSS: x[:, None] * of.d,
    }  # fmt: skip


def model(one: LinearModel, of: Units) -> LinearModel:
    """The same system in other units."""
    x = of.x
    return LinearModel(
        one.A * x / x[:, None], one.B * of.u / x[:, None], one.C * x / of.y[:, None],
        one.D * of.u / of.y[:, None], Q=one.Q / np.outer(x, x), R=one.R / np.outer(of.y, of.y),
        sampling_period=one.sampling_period,
    )  # fmt: skip


def kalman(one: LinearModel, of: Units) -> Any:
    return KalmanFilter(model(one, of))


def svsf(one: LinearModel, of: Units, inverse: str = "weighted") -> Any:
    layer = np.array([0.5, 0.4]) / of.y
    return SmoothVariableStructureFilter(
        model(one, of), boundary_layer=layer, convergence_rate=0.1, inverse=inverse
    )


def augmented(one: LinearModel, of: Units) -> Any:
    G = np.array([[1.0], [0.0], [0.5]]) * of.d / of.x[:, None]
    H = np.array([[0.2], [-0.1]]) * of.d / of.y[:, None]
    return AugmentedKalmanFilter(
        model(one, of), fault_matrix=G, random_walk=0.05 / of.d**2, output_fault_matrix=H
    )


def bank(make: Callable[[LinearModel, Units], Any]) -> Callable[[LinearModel, Units], Any]:
    return lambda one, of: IMM([make(one, of), make(OTHER, of)], STAYS)


def nonlinear(kind: Any, of: Units) -> Case:
    """A filter of a pendulum with friction; units are parameters of its text, compiled once."""
    a, b = x = of.x[:2]
    one = kind(
        NonlinearModel(
            ["0.9*a + 0.1*b*q + 0.2*f*r", "0.8*b - sin(a*p)*s + 0.3*g*t"],
            ["a*v", "(a*p + b*p*q)*w"],
            Q=np.diag([0.2, 0.1] / x**2), R=np.diag(0.1 / of.y**2),
            state_names=["a", "b"], input_names=["f", "g"],
            parameters={
                "p": a, "q": b / a, "r": of.u[0] / a, "s": 0.125 / b, "t": of.u[1] / b,
                "v": a / of.y[0], "w": 1 / of.y[1],
            },
        )
    )  # fmt: skip
    start = one.init(MEAN[:2] / x, np.diag(SPREAD / x**2))
    return Case(one, start, y / of.y, u / of.u, named(x, of))


FILTERS: dict[str, Callable[[Units], Case]] = {
    "Kalman": lambda of: linear(kalman, of),
    "augmented Kalman": lambda of: linear(augmented, of),
    "SVSF": lambda of: linear(svsf, of),
    "SVSF, pseudo-inverse": lambda of: linear(
        lambda one, of: svsf(one, of, "pseudo"), of._replace(x=of.x[[0, 0, 0]])
    ),
    "IMM": lambda of: linear(bank(kalman), of),
    "IMM of SVSFs": lambda of: linear(bank(svsf), of),
    "extended Kalman": lambda of: nonlinear(ExtendedKalmanFilter, of),
    "unscented Kalman": lambda of: nonlinear(UnscentedKalmanFilter, of),
}
SMOOTHED = ("Kalman", "augmented Kalman", "extended Kalman", "unscented Kalman")

known = np.nan_to_num(y)  # for observers that need all measurements


def of_one_signal(one: Any, of: Units) -> Case:
    """An observer of y[0]; its states have that unit, or that unit a second."""
    a = of.y[0]
    name = "derivatives" if isinstance(one, LevantDifferentiator) else "state"
    n = 3 if name == "derivatives" else 2
    given = None if not one.inputs else u[:, 0] / of.u[0]
    return Case(one, one.init(MEAN[:n] / a), 0.1 * known[:, 0] / a, given, {name: a})


def high_gain(of: Units) -> Case:
    """A pendulum."""
    a = float(of.y[0])
    drift = ["0", f"-sin(a*{a!r})/{a!r} - w/10"]
    text = triangular_model(["a", "w"], drift, f"{float(of.u[0]) / a!r}")
    return of_one_signal(HighGainObserver(text, rho=5.0, sampling_period=0.1), of)


def normal_form(of: Units) -> Case:
    """A spring that hardens, in other words Duffing's oscillator."""
    a = float(of.y[0])
    field = ["w", f"-a - {a * a!r}*a**3/4 - w/5"]
    one = normal_form_observer(
        field, ["a"], ["a", "w"], poles=[-1.5, -2], order=4, sampling_period=0.1
    )
    return of_one_signal(one, of)


def extended_state(of: Units) -> Case:
    """A spring with a fault of its force and one of its second sensor."""
    x, force = of.x[:2], np.array([[0.0], [4.0]])
    none, sensor = np.zeros((2, 0)), np.array([[0.0], [1.0]])
    system = AugmentedSystem(
        np.array([[0.0, 1.0], [-4.0, -0.6]]) * x / x[:, None],
        np.array([[0.0, 0.5], [4.0, 0.0]]) * of.u / x[:, None], np.diag(x / of.y), none, none,
        force * of.d / x[:, None], sensor * of.y[1] / of.y[:, None], Az=20.0,
    )  # fmt: skip
    units = np.concatenate([x, of.y, [of.d, of.y[1]]])  # of states, filtered outputs, faults
    L = 0.1 * np.random.default_rng(2).normal(size=(6, 2)) * of.y / units[:, None]
    one = ExtendedStateObserver(system, gains=Gains(L, 0.5 * L), sampling_period=0.02)
    scales = {"state": x, "actuator_fault": of.d, "sensor_fault": of.y[1]}
    return Case(one, one.init(), known / of.y, u / of.u, scales)


def rigid(make: Callable[[RigidBody, float], Any], of: Units) -> Case:
    """An observer of a rigid body; torques, and the inertia with them, have another unit."""
    one = make(RigidBody(INERTIA / of.d), of.d)
    torques = u[:, [0, 1, 0]] / of.d
    return Case(one, one.init(MEAN), 0.1 * known[:, [0, 1, 0]], torques, {"fault": of.d})


OTHERS: dict[str, Callable[[Units], Case]] = {
    "steady Kalman": lambda of: linear(lambda one, of: steady_kalman(model(one, of)), of),
    "Luenberger": lambda of: linear(
        lambda one, of: luenberger(model(one, of), [0.3, 0.4, 0.5]), of._replace(x=of.x[[0, 0, 0]])
    ),
    "extended state": extended_state,
    "high gain": high_gain,
    "normal form": normal_form,
    "differentiator": lambda of: of_one_signal(
        LevantDifferentiator(L=4.0 / of.y[0], order=2, sampling_period=0.1), of
    ),
    "sampled ILO": lambda of: rigid(
        lambda body, d: SampledILO(
            body,
            K1=0.9,
            K2=200 / d,
            observer_gain=500 / d,
            update_interval=0.02,
            sampling_period=0.01,
        ),
        of,
    ),
    "continuous ILO": lambda of: rigid(
        lambda body, d: ILO(
            body,
            K1=0.9,
            K2=50 / d,
            observer_gain=500 / d,
            update_interval=0.03,
            sampling_period=0.01,
        ),
        of,
    ),
    "adaptive": lambda of: rigid(
        lambda body, d: AdaptiveObserver(
            body,
            observer_gain=500 / d,
            integral_gain=1000 / d,
            proportional_gain=10 / d,
            sampling_period=0.01,
        ),
        of,
    ),
}

ONE = Units(np.ones(3), np.ones(2), np.ones(2), 1.0)
UNITS = {
    "small states": ONE._replace(x=np.full(3, 2.0**-10)),
    "large states": ONE._replace(x=np.full(3, 2.0**10)),
    "all": Units(
        2.0 ** np.array([10, -7, 3]), 2.0 ** np.array([-5, 8]), 2.0 ** np.array([7, -9]),
        2.0**-6,
    ),
}  # fmt: skip


def estimates(case: Case, *, smooth: bool = False) -> dict[str, Array]:
    """The estimates, in the units of the record."""
    one, given = case.observer, () if case.u is None else (case.u,)
    keep = {"keep": [CROSS]} if isinstance(one, AugmentedKalmanFilter) else {}
    run = one.run(case.y, *given, start=case.state, **keep)
    found = rts_smoother(run) if smooth else run
    return {name: found[name] * case.scales.get(name, 1.0) for name in found.estimates}


def check(found: Mapping[str, Array], wanted: Mapping[str, Array], of: Units, off: float) -> None:
    """Likelihoods are densities: they are in one unit of each measurement."""
    for name, values in wanted.items():
        other, moved = found[name], 0.0
        if name == "log_likelihood":
            moved = np.where(np.isnan(y), 0.0, np.log(of.y)).sum(axis=1)
            size = 1e-13 * np.abs(values).max()
        else:
            size = off * np.nanmax(np.abs(values))
        np.testing.assert_allclose(other, values + moved, rtol=0, atol=size, err_msg=name)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("kind", FILTERS)
def test_estimates_of_filters_and_smoothers_are_scaled_bitwise(kind: str, units: str) -> None:
    make, of = FILTERS[kind], UNITS[units]
    # A bank weighs by logarithms of densities, which other units of y shift.
    off = 1e-12 if "IMM" in kind and units == "all" else 0.0
    check(estimates(make(of)), estimates(make(ONE)), of, off)
    if kind in SMOOTHED:
        check(estimates(make(of), smooth=True), estimates(make(ONE), smooth=True), of, 0.0)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("kind", OTHERS)
def test_estimates_of_other_observers_are_scaled(kind: str, units: str) -> None:
    make, of = OTHERS[kind], UNITS[units]
    check(estimates(make(of)), estimates(make(ONE)), of, 1e-9)

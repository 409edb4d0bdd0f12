"""Observers, filters and banks: how they are made, started, stepped and run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from reobserve.models.rigid_body import RigidBody
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.delay_adaptive import AdaptiveDelayEstimator
from reobserve.observers.delay_least_squares import LeastSquaresDelayEstimator
from reobserve.observers.delay_variable_structure import RELAYS, VariableStructureDelayEstimator
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger, steady_kalman
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.ilo import ILO
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.imm import IMM
from reobserve.observers.innovation_tests import cusum, inflation_glr
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.linear_filter import Belief
from reobserve.observers.normal_form import normal_form_observer
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_transformed import TransformedObserver
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.plants.first_order_lag import first_order_lag
from reobserve.plants.pendulum import pendulum
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.linear import (
    hidden_modes,
    place,
    steady_kalman_gain,
    undetectable_modes,
)
from reobserve.synthesis.normal_form.design import normal_form

from .models import INERTIA, linear_model, van_der_pol
from .subject import Subject, subject

MISSING = ("not a number",)  # a sample that was not taken
ALONE = ", u alone"  # without its derivatives
HALF = np.linspace(0.0, 0.2, 41)  # two samples a step of 0.01 s


def augmented() -> AugmentedSystem:
    """The motor of the README."""
    return AugmentedSystem(
        A=np.array([[-10.0, 1.0], [-0.02, -2.0]]), B=np.array([[0.0], [2.0]]), C=np.eye(2),
        Dd=np.diag([1.0, 2.0]), Dw=np.array([[1.0], [0.0]]), Fa=np.array([[0.0], [2.0]]),
        Fs=np.array([[1.0], [0.0]]),
    )  # fmt: skip


def gains() -> Gains:
    """Gains that make a PI observer of `augmented` stable: those of a Riccati equation."""
    from scipy.linalg import solve_continuous_are

    system = augmented()
    weight = np.eye(system.size)
    covariance = solve_continuous_are(system.A_tilde.T, system.C_tilde.T, weight, np.eye(2))
    return Gains(covariance @ system.C_tilde.T, np.zeros((system.size, 2)))


def subjects() -> Iterator[Subject]:
    """Calls that must be accepted."""
    yield from _rigid_bodies()
    yield from _delays()
    yield from _high_gains()
    yield from _filters()
    yield from _normal_forms()
    system = augmented()
    yield subject(ExtendedStateObserver, system, 0.01, gains())
    observer = ExtendedStateObserver(system, 0.01, gains())
    state = observer.init(np.zeros(6), np.zeros(2))
    y, u = np.zeros((20, 2)), np.ones((20, 1))
    yield subject(observer.init, np.zeros(6), np.zeros(2), of=observer)
    yield from from_state(observer, state, y, u)


def from_state(
    observer: Any, state: Any, y: Any, u: Any, takes: tuple[str, ...] = ()
) -> Iterator[Subject]:
    """Run an observer of the contract over a record, and step it with the record's first row."""

    def run(y: Any, u: Any, state: Any) -> object:
        return observer.run(y, u, state=state)

    place = subject(observer.run, of=observer).name
    yield Subject(place, run, (y, u, state), takes)
    yield subject(observer.step, state, y[0], u[0], of=observer, takes=takes)


def recorded(
    observer: Any,
    started: tuple[Any, ...],
    y: Any,
    u: Any = None,
    form: str = "",
    between: bool = True,
) -> Iterator[Subject]:
    """Start an observer, run it over a record and step it, with all that it may be told.

    ``form`` says what is different about a record if there is another one; ``between`` whether
    the observer reads anything between the rows.
    """

    def run(y: Any, u: Any, state: Any, *rest: Any) -> object:
        time, before, middle, word = rest
        return observer.run(
            y, u, state=state, time=time, before=before, middle=middle, on_divergence=word
        )

    def step(state: Any, y: Any, u: Any, before: Any, middle: Any) -> object:
        return observer.step(state, y, u, before=before, middle=middle)

    name = subject(observer.init, of=observer).name.removesuffix(".init")
    state, time = observer.init(*started), observer.sampling_period * np.arange(len(y))
    yield Subject(f"{name}.init{form}", observer.init, started)
    pair = (y, u) if between else None
    yield Subject(f"{name}.run{form}", run, (y, u, state, time, pair, pair, "raise"))
    row = y[0], None if u is None else u[0]
    pair = row if between else None
    yield Subject(f"{name}.step{form}", step, (state, *row, pair, pair))


def _rigid_bodies() -> Iterator[Subject]:
    body = RigidBody(INERTIA)
    rate = np.column_stack([0.01 * np.sin(HALF), 0 * HALF, 0 * HALF])
    arguments: dict[Any, tuple[Any, ...]] = {
        SampledILO: (1.0, 500.0, 500.0, 0.01, False),
        ILO: (0.9, 50.0, 500.0, 0.01, False),
        AdaptiveObserver: (500.0, 1000.0, 10.0),
    }
    for kind, parameters in arguments.items():
        yield subject(kind, body, 0.01, *parameters)
        observer = kind(body, 0.01, *parameters)
        yield from recorded(observer, ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), rate, 0 * rate)


def _delays() -> Iterator[Subject]:
    plain = (1.0, 1.0, (0.0, 0.1), 0.01)
    arguments: dict[Any, tuple[Any, ...]] = {
        AdaptiveDelayEstimator: (0.1, 1.0, 1.0),
        LeastSquaresDelayEstimator: (1.0, 0.5),
        VariableStructureDelayEstimator: (0.5, RELAYS[0]),
    }
    past = np.column_stack([np.sin(HALF), np.cos(HALF)])
    for kind, parameters in arguments.items():
        yield subject(kind, *plain, *parameters)
        estimator = kind(*plain, *parameters)
        output = np.tile(np.sin(HALF)[:, None], (1, estimator.measurements))
        yield from recorded(estimator, (0.0, 0.05, past), output, past)
        yield from recorded(estimator, (0.0, 0.05, past[:, 0]), output[:, 0], past[:, 0], ALONE)


def _high_gains() -> Iterator[Subject]:
    model = pendulum(9.81, 0.5, 0.2, 0.3)
    y = 0.1 * np.cos(HALF)
    yield subject(HighGainObserver, model, 0.01, 10.0)
    yield from recorded(HighGainObserver(model, 0.01, 10.0), ([0.1, 0.0],), y, 0 * y)
    arguments = (first_order_lag(), 0.01, 5.0, 1, (0.0, 1.0), 0.0, "delay", np.eye(2))
    yield subject(ExtendedHighGainObserver, *arguments)
    inputs = np.column_stack([np.sin(HALF), np.cos(HALF)])
    for u, form in ((inputs, ""), (inputs[:, 0], ALONE)):
        yield from recorded(ExtendedHighGainObserver(*arguments), ([0.0], 0.5), y, u, form)
    yield subject(LevantDifferentiator, 1.0, 0.01, 2, [3.0, 1.5, 1.0], False)
    yield from recorded(LevantDifferentiator(1.0, 0.01), ([0.0, 0.0, 0.0],), y, between=False)


def _filters() -> Iterator[Subject]:
    model = linear_model()
    kalman = KalmanFilter(model)
    smooth = SmoothVariableStructureFilter(model, [0.5], 0.1)
    yield subject(KalmanFilter, model)
    yield subject(SmoothVariableStructureFilter, model, [0.5], 0.1)
    measured, controls = np.sin(HALF)[:, None], np.ones((len(HALF), 1))
    observers = (
        kalman,
        smooth,
        luenberger(model, [0.5, 0.6]),
        AugmentedKalmanFilter(model, [[0.0], [0.01]], 1e-4),
    )
    for one in observers:
        yield subject(one.init, [0.0, 0.0], np.eye(2), of=one)
        yield from from_state(one, one.init([0.0, 0.0], 1e-2), measured, controls, MISSING)
    yield subject(cusum, measured[:, 0], 0.5, takes=MISSING)
    yield subject(inflation_glr, measured[:, 0] ** 2, 1, [1, 2, 4], takes=MISSING)
    yield subject(FixedGainObserver, model, [[0.5], [0.1]])
    yield subject(luenberger, model, [0.5, 0.6], takes=("complex",))
    yield subject(steady_kalman, model)
    yield subject(AugmentedKalmanFilter, model, [[0.0], [0.01]], 1e-4, [[0.0]])
    yield subject(steady_kalman_gain, model)
    yield subject(hidden_modes, model.A, model.H)
    yield subject(undetectable_modes, model.A, model.H)
    yield subject(place, model.A, model.H, [0.5, 0.6], takes=("complex",))
    for filters in (kalman, smooth):
        belief = filters.init([0.0, 0.0], 1e-2).belief
        yield subject(filters.predict, belief, [1.0], of=filters)
        yield subject(filters.correct, belief, [0.1], [1.0], of=filters, takes=MISSING)

    def predicted(mean: Any, covariance: Any, error: Any) -> object:
        return kalman.predict(Belief(mean, covariance, error), [1.0])

    name = "observers.linear_filter.Belief"  # a value: what takes it looks at it
    yield Subject(name, predicted, (np.zeros(2), np.eye(2), np.zeros(1)))
    stays = [[0.9, 0.1], [0.1, 0.9]]
    yield subject(IMM, [kalman, kalman], stays, True)
    bank = IMM([kalman, smooth], stays)
    state = bank.init([0.0, 0.0], 1e-2)
    yield subject(bank.init, [0.0, 0.0], 1e-2, [0.5, 0.5], of=bank)
    yield from from_state(bank, state, measured, controls, MISSING)


def _normal_forms() -> Iterator[Subject]:
    series = normal_form(van_der_pol(), 3, poles=[-1.7, -2.3])
    y = 0.1 * np.sin(HALF)[:, None]

    def placed(system: Any, degree: Any, poles: Any) -> object:
        return normal_form(system, degree, poles=poles)

    def observer(order: Any, step: Any, poles: Any, form: Any, gain: Any, degree: Any) -> object:
        return normal_form_observer(
            ["-w", "a - (1 - a**2)*w"], ["a"], ["a", "w"], order=order, sampling_period=step,
            poles=poles, form=form, gain=gain, degree=degree, expanded=3,
        )  # fmt: skip

    def injected(injection: Any, variables: Any) -> object:
        return normal_form_observer(
            ["-w", "a - (1 - a**2)*w"], ["a"], variables, order=1, sampling_period=0.01,
            injection=injection,
        )  # fmt: skip

    def driven(inputs: Any, higher: Any, degree: Any) -> object:
        return normal_form_observer(
            ["w", "-sin(a) - w/10 + u"], ["a"], ["a", "w"], order=1, sampling_period=0.01,
            poles=[-1.5, -2.2], inputs=inputs, higher=higher, degree=degree,
        )  # fmt: skip

    name = "observers.normal_form.normal_form_observer"
    yield Subject(f"{name}, driven", driven, (["u"], ["0", "sin(y1) - y1"], 3))
    yield Subject(
        "synthesis.normal_form.design.normal_form", placed, (van_der_pol(), 3, [-1.7, -2.3])
    )
    yield Subject(name, observer, (2, 0.01, [-1.7, -2.3], "identity", "series", 4), ("complex",))
    yield Subject(f"{name}, injected", injected, ([[-3.0], [-1.7]], ["a", "w"]))
    yield subject(IdentityObserver, series, 0.01, 2, "series")
    yield subject(TransformedObserver, series, 0.01, 2)
    for one in (IdentityObserver(series, 0.01, 2), TransformedObserver(series, 0.01, 2)):
        yield from recorded(one, ([0.1, 0.0],), y)

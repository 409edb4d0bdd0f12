"""Valid calls of observers that no example of a docstring has, or with more arguments."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.gaussian_state import Gaussian
from reobserve.observers.grid_filter import GridFilter
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.normal_form import normal_form_observer
from reobserve.observers.simulation import simulate
from reobserve.observers.smoother import rts_smoother
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.linear_gain import steady_kalman_gain
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.systems.linear import LinearModel
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.polynomial import PolynomialSystem
from reobserve.systems.rigid_body import RigidBody
from tests.reobserve.observers.cases import stated
from tests.reobserve.observers.small_plants import first_order_lag, pendulum

from .call import COMPLEX, MISSING, Call, called, method
from .models import HALF, INERTIA, VAN_DER_POL, augmented, gains, linear_model, swing, van_der_pol


def calls() -> Iterator[Call]:
    """All of them."""
    for part in (_observers, _filters, _nonlinear_filters, _normal_forms, *stated("calls")):
        yield from part()


def _recorded(
    observer: Any, start: tuple[Any, ...], y: Any, u: Any = None, form: str = ""
) -> Iterator[Call]:
    """Start an observer, run it over a record and step it, with all optional arguments.

    ``form`` states how the record differs for observers that accept several kinds.
    """

    def run(
        y: Any, u: Any, start: Any, time: Any, before: Any, middle: Any, on_divergence: Any
    ) -> object:
        options = {"time": time, "before": before, "middle": middle}
        return observer.run(y, u, start=start, on_divergence=on_divergence, **options)

    def step(start: Any, y: Any, u: Any, before: Any, middle: Any) -> object:
        return observer.step(start, y, u, before=before, middle=middle)

    def run_of_rows(y: Any, u: Any, start: Any, time: Any, on_divergence: Any) -> object:
        return observer.run(y, u, start=start, time=time, on_divergence=on_divergence)

    first: Any = method(observer, "init", *start)
    begun, time = first.function(*start), observer.sampling_period * np.arange(len(y))
    name = first.name.removesuffix("init")
    yield Call(f"{first.name}{form}", first.function, start)
    row = y[0], None if u is None else u[0]
    if isinstance(observer, IntegratingObserver):
        yield Call(f"{name}run{form}", run, (y, u, begun, time, (y, u), (y, u), "raise"))
        yield Call(f"{name}step{form}", step, (begun, *row, row, row))
    else:
        yield Call(f"{name}run{form}", run_of_rows, (y, u, begun, time, "raise"))
        yield method(observer, "step", begun, *row)


def _from_state(
    observer: Any, start: Any, y: Any, u: Any, takes: tuple[str, ...] = ()
) -> Iterator[Call]:
    """Run an observer over a record and step it with the first row."""

    def run(y: Any, u: Any, start: Any) -> object:
        return observer.run(y, u, start=start)

    yield Call(method(observer, "run").name, run, (y, u, start), takes)
    yield method(observer, "step", start, y[0], u[0], takes=takes)


def _observers() -> Iterator[Call]:
    body, swing = RigidBody(INERTIA), pendulum()
    rates = np.column_stack([0.01 * np.sin(HALF), 0 * HALF, 0 * HALF])
    inputs = np.column_stack([np.sin(HALF), np.cos(HALF)])  # with their derivatives
    cosine = 0.1 * np.cos(HALF)
    lag = (first_order_lag(), 5.0, 1, (0.0, 1.0), 0.0, "delay", np.eye(2), 0.01)
    made: dict[str, tuple[Any, ...]] = {
        "ilo.SampledILO": (body, 1.0, 500.0, 500.0, 0.01, False, 0.01),
        "ilo.ILO": (body, 0.9, 50.0, 500.0, 0.01, False, 0.01),
        "adaptive.AdaptiveObserver": (body, 500.0, 1000.0, 10.0, 0.01),
        "high_gain.HighGainObserver": (swing, 10.0, 0.01),
        "extended_high_gain.ExtendedHighGainObserver": lag,
        "extended_state.ExtendedStateObserver": (augmented(), gains(), 0.01),
    }
    for name, arguments in made.items():
        (call,) = called({f"observers.{name}": arguments})
        yield call
        observer: Any = call.function(*arguments)
        if "model" in vars(observer) and arguments[0] is body:
            yield from _recorded(observer, ([0.0] * 3, [0.0] * 3), rates, 0 * rates)
        elif name.startswith("high"):
            yield from _recorded(observer, ([0.1, 0.0],), cosine, 0 * cosine)
        elif name.startswith("extended_high"):
            yield from _recorded(observer, ([0.0], 0.5), cosine, inputs)
            yield from _recorded(observer, ([0.0], 0.5), cosine, inputs[:, 0], ", u alone")
        else:
            yield method(observer, "init", np.zeros(6), np.zeros(2))
            state = observer.init(np.zeros(6), filtered=np.zeros(2))
            yield from _from_state(observer, state, np.zeros((20, 2)), np.ones((20, 1)))


def _filters() -> Iterator[Call]:
    model = linear_model()
    kalman = KalmanFilter(model)

    def predicted(mean: Any, covariance: Any, error: Any) -> object:
        return kalman.predict(Gaussian(mean, covariance, error), [1.0])

    name = "observers.gaussian_state.Gaussian"  # checked on use
    yield Call(name, predicted, (np.zeros(2), np.eye(2), np.zeros(1)))
    yield from _banks(model)
    yield from called({
        "synthesis.linear_gain.kalman_gain_error": (model, steady_kalman_gain(model)),
        "synthesis.linear_gain.unobservable_modes": (model.A, model.C),
        "synthesis.linear_gain.undetectable_modes": (model.A, model.C),
    })  # fmt: skip


def _banks(model: Any) -> Iterator[Call]:
    grid = GridFilter.of_delay(model, delays=[0.0, 1.0, 3.0], rates=[-0.1, 0.1], switch_rate=0.2)

    def of_parameter(
        grid: Any, random_walk: Any, jump_rate: Any, rates: Any, switch_rate: Any
    ) -> object:
        return GridFilter.of_parameter(
            lambda a: LinearModel([[a]], C=[[1]], Q=1e-2, R=0.1), grid=grid,
            random_walk=random_walk, jump_rate=jump_rate,
            rates=rates, switch_rate=switch_rate,
        )  # fmt: skip

    name = "observers.grid_filter.GridFilter"
    yield Call(f"{name}.of_parameter", of_parameter, ([0.2, 0.5], 0.1, 0.1, [0.0, 0.1], 0.1))

    def constructed(transition: Any, grid: Any) -> object:
        return GridFilter(filters, transition, grid=grid)

    filters = grid.filters
    yield Call(name, constructed, (grid.transition, [0.0, 0.0, 0.1, 0.1, 0.2, 0.2]))


def _nonlinear_filters() -> Iterator[Call]:
    def made_of(
        f: Any, h: Any, Q: Any, R: Any, F: Any, H: Any, state_names: Any, input_names: Any,
        output_names: Any, parameters: Any, scale: Any, sampling_period: Any, substeps: Any,
    ) -> NonlinearModel:  # fmt: skip
        return NonlinearModel(
            f, h, Q, R, F=F, H=H, state_names=state_names, input_names=input_names,
            output_names=output_names, parameters=parameters, scale=scale,
            sampling_period=sampling_period, substeps=substeps,
        )  # fmt: skip

    texts = ["w", "u - g*a"], ["a"], [1e-4, 1e-4], 1e-2, [["0", "1"], ["-g", "0"]], [["1", "0"]]
    names = ["a", "w"], ["u"], ["angle"], {"g": 9.81}
    yield Call("systems.nonlinear.NonlinearModel", made_of, (*texts, *names, [1.0, 2.0], 0.01, 2))

    def sized(f: Any, h: Any, states: Any, inputs: Any, outputs: Any) -> object:
        return NonlinearModel(f, h, 1e-4, 1e-2, states=states, inputs=inputs, outputs=outputs)

    name = "systems.nonlinear.NonlinearModel, functions"
    yield Call(name, sized, (lambda x, u: x, lambda x: x[:1], 2, 1, 1))

    def integrated(f: Any, h: Any, Q: Any, R: Any, sampling_period: Any, substeps: Any) -> object:
        return NonlinearModel.from_ode(
            f,
            h,
            Q=Q,
            R=R,
            sampling_period=sampling_period,
            substeps=substeps,
            state_names=["a", "w"],
        )

    name = "systems.nonlinear.NonlinearModel.from_ode"
    yield Call(name, integrated, (["w", "-a"], "a", 1e-4, 1e-2, 0.01, 2))

    def integrated_functions(f: Any, h: Any, states: Any, inputs: Any, outputs: Any) -> object:
        sizes = {"states": states, "inputs": inputs, "outputs": outputs}
        return NonlinearModel.from_ode(f, h, Q=1e-4, R=1e-2, sampling_period=0.01, **sizes)

    name = "systems.nonlinear.NonlinearModel.from_ode, functions"
    yield Call(name, integrated_functions, (lambda x, u: -x, lambda x: x[:1], 2, 1, 1))

    model = swing()

    def with_states(random_walk: Any) -> object:
        return made_of(*texts, *names, 1.0, 0.01, 2).with_parameter_states({"g": random_walk})

    yield Call("systems.nonlinear.NonlinearModel.with_parameter_states", with_states, (1e-6,))
    y, u = np.sin(HALF)[:20, None], np.ones((20, 1))
    made: dict[str, tuple[Any, ...]] = {
        "observers.nonlinear_filter.ExtendedKalmanFilter": (model,),
        "observers.nonlinear_filter.UnscentedKalmanFilter": (model, 0.5, 2.0, 1.0),
    }
    for call in called(made):
        yield call
        observer: Any = call.function(*call.arguments)
        start = observer.init([0.0, 0.0], 1e-2)
        yield method(observer, "init", [0.0, 0.0], np.eye(2))

        def run(y: Any, u: Any, start: Any, Q: Any, R: Any, observer: Any = observer) -> object:
            return observer.run(y, u, start=start, Q=Q, R=R)

        def step(start: Any, y: Any, u: Any, Q: Any, R: Any, observer: Any = observer) -> object:
            return observer.step(start, y, u, Q=Q, R=R)

        noise = np.tile(1e-3 * np.eye(2), (20, 1, 1)), np.full((20, 1, 1), 0.1)
        yield Call(method(observer, "run").name, run, (y, u, start, *noise), MISSING)
        row = start, y[0], u[0], noise[0][0], noise[1][0]
        yield Call(method(observer, "step").name, step, row, MISSING)
        yield method(observer, "predict", start.posterior, [1.0])
        yield method(observer, "correct", start.posterior, [0.1], [1.0], takes=MISSING)

        def smooth(u: Any, Q: Any, observer: Any = observer, start: Any = start) -> object:
            return rts_smoother(observer.run(y, u, start=start, Q=Q))

        def drawn(
            rows: Any, mean: Any, covariance: Any, u: Any, seed: Any, missing: Any, records: Any,
            observer: Any = observer,
        ) -> object:  # fmt: skip
            return simulate(
                observer.model, rows, mean, covariance, u, seed=seed, missing=missing,
                records=records,
            )  # fmt: skip

        kind = type(observer).__name__
        yield Call(f"observers.smoother.rts_smoother, {kind}", smooth, (u, noise[0]))
        sizes = 20, np.zeros(2), 0.1 * np.eye(2), u, 1, 0.1, 2
        yield Call(f"observers.simulation.simulate, {kind}", drawn, sizes)


def _normal_forms() -> Iterator[Call]:
    system = van_der_pol()
    series = normal_form(system, 3, poles=[-1.7, -2.3])
    y = 0.1 * np.sin(HALF)[:, None]

    def placed(system: Any, degree: Any, poles: Any) -> object:
        return normal_form(system, degree, poles=poles)

    def observer(order: Any, step: Any, poles: Any, form: Any, gain: Any, degree: Any) -> object:
        return normal_form_observer(
            VAN_DER_POL, ["a"], ["a", "w"], order=order, sampling_period=step,
            poles=poles, form=form, gain=gain, degree=degree, expanded=3,
        )  # fmt: skip

    def injected(injection: Any, variables: Any) -> object:
        return normal_form_observer(
            VAN_DER_POL, ["a"], variables, order=1, sampling_period=0.01, injection=injection
        )

    def driven(inputs: Any, higher: Any, degree: Any) -> object:
        return normal_form_observer(
            ["w", "-sin(a) - w/10 + u"], ["a"], ["a", "w"], order=1, sampling_period=0.01,
            poles=[-1.5, -2.2], inputs=inputs, higher=higher, degree=degree,
        )  # fmt: skip

    name = "observers.normal_form.normal_form_observer"
    yield Call(name, observer, (2, 0.01, [-1.7, -2.3], "identity", "series", 4), COMPLEX)
    yield Call(f"{name}, driven", driven, (["u"], ["0", "sin(y1) - y1"], 3))
    yield Call(f"{name}, injected", injected, ([[-3.0], [-1.7]], ["a", "w"]))
    yield Call("synthesis.normal_form.transform.normal_form", placed, (system, 3, [-1.7, -2.3]))
    poles = (system, [-1.7, -2.3])
    yield from called({"synthesis.normal_form.placement.injection_for": poles}, COMPLEX)
    for call in called({
        "observers.normal_form.IdentityObserver": (series, 2, "series", 0.01),
        "observers.normal_form.TransformedObserver": (series, 2, 0.01),
    }):  # fmt: skip
        yield call
        yield from _recorded(call.function(*call.arguments), ([0.1, 0.0],), y)
    # Its series converge up to 1.
    known = PolynomialSystem.from_expressions(["x + x**2"], ["x"], ["x"], 2)
    S = normal_form(known, 13, poles=[-0.5]).S
    linear = PolynomialMap.linear(np.array([[-2.0], [-1.0]]))
    yield from called({
        "synthesis.normal_form.problem.NormalFormProblem": (system, linear, 3),
        "synthesis.normal_form.convergence.convergence": (S,),
        "synthesis.normal_form.convergence.part_norms": (S,),
    })  # fmt: skip

"""Observers of every exported kind, with initial states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.documents import parse_yaml
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.examples import model_text
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fault_bank import FaultBank
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger
from reobserve.observers.grid_filter import GridFilter
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter, UnscentedKalmanFilter
from reobserve.observers.normal_form import normal_form_observer
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.rigid_body import RigidBody
from reobserve.systems.triangular_text import triangular_model
from tests.reobserve.estimation.by_hand import eso

Array = NDArray[np.float64]
Made = tuple[Any, Any]  # an observer, and a state or None

BODY = RigidBody([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26]], fault_matrix=[1, 0.5, 1])


def model(factor: float = 1.0) -> LinearModel:
    """Three states, two outputs with correlated noise, one of them with feedthrough."""
    A = factor * np.array([[0.9, 0.1, 0], [0, 0.8, 0.1], [0.05, 0, 0.7]])
    return LinearModel(
        A, [[0], [1], [0.5]], [[1, 0, 0], [0, 1, 0]], Q=[0.1, 0.2, 0.3], R=[[1, 0.2], [0.2, 2]],
        D=[[0.1 * factor], [0]],
    )  # fmt: skip


def angles(factor: float = 1.0) -> LinearModel:
    """The same with a state and outputs that are angles, of short periods."""
    whole = model(factor)
    A = whole.A.copy()
    A[:, 0] = [1.0, 0.0, 0.0]  # by which an angle is the same after a period
    return LinearModel(
        A, whole.B, whole.C, whole.D, Q=whole.Q, R=model().R, state_periods=[3.0, None, None],
        output_periods=[3.0, 5.0],
    )  # fmt: skip


def force(**options: Any) -> AugmentedKalmanFilter:
    """One unknown force."""
    push = [[0.0], [1.0], [0.0]]
    return AugmentedKalmanFilter(model(), fault_matrix=push, random_walk=0.01, **options)


def learning(kind: Any, K2: float, interval: float = 0.03) -> Any:
    """An iterative learning observer."""
    return kind(
        BODY, K1=0.9, K2=K2, observer_gain=500.0, update_interval=interval, sampling_period=0.01
    )


def differentiator() -> LevantDifferentiator:
    """A differentiator of order 3."""
    return LevantDifferentiator(L=1.0, order=3, sampling_period=0.01)


def faults() -> Made:
    """Two faults, in the middle of a record."""
    made = FaultBank(
        model(), fault_matrix=[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]], drift=0.1, jump=[2.0, 1.0],
        jump_rate=0.1, jump_time=2.0,
        output_fault_matrix=[[0.0, 0.0], [0.0, 1.0]], gate=3.0, noise_memory=50.0,
    )  # fmt: skip
    y, u = 0.2 * np.sin(np.arange(16.0)).reshape(8, 2), np.ones((8, 1))
    return made, made.run(y, u, start=made.init([0, 0, 0], 1.0)).end


def delays(walk: float) -> Made:
    """Delays between samples, at the beginning or in the middle of a record."""
    plant = LinearModel.from_ode(
        [[0, 1], [-1, -0.5]], [[0, 1], [1, 0]], [[1, 0]], Q=[1e-4, 1e-3], R=1e-2,
        sampling_period=0.1,
    )  # fmt: skip
    made = GridFilter.of_delay(
        plant, delays=[0.0, 0.13, 0.2, 0.47], random_walk=walk, jump_rate=0.1, noise_memory=3.0
    )
    state = made.init([0.1, 0.2], 0.1)
    if not walk:
        return made, state
    u = np.sin(np.arange(16.0)).reshape(8, 2)
    return made, made.run(u[:, 0], u, start=state).end


def parameter() -> Made:
    made = GridFilter.of_parameter(
        lambda a: LinearModel([[a]], [[1.0]], [[1.0]], Q=1e-2, R=0.1), grid=[0.2, 0.5, 0.9],
        random_walk=0.1, jump_rate=0.01,
        rates=[-0.1, 0.1], switch_rate=0.5,
    )  # fmt: skip
    return made, made.init([0.5], 1.0)


def free() -> LinearModel:
    """The same model without an input."""
    whole = model()
    return LinearModel(whole.A, np.zeros((3, 0)), whole.C, Q=whole.Q, R=whole.R)


def large() -> KalmanFilter:
    """A filter of so many states that the library has loops of their own for it."""
    A = 0.9 * np.roll(np.eye(14), 1, axis=0) + 0.02
    return KalmanFilter(LinearModel(A, C=np.eye(2, 14), Q=0.1 * np.eye(14), R=[1.0, 2.0]))


def filtering(made: Any) -> Made:
    return made, made.init([1.0, 2.0, 3.0], [1.0, 2.0, 1.0])


def bank(*filters: Any, mixing: bool = True, **chosen: Any) -> Made:
    chain = [[0.95, 0.05, 0.0], [0.05, 0.9, 0.05], [0.0, 0.1, 0.9]]
    made = IMM(filters, chain, mixing=mixing, **chosen)
    return made, made.init([1.0, 2.0, 3.0], [1.0, 2.0, 1.0], probabilities=[1.0, 0.0, 0.0])


def swing(kind: Any, **chosen: Any) -> Made:
    """Two outputs with correlated noise, one of which the input enters; powers and parameters."""
    model = NonlinearModel(
        ["a + w/20", "w - sin(a)/20 - friction*w**3 + u/(2 + a^4)"],
        ["a*w + exp(-a) + u**2", "erf(w)*pi - (1 + w**2)**-2.5*tan(a/3)"],
        Q=[[1e-4, 1e-5], [1e-5, 1e-3]], R=[[1e-3, 2e-4], [2e-4, 1e-2]], state_names=["a", "w"],
        input_names=["u"], parameters={"friction": 0.01}, sampling_period=0.05,
        **({"state_periods": [1, None], "output_periods": [2, 3]} if "gate" in chosen else {}),
    )  # fmt: skip
    made = kind(model, **chosen)
    return made, made.init([0.5, 1.0], [0.01, 0.1])


def turning(kind: Any, **chosen: Any) -> Made:
    """A differential equation without input, in three substeps, in the middle of a record."""
    model = NonlinearModel.from_ode(
        ["w", "(1 - a**2)*w - a", "-b*a^5"], "a + b", Q=[1e-5, 1e-4, 1e-5], R=1e-2,
        state_names=["a", "w", "b"], sampling_period=0.1, substeps=3,
    )  # fmt: skip
    made = kind(model, **chosen)
    y = np.array([0.3, np.nan, 0.28, 0.31])
    return made, made.run(y, start=made.init([0.2, 0.1, 0.1], 0.1)).end


def switching(inverse: str, factor: float = 1.0) -> SmoothVariableStructureFilter:
    return SmoothVariableStructureFilter(
        model(factor), boundary_layer=[0.5, 1.5], convergence_rate=0.2, inverse=inverse
    )


def started(made: Any, *values: float) -> Made:
    return made, made.init(values)


def gone_on(made: Any) -> Made:
    """A state in the middle of a record."""
    y = 0.2 * np.sin(np.arange(24.0)).reshape(8, 3)
    return made, made.run(y, 3 * y).end


def pendulum(**chosen: Any) -> Any:
    return normal_form_observer(
        ["w", "-sin(a) - w/10"], ["a"], ["a", "w"], poles=[-1.5, -2], sampling_period=0.01,
        **chosen,
    )  # fmt: skip


def high_gain() -> Made:
    """All functions allowed in text, in the middle of a record."""
    drift = ["cosh(a)/7 - a**3", "sqrt(1 + w^2)*tan(a/3) - pi*w", "erf(s)**5 - 2*s - (w^2 + 3)^-1"]
    model = triangular_model(["a", "w", "s"], drift, "2**(1/2) - exp(-a)/10")
    made = HighGainObserver(model, rho=6.0, sampling_period=0.01)
    y, u = (0.1 + 0.05 * np.sin(k * np.arange(8.0))[:, None] for k in (1.0, 2.0))
    return made, made.run(y, u, start=made.init([0.1, 0.2, 0.0])).end


def adaptive() -> AdaptiveObserver:
    return AdaptiveObserver(
        BODY,
        observer_gain=500.0,
        integral_gain=1000.0,
        proportional_gain=10.0,
        sampling_period=0.01,
    )


def extended_state() -> Made:
    """In the middle of a record."""
    made = eso()
    y, u = 0.2 * np.sin(np.arange(1.0, 17.0)).reshape(8, 2), np.ones((8, 1))
    return made, made.run(y, u).end


def extended(*, begun: bool = False, **chosen: Any) -> Made:
    """Delays that reach both bounds, with an input that is unobservable at its turning points."""
    model = triangular_model(["a", "w"], ["-a", "-sin(a) - w^3"], "2 - a^2")
    parts = {"order": 2, "delay_bounds": (0.05, 0.4), "threshold": 0.4, **chosen}
    made = ExtendedHighGainObserver(model, rho=12.0, **parts, sampling_period=0.01)
    state = made.init([0.3, 0.0], delay=0.2)
    if begun:
        y, u = (0.1 * np.sin(k * np.arange(8.0))[:, None] for k in (0.1, 0.2))
        state = made.run(y, u, start=state).end
    return made, state


def alone() -> Made:
    """An input without its derivatives, from the third row of a record, where few are known."""
    model = triangular_model(["a"], ["-a"], "1")
    made = ExtendedHighGainObserver(
        model, rho=5.0, order=3, delay_bounds=(0.0, 0.5), threshold=0.05, sampling_period=0.05
    )
    y, u = (0.1 * np.sin(rate * np.arange(-3.0, 0.0))[:, None] for rate in (0.21, 0.13))
    return made, made.run(y, u, start=made.init([0.0], delay=0.2)).end


FACTORS = (1.0, 0.8, 0.5)
CASES: dict[str, Callable[[], Made]] = {
    "gain": lambda: filtering(luenberger(model(), [0.3, 0.4, 0.5])),
    "gain_free": lambda: filtering(luenberger(free(), [0.3, 0.4, 0.5])),
    "kalman": lambda: filtering(KalmanFilter(model())),
    "kalman_before": lambda: (
        KalmanFilter(model()), KalmanFilter(model()).init([1, 2, 3], 1.0, u=[0.5]),
    ),
    "kalman_large": lambda: (large(), large().init(np.ones(14), 1.0)),
    "imm_large": lambda: ((made := IMM([large()] * 2, np.full((2, 2), 0.5))), made.init(
        np.ones(14), 1.0)),
    "gain_gate": lambda: filtering(
        FixedGainObserver(model(), gain=[[0.5, 0.0], [0.0, 0.7], [0.0, 1.1]], gate=1.2)
    ),
    "augmented": lambda: (
        (made := force()),
        made.init([1.0, 2.0, 3.0], 1.0),
    ),
    "ekf": lambda: swing(ExtendedKalmanFilter),
    "ekf_turning": lambda: turning(ExtendedKalmanFilter),
    "ukf": lambda: swing(UnscentedKalmanFilter, alpha=0.5, beta=1.0, kappa=1.0),
    "ukf_turning": lambda: turning(UnscentedKalmanFilter),
    "kalman_angles": lambda: filtering(KalmanFilter(angles(), gate=1.2, noise_memory=5.0)),
    "kalman_inflated": lambda: filtering(KalmanFilter(angles(), gate=1.2, outliers="inflate",
                                                      noise_memory=5.0)),
    "augmented_learning": lambda: (
        (made := force(gate=1.5, noise_memory=30.0)),
        made.init([1.0, 2.0, 3.0], 1.0),
    ),
    "gain_angles": lambda: filtering(luenberger(angles(), [0.3, 0.4, 0.5])),
    "ekf_angles": lambda: swing(ExtendedKalmanFilter, gate=1.0, noise_memory=0.5),
    "ukf_angles": lambda: swing(UnscentedKalmanFilter, alpha=0.5, gate=1.0, outliers="inflate",
                                noise_memory=0.5),
    "imm_angles": lambda: bank(*(KalmanFilter(angles(f)) for f in FACTORS), gate=1.2,
                               noise_memory=5.0),
    "imm_svsf_gate": lambda: bank(*(switching("pseudo", f) for f in FACTORS), gate=1.0),
    "fault_bank": faults,
    "delay_grid": lambda: delays(0.0),
    "delay_grid_on": lambda: delays(0.3),
    "parameter_grid": parameter,
    "svsf": lambda: filtering(switching("pseudo")),
    "svsf_weighted": lambda: filtering(switching("weighted")),
    "imm": lambda: bank(*(KalmanFilter(model(f)) for f in FACTORS)),
    "imm_apart": lambda: bank(*(KalmanFilter(model(f)) for f in FACTORS), mixing=False),
    "imm_svsf": lambda: bank(*(switching("weighted", f) for f in FACTORS)),
    "sampled": lambda: (learning(SampledILO, 200.0), None),
    "sampled_on": lambda: gone_on(learning(SampledILO, 200.0)),
    "continuous": lambda: (learning(ILO, 50.0), None),
    "continuous_on": lambda: gone_on(learning(ILO, 50.0)),
    "continuous_long": lambda: (learning(ILO, 50.0, 0.3), None),
    "adaptive": lambda: (adaptive(), None),
    "adaptive_on": lambda: gone_on(adaptive()),
    "extended_state_on": extended_state,
    "levant": lambda: (differentiator(), None),
    "levant_on": lambda: started(differentiator(), 0.2, 1, 2, 3),
    "high_gain": high_gain,
    "extended": extended,
    "extended_all": lambda: extended(switched="all", begun=True),
    "extended_unswitched": lambda: extended(order=1, threshold=0.0),
    "extended_alone": alone,
    "identity": lambda: (pendulum(order=4), None),
    "identity_on": lambda: started(pendulum(order=4), 0.2, -0.3),
    "composed": lambda: (pendulum(order=3, gain="composed"), None),
    "jacobian": lambda: started(pendulum(order=3, gain="jacobian"), 0.2, -0.3),
    "constant": lambda: (pendulum(order=0), None),
    "transformed": lambda: (pendulum(order=4, form="transformed"), None),
    "transformed_on": lambda: started(pendulum(order=4, form="transformed"), 0.2, -0.3),
}  # fmt: skip


def designed(kind: str) -> Any:
    """The certified design of the example of a kind."""
    made: Any = family(kind)
    found = made.designed(parse_yaml(model_text(kind), "model.yaml"))
    return found, found.start()


def observer_of(name: str) -> Made:
    """One of `CASES`, or the example of a design kind."""
    if name in CASES:
        return CASES[name]()
    design, state = designed(name.removeprefix("example-"))
    return design.observer, state


def columns_of(name: str, observer: Any) -> tuple[int, int]:
    """The number of columns that it reads."""
    if name.startswith("example-"):
        design, _ = designed(name.removeprefix("example-"))
        return len(design.measurements), len(design.inputs)
    return (1, 1) if "alone" in name else (observer.measurements, observer.inputs)


NAMES = (*CASES, *(f"example-{kind}" for kind in FAMILIES))

"""The three observers: stepping, limits of stability, accuracy, divergence, and bad input."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver, RigidBodyState, whole_steps
from reobserve.observers.run import Run
from reobserve.synthesis.ilo_accuracy import (
    error_transfer,
    matched_integrator,
    pi_error_transfer,
    predicted_rms_error,
)
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain
from reobserve.systems.rigid_body import RigidBody
from tests.reobserve.observers.small_plants import trajectory
from tests.reobserve.observers.test_rigid_body_order import INERTIA, euler
from tests.reobserve.systems.test_rigid_body import SHAPE

Array = NDArray[np.float64]

BODY = RigidBody(INERTIA)
SKEWED = RigidBody(
    INERTIA,
    np.array([[1.0, 0.1, 0.0], [0.0, 0.9, -0.2], [0.05, 0.0, 1.1]]),
    np.array([[0.9, 0.2, 0.0], [-0.1, 1.1, 0.1], [0.0, 0.15, 0.8]]),
)
FULL_K1 = np.array([[0.9, 0.05, 0.0], [-0.04, 0.85, 0.06], [0.02, 0.0, 0.8]])
TURNING_K1 = np.array([[0.6, -0.5, 0.0], [0.5, 0.6, 0.0], [0.0, 0.0, 0.7]])
FULL_K2 = np.array([[200.0, 20.0, -10.0], [15.0, 160.0, 12.0], [0.0, -25.0, 220.0]])
FULL_OBSERVER_GAIN = np.array([[50.0, 8.0, -3.0], [8.0, 40.0, 5.0], [-3.0, 5.0, 60.0]])
FULL_INTEGRAL = np.array([[900.0, 60.0, 0.0], [60.0, 700.0, -40.0], [0.0, -40.0, 800.0]])

DELAY = 7  # steps in an interval
OBSERVERS: dict[str, RigidBodyObserver] = {
    "continuous": ILO(
        SKEWED,
        K1=FULL_K1,
        K2=FULL_K2,
        observer_gain=FULL_OBSERVER_GAIN,
        update_interval=DELAY * 0.01,
        sampling_period=0.01,
    ),
    "sampled": SampledILO(
        SKEWED,
        K1=FULL_K1,
        K2=FULL_K2,
        observer_gain=FULL_OBSERVER_GAIN,
        update_interval=DELAY * 0.01,
        sampling_period=0.01,
    ),
    "adaptive": AdaptiveObserver(
        SKEWED,
        observer_gain=FULL_OBSERVER_GAIN,
        integral_gain=FULL_INTEGRAL,
        proportional_gain=0.1 * FULL_K2,
        sampling_period=0.01,
    ),
}
each_observer = pytest.mark.parametrize("observer", OBSERVERS.values(), ids=OBSERVERS)


# --- One step at a time -------------------------------------------------------------------------

# --- Limit of stability of the sampled observer -------------------------------------------------

EYE = np.eye(3)
DESIGNS = [
    # tau, Lambda, K1, direction of K2
    (0.1, 1.0, 1.0, EYE),
    (0.01, 1.0, 1.0, EYE),
    (0.001, 1.0, 1.0, EYE),
    (0.01, 100.0, 0.9, EYE),
    (0.1, 1000.0, 0.9, EYE),
    (0.05, FULL_OBSERVER_GAIN, FULL_K1, FULL_K2),
    (0.1, 20 * FULL_OBSERVER_GAIN, FULL_K1, FULL_K2),
    (0.02, FULL_OBSERVER_GAIN, 1.0, FULL_K2),
    (0.05, FULL_OBSERVER_GAIN, TURNING_K1, FULL_K2),
    (0.2, 10 * FULL_OBSERVER_GAIN, -0.5, np.diag([1.0, 2.0, 3.0])),
    (0.03, 5 * FULL_OBSERVER_GAIN, 0.0, EYE),
    (0.1, [10.0, 200.0, 30.0], FULL_K1.T, FULL_K2.T),
]


@pytest.mark.parametrize(("interval", "observer_gain", "K1", "K2"), DESIGNS)
def test_error_grows_only_above_the_sampled_limit(
    interval: float, observer_gain: Any, K1: Any, K2: Array
) -> None:
    limit = sampled_limit_gain(
        LearningLaw(INERTIA, observer_gain, SKEWED.fault_matrix, K1, K2, interval)
    )
    resting = np.zeros((2 * 10 * 400 + 1, 3))
    growth = []
    for factor in (0.97, 1.03):
        observer = SampledILO(
            SKEWED,
            K1=K1,
            K2=factor * limit * K2,
            observer_gain=observer_gain,
            update_interval=interval,
            allow_unstable=True,
            sampling_period=interval / 10,
        )
        # An error so small that the gyroscopic torque stays negligible.
        run = run_on_halves(observer, resting, resting, start=observer.init([1e-90, -2e-90, 3e-90]))
        assert run.diverged_at is None
        size = np.linalg.norm(run["rate"] / 1e-90, axis=1)[:-1].reshape(4, -1).max(axis=1)
        growth.append(size[3] / size[1])
    # Below the limit slow modes may beat, so the maxima of two quarters differ slightly.
    assert growth[0] < 1.1
    assert growth[1] > 2.0


# --- Accuracy -----------------------------------------------------------------------------------

INTERVALS = [0.003, 0.006, 0.0125, 0.025, 0.05, 0.1, 0.15, 0.2]
OMEGA = 10.0


def turned(fault: Callable[[float], Any], end: float, start: Any = (0.0, 0.0, 0.0)) -> Any:
    """The rate of the body under a fault torque on its axes, as a function of time."""
    return trajectory(lambda t, rate, _: euler(rate, np.array(fault(t))), start, (0.0, end))


@cache
def turned_by_a_sine() -> Any:
    return turned(lambda t: [np.sin(OMEGA * t), 0.0, 0.0], 22.0)


def errors_under_a_sine(
    observer: RigidBodyObserver, settle: float, periods: int
) -> tuple[Array, NDArray[np.complex128]]:
    """RMS of e, and its component at 10 rad/s, under the fault sin 10 t of thruster 1.

    Body and observer start at rest and agree, so that the only start-up ripple is that of the
    onset; it has ``settle`` seconds to decay. The rest of it lies near multiples of 2 pi / tau and
    is nearly orthogonal to the fitted sine and to a window of whole periods.
    """
    h = observer.sampling_period
    steps = round((settle + periods * 2 * np.pi / OMEGA) / h)
    rate = turned_by_a_sine()(np.arange(2 * steps + 1) * h / 2)
    run = run_on_halves(observer, rate, np.zeros_like(rate), start=observer.init(np.zeros(3)))
    first = round(settle / h)
    time = np.arange(first, steps + 1) * h
    torque = np.outer(np.sin(OMEGA * time), [1.0, 0.0, 0.0])
    start = (torque - run["fault"][first:])[:-1]
    end = (torque - run.before["fault"][first:])[1:]
    # Simpson's rule is exact for the square of a piecewise linear function.
    rms = np.sqrt(np.mean((start**2 + start * end + end**2) / 3, axis=0))
    waves = np.column_stack([np.cos(OMEGA * time), np.sin(OMEGA * time), np.ones_like(time)])
    cosine, sine, _ = np.linalg.lstsq(waves, torque - run["fault"][first:], rcond=None)[0]
    return rms, sine + 1j * cosine


@pytest.mark.nightly_after(11)
@pytest.mark.parametrize(("K1", "observer_gain"), [(1.0, 100.0), (0.9, 100.0), (0.9, 10.0)])
@pytest.mark.parametrize("interval", INTERVALS)
def test_error_of_the_continuous_observer_is_as_predicted(
    interval: float, K1: float, observer_gain: float
) -> None:
    step = interval / max(10, round(interval / 5e-4))
    observer = ILO(
        BODY, K1=K1, K2=2000.0, observer_gain=observer_gain, update_interval=interval,
        sampling_period=step,
    )  # fmt: skip
    rms, component = errors_under_a_sine(observer, 10.0, 10)
    theory = (INERTIA, observer_gain, 1.0, K1, 2000.0, interval)
    transfer = error_transfer(OMEGA, LearningLaw(*theory))[0, :, 0]
    assert np.abs(component - transfer).max() < 1e-3 * abs(transfer[0])
    predicted = predicted_rms_error([[1.0, 0.0, 0.0]], [OMEGA], LearningLaw(*theory))
    assert rms[:2] == pytest.approx(predicted[:2], rel=2e-3)


@pytest.mark.parametrize("K1", [1.0, 0.9])
@pytest.mark.parametrize("interval", INTERVALS)
def test_error_of_the_sampled_observer_is_as_predicted(interval: float, K1: float) -> None:
    step = interval / max(10, round(interval / 5e-4))
    observer = SampledILO(
        BODY, K1=K1, K2=1000.0, observer_gain=1000.0, update_interval=interval, sampling_period=step
    )
    rms, _ = errors_under_a_sine(observer, 10.0, 10)
    predicted = predicted_rms_error(
        [[1.0, 0.0, 0.0]],
        [OMEGA],
        LearningLaw(*(INERTIA, 1000.0, 1.0, K1, 1000.0, interval)),
        variant="sampled",
    )
    # Held, v also contains the images of the sine at the update rate, which beat inside the window.
    assert rms[:2] == pytest.approx(predicted[:2], rel=0.02)


@pytest.mark.parametrize(
    ("integral", "proportional", "observer_gain"),
    [(100.0, 0.0, 100.0), (1e4, 0.0, 1000.0), (1e5, 300.0, 500.0), (2e5, 1000.0, 100.0)],
)
def test_error_of_the_adaptive_observer_is_as_predicted(
    integral: float, proportional: float, observer_gain: float
) -> None:
    observer = AdaptiveObserver(
        BODY,
        observer_gain=observer_gain,
        integral_gain=integral,
        proportional_gain=proportional,
        sampling_period=5e-4,
    )
    rms, component = errors_under_a_sine(observer, 15.0, 10)
    gains = (observer_gain, 1.0, integral, proportional)
    transfer = pi_error_transfer(OMEGA, INERTIA, *gains)[0, :, 0]
    assert np.abs(component - transfer).max() < 1e-3 * abs(transfer[0])
    assert rms[0] == pytest.approx(abs(transfer[0]) / np.sqrt(2), rel=2e-3)


def test_identity_learning_approaches_the_matched_adaptive_observer() -> None:
    # By 1 / (1 - exp(-x)) = 1/x + 1/2 + x/12 + ..., the two laws differ by K2 s tau / 12, applied
    # to w~, which is s tau / K2 u_f; the loops divide by K2 / (s tau (J s + Lambda)). So the
    # estimates differ by tau^3 / (12 K2) (J u_f'''' + Lambda u_f''') for a small tau.
    gain, observer_gain, step, horizon = 2000.0, 100.0, 1e-4, 4.0
    # 16 sin^5 t has four vanishing derivatives at the start: no ripple arises at the onset.
    waves = ((10.0, 1.0), (-5.0, 3.0), (1.0, 5.0))
    steps = round(horizon / step)
    plant = turned(lambda t: [sum(a * np.sin(f * t) for a, f in waves), 0.0, 0.0], horizon)
    rate = plant(np.arange(2 * steps + 1) * step / 2)
    control = np.zeros_like(rate)
    time = np.arange(steps + 1) * step
    third = sum(-a * f**3 * np.cos(f * time) for a, f in waves)
    fourth = sum(a * f**4 * np.sin(f * time) for a, f in waves)
    leading = np.outer(fourth, INERTIA[:, 0]) / (12 * gain)
    leading[:, 0] += observer_gain * third / (12 * gain)

    intervals, sizes = [0.02, 0.01, 0.005], []
    for interval in intervals:
        learning = ILO(
            BODY,
            K1=1.0,
            K2=gain,
            observer_gain=observer_gain,
            update_interval=interval,
            sampling_period=step,
        )
        gains = matched_integrator(gain, interval)
        matched = AdaptiveObserver(
            BODY,
            observer_gain=observer_gain,
            integral_gain=gains.integral_gain,
            proportional_gain=gains.proportional_gain,
            sampling_period=step,
        )
        late = time > 1.0
        difference = (
            run_on_halves(learning, rate, control, start=learning.init(np.zeros(3)))["fault"]
            - run_on_halves(matched, rate, control, start=matched.init(np.zeros(3)))["fault"]
        )[late]
        sizes.append(np.abs(difference).max())
        known = interval**3 * leading[late]
    slope = np.polyfit(np.log(intervals), np.log(sizes), 1)[0]
    assert slope == pytest.approx(3.0, abs=0.1)
    assert np.abs(difference - known).max() < 0.03 * np.abs(known).max()


# --- Divergence ---------------------------------------------------------------------------------

FAST_BODY = RigidBody(np.diag([1.0, 2.0, 3.0]), fault_matrix=1e-3)
DIVERGING: dict[str, RigidBodyObserver] = {
    "continuous": ILO(
        BODY,
        K1=3.0,
        K2=200.0,
        observer_gain=10.0,
        update_interval=0.01,
        allow_unstable=True,
        sampling_period=0.0025,
    ),
    "sampled": SampledILO(
        BODY,
        K1=1.0,
        K2=20000.0,
        observer_gain=10.0,
        update_interval=0.01,
        allow_unstable=True,
        sampling_period=0.0025,
    ),
    "adaptive": AdaptiveObserver(
        BODY,
        observer_gain=1000.0,
        integral_gain=1000.0,
        proportional_gain=10.0,
        sampling_period=0.5,
    ),  # far too large a step
    # An estimate about the first axis only, for which the gyroscopic torque vanishes: v, not
    # the rate, overflows first.
    "continuous, fault first": ILO(
        FAST_BODY,
        K1=3.0,
        K2=1000.0,
        observer_gain=10.0,
        update_interval=0.01,
        allow_unstable=True,
        sampling_period=0.0025,
    ),
    "sampled, fault first": SampledILO(
        FAST_BODY,
        K1=3.0,
        K2=1000.0,
        observer_gain=10.0,
        update_interval=0.01,
        allow_unstable=True,
        sampling_period=0.0025,
    ),
    "adaptive, fault first": AdaptiveObserver(
        FAST_BODY,
        observer_gain=1000.0,
        integral_gain=1.0,
        proportional_gain=1e5,
        sampling_period=0.5,
    ),
}


def run_at_rest(observer: RigidBodyObserver, name: str, steps: int) -> Run[RigidBodyState]:
    record = np.zeros((2 * steps + 1, 3))
    first = [0.1, 0.0, 0.0] if "first" in name else [0.1, 0.2, -0.1]
    start = observer.init(first)
    return run_on_halves(observer, record, record, start=start, on_divergence="return")


@pytest.mark.parametrize("unwritten", [np.nan, 1.0])
@pytest.mark.parametrize("name", DIVERGING)
def test_divergent_run_returns_the_finite_rows_and_their_time(
    name: str, unwritten: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Rows not written by the loop are not returned, whatever the memory contained before.
    monkeypatch.setattr(np, "empty", lambda shape: np.full(shape, unwritten))
    observer = DIVERGING[name]
    run = run_at_rest(observer, name, 4000)
    assert run.diverged_at is not None
    rows = len(run["rate"])
    assert len(run["fault"]) == len(run.before["fault"]) == rows < 4001
    assert run.diverged_at == pytest.approx((rows - 1) * observer.sampling_period, rel=1e-12)
    for values in (run["rate"], run["fault"], run.before["fault"]):
        assert np.isfinite(values).all()
    assert np.max(np.abs([run["rate"][-1], run["fault"][-1]])) > 1e10
    # A record that ends there gives the same rows without divergence; one step more diverges.
    shorter = run_at_rest(observer, name, rows - 1)
    assert shorter.diverged_at is None
    for estimate in ("rate", "fault"):
        assert np.array_equal(shorter[estimate], run[estimate]), estimate
    assert np.array_equal(shorter.before["fault"], run.before["fault"])
    assert run_at_rest(observer, name, rows).diverged_at == run.diverged_at


def test_divergence_is_reported_when_the_linear_law_overflows() -> None:
    # The law on one axis by hand, rescaled after every interval so that it cannot overflow.
    inertia, observer_gain, fault, K1, K2, interval = 1.0, 10.0, 1e-3, 3.0, 1000.0, 0.01
    decay = np.exp(-observer_gain * interval / inertia)
    error, v, logarithm, updates = -0.1, 0.0, 0.0, 0
    while logarithm + np.log(max(abs(v), abs(error))) < np.log(np.finfo(float).max):
        v = K1 * v + K2 * error
        error = decay * error - (1 - decay) / observer_gain * fault * v
        scale = max(abs(v), abs(error))
        error, v, logarithm, updates = (
            error / scale,
            v / scale,
            logarithm + np.log(scale),
            updates + 1,
        )
    # v overflows at the last update above: the row one step earlier is the last finite one.
    name = "sampled, fault first"
    run = run_at_rest(DIVERGING[name], name, 4000)
    assert run.diverged_at == pytest.approx((updates - 1) * interval - 0.0025)


@each_observer
def test_overflow_at_the_first_sample_is_reported(
    observer: RigidBodyObserver,
) -> None:
    state = observer.init(np.full(3, -1e308), fault=np.full(3, 1e308))
    for call in (
        observer.step,
        lambda state, *row: observer.run(*np.stack(row)[:, None], start=state),
    ):
        with pytest.raises(DivergenceError, match=r"finite up to t = 0 s and not after$"):
            call(state, np.full(3, 1e308), np.zeros(3))


# --- Bad input ----------------------------------------------------------------------------------

Build = Callable[[], object]


def continuous(**changed: Any) -> RigidBodyObserver:
    settings = {"K1": 0.9, "K2": 2000.0, "observer_gain": 100.0, "update_interval": 0.01, **changed}
    step = settings.pop("sampling_period", 0.0025)
    return ILO(BODY, **settings, sampling_period=step)


def sampled(**changed: Any) -> RigidBodyObserver:
    settings = {"K1": 0.9, "K2": 2000.0, "observer_gain": 100.0, "update_interval": 0.01, **changed}
    step = settings.pop("sampling_period", 0.0025)
    return SampledILO(BODY, **settings, sampling_period=step)


def adaptive(**changed: Any) -> RigidBodyObserver:
    settings = {"observer_gain": 100.0, "integral_gain": 100.0, "proportional_gain": 0.0, **changed}
    step = settings.pop("sampling_period", 0.0025)
    return AdaptiveObserver(BODY, **settings, sampling_period=step)


UPDATE = "^update_interval: "
BAD_INPUT: list[tuple[Build, str]] = [
    # Steps and intervals
    (
        lambda: whole_steps(0.1, 0.03),
        r"^update_interval: 0.1 s must be a whole multiple .* 0.03 s$",
    ),
    (lambda: whole_steps(0.1, 0.3), UPDATE + r"0.1 s must be a whole multiple .* 0.3 s$"),
    # Gains
    *[
        case
        for build in (continuous, sampled)
        for case in (
            (
                lambda b=build: b(update_interval=0.0),
                r"^update_interval: 0 must be greater than zero$",
            ),
            (
                lambda b=build: b(update_interval=-0.01),
                r"^update_interval: -0.01 must be greater than zero$",
            ),
            (
                lambda b=build: b(update_interval=0.011),
                r"^update_interval: 0.011 s .* multiple .* 0.0025 s$",
            ),
            (
                lambda b=build: b(update_interval=[0.01]),
                r"^update_interval: \[0.01\] must be one number",
            ),
            (
                lambda b=build: b(sampling_period=0),
                r"^sampling_period: 0 must be greater than zero$",
            ),
            (lambda b=build: b(K1=np.eye(2)), "^K1: " + SHAPE.format("2, 2")),
            (lambda b=build: b(K2=[1.0, 2.0]), "^K2: " + SHAPE.format("2,")),
            (lambda b=build: b(K2=np.nan), r"^K2: nan has an entry that is not finite$"),
            (
                lambda b=build: b(observer_gain=-1.0),
                r"^observer_gain: .* positive definite, .* -1, -1, -1$",
            ),
            (
                lambda b=build: b(observer_gain=[[9, 1, 0], [0, 9, 0], [0, 0, 9]]),
                r"^observer_gain: .* must be symmetric$",
            ),
        )
    ],
    (lambda: adaptive(sampling_period=-1.0), r"^sampling_period: -1 must be greater than zero$"),
    (
        lambda: adaptive(observer_gain=0.0),
        r"^observer_gain: must be positive definite, .* 0, 0, 0$",
    ),
    (lambda: adaptive(integral_gain=[1, 1, -2]), r"^integral_gain: .* eigenvalues are -2, 1, 1$"),
    (lambda: adaptive(proportional_gain=[1, 2]), "^proportional_gain: " + SHAPE.format("2,")),
    # ln(1.05) / 0.01 s = 4.879 1/s
    (
        lambda: continuous(K1=1.05),
        r"^K1, K2: must give stable error dynamics, .* spectral radius 1.05 > 1, .*exp\(4.879 t\)$",
    ),
    # At K1 = 0.9 and Lambda = 100 the limit is 1.9 * 100 / tanh(100 * 0.01 / (2 * 16.882322)),
    # with the smallest moment of inertia 26.5 - sqrt(9.5^2 + 1.5^2): 6417.15, a tenth of this K2.
    (
        lambda: sampled(K2=64171.526),
        r"^K1, K2: must give stable error dynamics, .* radius .*; the limit is 0.1 times this K2$",
    ),
    (lambda: sampled(K1=1.05), r"^K1, K2: .*; the limit is 0 times this K2$"),
]


@pytest.mark.parametrize(("build", "sentence"), BAD_INPUT)
def test_invalid_input_is_refused_in_one_sentence(build: Build, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        build()


@pytest.mark.parametrize("power", range(0, 309, 28))
def test_learning_of_the_wrong_sign_is_refused_at_every_size(power: int) -> None:
    """From -1, at which the gains of the observer are no greater, to the largest floats."""
    for build in (continuous, sampled):
        with pytest.raises(InputError, match=r"^K1, K2: "):
            build(K1=1.0, K2=-(10.0**power), observer_gain=1.0)


@each_observer
def test_invalid_initial_rate_is_refused(observer: RigidBodyObserver) -> None:
    with pytest.raises(InputError, match=r"^rate: has shape \(2,\), must be a list of 3 numbers$"):
        observer.init([1.0, 2.0])
    with pytest.raises(InputError, match=r"^rate: \[0.0, 0.0, inf\] has an entry"):
        observer.init([0.0, 0.0, np.inf])


def test_exact_initial_estimate_stays_exact() -> None:
    """True rate and known constant fault at the start: K1 = I and integrators keep them."""
    body, step, torque = RigidBody(INERTIA), 1e-3, [0.3, -0.2, 0.1]
    rate = turned(lambda _: torque, 1.0, [0.1, 0.2, -0.1])(np.arange(2001) * step / 2)
    for observer in (
        ILO(
            body,
            K1=1.0,
            K2=500.0,
            observer_gain=50.0,
            update_interval=10 * step,
            sampling_period=step,
        ),
        SampledILO(
            body,
            K1=1.0,
            K2=500.0,
            observer_gain=50.0,
            update_interval=10 * step,
            sampling_period=step,
        ),
        AdaptiveObserver(
            body,
            observer_gain=50.0,
            integral_gain=100.0,
            proportional_gain=20.0,
            sampling_period=step,
        ),
    ):
        run = run_on_halves(
            observer, rate, np.zeros_like(rate), start=observer.init(rate[0], fault=torque)
        )
        assert np.max(np.abs(run["fault"] - torque)) < 1e-9
        assert np.max(np.abs(run.before["fault"] - torque)) < 1e-9


def test_unstable_gains_are_accepted_on_request() -> None:
    assert continuous(K1=1.05, allow_unstable=True)
    assert sampled(K2=64171.526, allow_unstable=True)


def test_sampled_gain_is_refused_just_above_the_limit_and_accepted_below() -> None:
    limit = 1.9 * 100 / np.tanh(100 * 0.01 / (2 * (26.5 - np.sqrt(9.5**2 + 1.5**2))))
    assert sampled(K2=(1 - 1e-9) * limit)
    with pytest.raises(InputError, match="the limit is 1 times this K2"):
        sampled(K2=(1 + 1e-9) * limit)

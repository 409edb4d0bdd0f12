"""What filters refuse that is given by row, at uneven times or for many records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reobserve import (
    AugmentedKalmanFilter,
    DivergenceError,
    ExtendedKalmanFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    steady_kalman,
)
from tests.reobserve.observers.by_row import (
    MODEL,
    PENDULUM,
    ROWS,
    SPRING,
    TIMES,
    augmented,
    bank,
    kalman_bank,
    record,
    svsf,
)

MEANS = {2: [0.3, -0.2], 3: [0.3, -0.2, 0.1]}
DISCRETE = NonlinearModel(
    ["a + w/10", "w + u - v"], ["a", "w"], 0.1, 0.1, state_names=["a", "w"], input_names=["u", "v"]
)
NO_DENSITY = LinearModel.from_ode(
    SPRING.ode.A, SPRING.ode.B, SPRING.C, Q=0.1, R=0.1, sampling_period=0.1  # type: ignore[union-attr]
)  # fmt: skip
NOT_POSITIVE = np.tile(np.eye(3), (ROWS, 1, 1))
NOT_POSITIVE[6, 0, 0] = -1.0
TOO_MUCH = np.zeros((ROWS, 3, 2))
TOO_MUCH[4, 0, 0] = 0.15  # above sqrt(0.2 * 0.1)
BACK = np.where(np.arange(ROWS) == 5, 0.3, TIMES)


def kalman(model: LinearModel = MODEL) -> KalmanFilter:
    return KalmanFilter(model)


def extended(model: NonlinearModel = PENDULUM) -> ExtendedKalmanFilter:
    return ExtendedKalmanFilter(model)


REFUSED: dict[str, tuple[Callable[[], Any], dict[str, Any], str]] = {
    "A of other size": (
        kalman, {"A": np.ones((ROWS, 2, 3))},
        r"A: has shape \(9, 2, 3\), must be \(3, 3\) or \(9, 3, 3\)$",
    ),
    "C of fewer rows": (
        kalman, {"C": np.ones((4, 2, 3))},
        r"C: has shape \(4, 2, 3\), must be \(2, 3\) or \(9, 2, 3\)$",
    ),
    "Q of fewer rows": (
        kalman, {"Q": np.tile(np.eye(3), (4, 1, 1))},
        r"Q: has shape \(4, 3, 3\), must be one covariance or \(9, 3, 3\)$",
    ),
    "Q not positive": (
        kalman, {"Q": NOT_POSITIVE},
        r"Q\[6\]: must be positive semidefinite, its eigenvalues are -1, 1, 1$",
    ),
    "R negative": (
        kalman, {"R": np.tile(-np.eye(2), (ROWS, 1, 1))},
        r"R\[0\]: must be positive semidefinite, its eigenvalues are -1, -1$",
    ),
    "D not finite": (kalman, {"D": np.full((ROWS, 2, 2), np.nan)}, r"D: .* not finite$"),
    "S of other size": (
        kalman, {"S": np.zeros((ROWS, 2, 3))},
        r"S: has shape \(9, 2, 3\), must be \(3, 2\) or \(9, 3, 2\)$",
    ),
    "S beyond Q and R": (
        kalman, {"S": TOO_MUCH},
        r"S: is more than Q and R allow: with row 4 \[\[Q, S\], \[S', R\]\] is no covariance$",
    ),
    "A of the augmented state": (
        augmented, {"A": np.zeros((ROWS, 4, 4))},
        r"A: has shape \(9, 4, 4\), must be \(3, 3\) or \(9, 3, 3\)$",
    ),
    "S for an SVSF": (svsf, {"S": np.zeros((3, 2))}, r"S: is not taken by Smooth"),
    "C for an SVSF": (svsf, {"C": MODEL.C}, r"C: is not taken by SmoothVariableStructureFilter,"),
    "S for a fixed gain": (
        lambda: steady_kalman(MODEL), {"S": np.zeros((3, 2))},
        r"S: is not taken by FixedGainObserver, beside y and u it takes A, B, C, D, Q, R, keep$",
    ),
    "S for SVSFs in a bank": (
        lambda: bank(svsf(), svsf()), {"S": np.zeros((3, 2))},
        r"S: is not taken by SmoothVariableStructureFilter, which is a filter of the bank$",
    ),
    "C for SVSFs in a bank": (
        lambda: bank(svsf(), svsf()), {"C": MODEL.C},
        r"C: is not taken by SmoothVariableStructureFilter, which is a filter of the bank$",
    ),
    "Q for a bank of EKFs": (
        lambda: bank(extended(), extended()), {"Q": np.eye(2)},
        r"Q: is taken by banks of filters of one kind on linear models alone$",
    ),
    "A of three modes": (
        kalman_bank, {"A": np.zeros((ROWS, 3, 3, 3))},
        r"A: has shape \(9, 3, 3, 3\), must be \(k, 2, ., .\)$",
    ),
    "uneven time in discrete time": (
        kalman, {"time": TIMES},
        r"time: goes from 0.2 to 0.35 s at row 3, must go on by the sampling period of 0.1 s; for "
        r"other times make the model by from_ode, with the density of the noise$",
    ),
    "uneven time, no density": (
        lambda: kalman(NO_DENSITY), {"time": TIMES},
        r"time: goes from 0.2 to 0.35 s at row 3, must go on by the sampling period of 0.1 s; for "
        r"other times give from_ode the density of the noise, or Q by row$",
    ),
    "uneven time of a bank": (
        lambda: bank(kalman(SPRING), kalman(NO_DENSITY)), {"time": TIMES},
        r"time: goes from 0.2 to 0.35 s at row 3, must go on by",
    ),
    "uneven time of an augmented filter": (
        lambda: AugmentedKalmanFilter(SPRING, fault_matrix=[[1.0], [0.0]], random_walk=0.1),
        {"time": TIMES},
        r"time: goes from 0.2 to 0.35 s at row 3, must go on by the sampling period of 0.1 s; for "
        r"other times give from_ode the matrices of \[x, d\], for a Kalman filter$",
    ),
    "time going back": (
        lambda: kalman(SPRING), {"time": BACK}, r"time: must increase, does not at row 5, of 0.3 s$"
    ),
    "time of fewer rows": (lambda: kalman(SPRING), {"time": TIMES[:4]}, r"time: has 4 rows"),
    "dt and time": (
        extended, {"time": TIMES, "dt": np.full(ROWS, 0.1)},
        r"dt: is given beside time, must be the only one of them$",
    ),
    "dt in discrete time": (
        lambda: extended(DISCRETE), {"dt": 0.2},
        r"dt: can only be given for a model of a differential equation, by from_ode$",
    ),
    "dt not positive": (extended, {"dt": [0.1] * 8 + [0.0]}, r"dt: .* must be a positive time"),
    "dt of fewer rows": (extended, {"dt": [0.1] * 4}, r"dt: .* must be a positive time, or 9 of"),
    "unknown parameter": (
        extended, {"parameters": {"stifness": 1.0}},
        r"parameters.stifness: is no parameter of the model; did you mean 'stiffness'\?$",
    ),
    "parameter of fewer rows": (
        extended, {"parameters": {"stiffness": [1.0, 2.0]}},
        r"parameters.stiffness: has shape \(2,\), must be one number or \(9,\)$",
    ),
    "unknown to be kept": (
        kalman, {"keep": ["gains"]},
        r"keep: 'gains' must be one of predicted_state, predicted_covariance, gain$",
    ),
    "number to be kept": (kalman, {"keep": 3}, r"keep: 3 must be one of predicted_state, "),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_given_is_refused(kind: str) -> None:
    make, given, problem = REFUSED[kind]
    one, (y, u) = make(), record()
    model = one.filters[0].model if hasattr(one, "filters") else one.model
    state = one.init(MEANS[model.states], 0.5)
    with pytest.raises(InputError, match=f"^{problem}"):
        one.run(y, u, start=state, **given)


def test_models_refuse_noise_and_density_together() -> None:
    ode, rest = ([[0.0]], [[1.0]], [[1.0]]), {"R": 1.0, "sampling_period": 0.1}
    with pytest.raises(InputError, match=r"^density: is given beside Q, must be the only one"):
        LinearModel.from_ode(*ode, Q=0.1, density=0.1, **rest)
    with pytest.raises(InputError, match=r"^density: is given beside Q; must be exactly one of"):
        NonlinearModel.from_ode(["-a"], ["a"], Q=0.1, density=0.1, state_names=["a"], **rest)
    with pytest.raises(InputError, match=r"^density: is left out, and so is Q; must be exactly"):
        NonlinearModel.from_ode(["-a"], ["a"], state_names=["a"], **rest)
    with pytest.raises(InputError, match=r"^density: must be positive semidefinite"):
        LinearModel.from_ode(*ode, density=-1.0, **rest)


def test_records_of_other_lengths_are_refused() -> None:
    one, (y, u) = kalman(), record()
    state = one.init([0.0] * 3, 1.0)
    with pytest.raises(InputError, match=r"^record 1\.u: has 9 rows, must have 5 like y"):
        one.run([y, y[:5]], u, start=state)
    with pytest.raises(InputError, match=r"^record 1\.y: has 5 rows, must have 9 like record 0$"):
        one.run([y, y[:5]], [u, u[:5]], start=state)
    with pytest.raises(InputError, match=r"^y: has no record, must have one or more$"):
        one.run(np.empty((0, ROWS, 2)), u, start=state)
    with pytest.raises(InputError, match=r"^u: is of 3 records, must be of 2 like y$"):
        one.run([y, y], [u] * 3, start=state)
    with pytest.raises(InputError, match=r"^start: is of 1 records, must be of 2 like y$"):
        one.run([y, y], u, start=[state])
    with pytest.raises(InputError, match=r"^record 1\.y: has shape \(9, 1\), must have one row or"):
        one.run([y, y[:, :1]], u, start=state)


DAMAGED: dict[str, tuple[Callable[[], Any], dict[str, Any], str]] = {
    "no matrices": (kalman, {"held": 3}, r"start\.held: 3 must be matrices by name: A, B, Q, tran"),
    "of another filter": (kalman, {"held": {"dt": [0.1]}}, r"start\.held: .* must be matrices by"),
    "of other size": (
        kalman, {"held": {"A": np.eye(2)}}, r"start\.held\.A: .* must be finite, of shape \(3, 3",
    ),
    "text": (kalman, {"held": {"A": "no"}}, r"start\.held\.A: 'no' is not a number or an array"),
    "not finite": (
        kalman, {"held": {"Q": np.full((3, 3), np.nan)}}, r"start\.held\.Q: .* must be finite",
    ),
    "part of what S takes out": (
        kalman, {"held": {"known": np.zeros(3)}},
        r"start\.held: must have all of transition, noise, known, or none$",
    ),
    "dt not positive": (extended, {"held": {"dt": [0.0]}}, r"start\.held\.dt: .* a positive time$"),
    "of no bank": (kalman_bank, {"held": 3}, r"start\.held: 3 must be of 2 filters$"),
    "of other size in a bank": (
        kalman_bank, {"held": ({}, {"B": np.eye(3)})}, r"start\.held\[1\]\.B: .* must be finite",
    ),
    "time": (kalman, {"time": "now"}, r"start\.time: 'now' is not a number"),
    "time not finite": (kalman_bank, {"time": np.nan}, r"start\.time: nan has an entry that"),
}  # fmt: skip


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_states_are_refused(kind: str) -> None:
    make, changed, problem = DAMAGED[kind]
    one, (y, u) = make(), record()
    model = one.filters[0].model if hasattr(one, "filters") else one.model
    state = replace(one.init(MEANS[model.states], 0.5, u=u[0]), **changed)
    with pytest.raises(InputError, match=f"^{problem}"):
        one.run(y, u, start=state)


def test_lists_of_other_kinds_are_refused() -> None:
    one, (y, u) = kalman_bank(), record()
    with pytest.raises(InputError, match=r"^A: .* is not a number or an array of numbers$"):
        one.run(y, u, start=one.init(MEANS[3], 0.5), A=[[1.0, 2.0], [3.0]])
    single = kalman()
    state = single.init(MEANS[3], 0.5)
    with pytest.raises(InputError, match=r"^keep: .* must be one of predicted_state"):
        single.run(y, u, start=state, keep=np.eye(3))
    with pytest.raises(InputError, match=r"^number: True must be a record, below 2$"):
        single.run([y, y], u, start=state).record(True)
    with pytest.raises(InputError, match=r"^A: .* is not a number or an array of numbers$"):
        LinearModel.from_ode([[0.0], [1.0, 2.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=0.1)


def test_models_of_equations_may_be_checked() -> None:
    ode, rest = ([[-40.0, 40.0], [-40.0, -40.0]],), {"C": [[1.0, 0.0]], "Q": 1.0, "R": 1.0}
    assert LinearModel.from_ode(*ode, **rest, sampling_period=0.05).check is False
    with pytest.raises(InputError, match=r"^A: has the eigenvalue"):
        LinearModel.from_ode(*ode, **rest, sampling_period=0.05, check=True)


@pytest.mark.parametrize("changed", [{"Q": 0.5}, {"density": 0.5}, {"sampling_period": 0.2}])
def test_density_of_another_noise_is_refused(changed: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"^density: times the sampling period is not Q: leave it"):
        replace(PENDULUM, **changed)
    assert replace(PENDULUM, R=0.5).density is not None
    assert replace(PENDULUM, Q=0.5, density=None).density is None


def test_times_that_dt_did_not_lead_to_are_refused() -> None:
    one, (y, u) = extended(), record()
    state = one.run(y, u, start=one.init(MEANS[2], 0.5), dt=0.2).end
    with pytest.raises(InputError, match=r"^time: begins 0\.3 s after the row before, from where"):
        one.run(y[:1], u[:1], start=state, time=[1.9])
    led = one.run(y, u, start=state).end.posterior.mean
    times = 1.8 + 0.1 * np.arange(ROWS)
    assert np.allclose(one.run(y, u, start=state, time=times).end.posterior.mean, led, atol=1e-12)


def test_divergence_before_the_first_row_has_the_time_of_the_state() -> None:
    one, (y, u) = kalman(SPRING), record()
    state, _ = one.step(one.init(MEANS[2], 0.5), y[0], u[0], time=0.2, A=1e200 * np.eye(2))
    with pytest.raises(DivergenceError, match=r"is finite up to t = 0\.2 s and not after"):
        one.step(state, y[1], u[1], time=5.0)
    run = one.run([y[:1], y[1:2]], u[:1], start=state, time=[5.0], on_divergence="return")
    assert run.diverged_at.tolist() == [0.2, 0.2]
    assert [len(run.record(number)) for number in (0, 1)] == [0, 0]


def test_states_that_hold_what_another_model_has_are_refused() -> None:
    one, (y, u) = extended(), record()
    state = one.run(y, u, start=one.init(MEANS[2], 0.5), parameters={"stiffness": 9.0}).end
    with pytest.raises(InputError, match=r"^start\.held\.parameters: .* of shape \(0,\)$"):
        extended(DISCRETE).run(y, u, start=state)
    with pytest.raises(InputError, match=r"^start\.held: .* must be matrices by name: A, B, Q, tr"):
        kalman(SPRING).run(y, u, start=state)

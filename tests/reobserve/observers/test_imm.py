"""Interacting multiple model: filterpy, closed forms of the chain, 50 digits, bitwise identity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator
from filterpy.kalman import KalmanFilter as FilterpyKalmanFilter
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import DivergenceError
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import Correction, Gaussian
from reobserve.observers.imm import IMM, ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.run import Run
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.actuator_models import (
    ACTUATOR,
    STICKY,
    kalman_law,
    motion_model,
    moved,
    reference,
    ripple,
    run_over,
    simulated,
    square_wave,
    switching_law,
    symmetric,
    velocity_model,
)

Array = NDArray[np.float64]

PSI, GAMMA = [0.01, 0.3, 20.0], 0.1
P0 = np.diag([18.0, 0.0038, 0.012, 0.0044, 0.0021])
NOISE = np.array([0.01, 0.5, 20.0])
VELOCITY = [velocity_model(mode) for mode in ACTUATOR]
MOTION = [motion_model(mode) for mode in ACTUATOR]


def kalmans(models: Sequence[LinearModel]) -> list[KalmanFilter]:
    return [KalmanFilter(model) for model in models]


def svsfs(models: Sequence[LinearModel], psi: Any = PSI) -> list[SmoothVariableStructureFilter]:
    return [
        SmoothVariableStructureFilter(model, boundary_layer=psi, convergence_rate=GAMMA)
        for model in models
    ]


def velocity_record(rows: int, switch: int, noise: float = 0.01) -> tuple[Array, Array]:
    """Normal up to a row and leaky from there."""
    u = square_wave(rows, 70)
    z = simulated(VELOCITY[0], u)
    z[switch:] = simulated(VELOCITY[2], u)[switch:]
    return z + noise * ripple(rows), u


def motion_record(rows: int) -> tuple[Array, Array]:
    u = square_wave(rows, 12)
    return simulated(MOTION[2], u) + NOISE * ripple(rows, 3), u


def same_bits(one: dict[str, Array], other: dict[str, Array]) -> bool:
    return one.keys() == other.keys() and all(
        np.array_equal(values, other[name], equal_nan=True) for name, values in one.items()
    )


def remembered(state: ImmState) -> dict[str, Array]:
    """The state, by the names of its parts."""
    found = {"log_probabilities": state.log_probabilities, "count": np.array(state.count)}
    for j, posterior in enumerate(state.posteriors):
        found |= {f"{name} {j}": values for name, values in vars(posterior).items()}
    assert state.sample is not None
    return {**found, "sample": state.sample}


def reported(*runs: Run[ImmState]) -> dict[str, Array]:
    """The results of consecutive runs, and the last state."""
    joined = {name: np.concatenate([run[name] for run in runs]) for name in runs[0].estimates}
    return {**joined, **remembered(runs[-1].end)}


def relative(found: Array, expected: Array) -> float:
    """The largest error of an entry over the largest value that this entry takes."""
    return float(np.max(np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)))


# --- Against filterpy ---------------------------------------------------------------------------


def filterpy_bank(models: Sequence[LinearModel], transition: Array, P: Array) -> IMMEstimator:
    filters = []
    for model in models:
        one = FilterpyKalmanFilter(model.states, model.outputs, model.inputs)
        one.F, one.B, one.H, _, one.Q, one.R = (part.copy() for part in model.arrays)
        one.P = P.copy()
        filters.append(one)
    return IMMEstimator(filters, np.full(len(models), 1 / len(models)), transition)


def filterpy_run(bank: IMMEstimator, z: Array, u: Array) -> tuple[Array, Array, Array]:
    found = []
    for measurement, control in zip(z, u, strict=True):
        bank.predict(control[:, None])
        bank.update(measurement[:, None])
        found.append((bank.x[:, 0].copy(), bank.P.copy(), bank.mu.copy()))
    means, covariances, probabilities = zip(*found, strict=True)
    return np.array(means), np.array(covariances), np.array(probabilities)


def test_kalman_bank_agrees_with_filterpy() -> None:
    # Noise large enough to keep all likelihoods within the float range.
    models = [velocity_model(mode, R=4e-3) for mode in ACTUATOR]
    z, u = velocity_record(400, 200, 0.05)
    bank = IMM(kalmans(models), STICKY)
    run = run_over(bank, z, u, np.zeros(4), 0.1)
    x, P, mu = filterpy_run(filterpy_bank(models, STICKY, 0.1 * np.eye(4)), z, u)
    assert np.abs(run["probability"] - mu).max() < 1e-10
    assert relative(run["state"], x) < 1e-10
    assert relative(run["covariance"], P) < 1e-10
    assert np.ptp(run["probability"], axis=0).min() > 0.2


def test_bank_keeps_evidence_after_an_outlier_unlike_filterpy() -> None:
    # Every likelihood is below the smallest float; filterpy sets all of them to that.
    z, u = velocity_record(20, 20)
    z[12] += 4.0
    start = 0.001 * np.eye(4)
    bank = IMM(kalmans(VELOCITY), STICKY)
    run = run_over(bank, z, u, np.zeros(4), start)
    expected = reference(VELOCITY, [kalman_law] * 3, STICKY, np.zeros(4), start, z, u)
    peer = filterpy_bank(VELOCITY, STICKY, start)
    x, _, mu = filterpy_run(peer, z, u)
    assert np.abs(run["probability"] - expected.probability).max() < 1e-12
    assert relative(run["state"], expected.estimate) < 1e-12
    assert np.abs(mu[:12] - expected.probability[:12]).max() < 1e-12
    assert mu[12] == pytest.approx(mu[11] @ STICKY, rel=1e-12), "as if nothing was measured"
    assert np.abs(mu[12] - expected.probability[12]).max() > 0.5
    assert np.abs(x[12] - expected.estimate[12]).max() > 1e-2


# --- The chain of modes -------------------------------------------------------------------------

CONSTANT = LinearModel([[1.0]], np.empty((1, 0)), [[1.0]], Q=0.1, R=4.0)


def scalar_run(
    transition: ArrayLike, start: ArrayLike, rows: int = 200, **kwargs: Any
) -> Run[ImmState]:
    """A bank of identical models."""
    bank = IMM(kalmans([CONSTANT] * len(np.array(start))), transition)
    z = kwargs.get("z", 3.0 + 2.0 * ripple(rows))
    return run_over(bank, z, None, [0.0], 1.0, start)


def test_identical_models_reach_the_stationary_distribution() -> None:
    start = np.array([0.7, 0.3, 0.0])
    run = scalar_run(STICKY, start)
    mu = start
    for k in range(200):
        mu = mu @ STICKY
        assert run["probability"][k] == pytest.approx(mu, abs=1e-13)
    # Trees rooted at each mode: the stationary distribution by the Markov chain tree theorem.
    p = STICKY
    trees = [
        p[1, 0] * p[2, 0] + p[1, 2] * p[2, 0] + p[2, 1] * p[1, 0],
        p[0, 1] * p[2, 1] + p[0, 2] * p[2, 1] + p[2, 0] * p[0, 1],
        p[0, 2] * p[1, 2] + p[0, 1] * p[1, 2] + p[1, 0] * p[0, 2],
    ]
    long = scalar_run(STICKY, start, 1000)["probability"][-1]
    assert long == pytest.approx(np.array(trees) / np.sum(trees), abs=1e-13)
    alone = scalar_run([[1.0]], [1.0])
    assert run["state"] == pytest.approx(alone["state"], rel=1e-13)
    assert run["covariance"] == pytest.approx(alone["covariance"], rel=1e-13)


def test_probability_of_a_left_mode_decays_below_the_float_range() -> None:
    z = 3.0 + 2.0 * ripple(1500)
    run = scalar_run([[0.5, 0.5], [0.0, 1.0]], [0.25, 0.75], z=z)
    assert run.diverged_at is None
    assert run["probability"][:1000, 0] == pytest.approx(
        0.25 * 0.5 ** np.arange(1, 1001), rel=1e-10
    )
    assert run["probability"][-1].tolist() == [0.0, 1.0]
    for rows in (1100, 1500):
        left = scalar_run([[0.5, 0.5], [0.0, 1.0]], [0.25, 0.75], z=z[:rows])
        found = left.end.log_probabilities[0]
        assert found == pytest.approx(np.log(0.25) - rows * np.log(2), rel=1e-13)
    alone = scalar_run([[1.0]], [1.0], z=z)
    assert run["state"] == pytest.approx(alone["state"], rel=1e-13)


def test_modes_without_transitions_are_weighted_by_the_whole_record() -> None:
    # mu_j is then proportional to the product of likelihoods; the other mode recovers all digits
    # from far below the float range.
    other = LinearModel([[1.0]], np.empty((1, 0)), [[1.0]], Q=0.1, R=1.0)
    z = np.concatenate([6.0 * ripple(500), 0.2 * ripple(6000)])
    bank = IMM(kalmans([CONSTANT, other]), np.eye(2))
    run = bank.run(z, start=bank.init([0.0], 1.0))
    alone = [one.run(z, start=one.init([0.0], 1.0)) for one in kalmans([CONSTANT, other])]
    odds = np.cumsum(alone[0]["log_likelihood"] - alone[1]["log_likelihood"])
    assert odds.max() > 1000
    assert odds[-1] < -700
    expected = np.exp(-np.logaddexp(0.0, -odds))
    near = np.abs(odds) < 600
    assert near.sum() > 1000
    assert run["probability"][near, 0] == pytest.approx(expected[near], rel=1e-9)
    assert run["probability"][odds > 800, 1].tolist() == [0.0] * int((odds > 800).sum())
    assert run.end.log_probabilities[0] == pytest.approx(odds[-1], rel=1e-11)


def test_unreachable_mode_stays_at_zero_and_changes_no_bit() -> None:
    z, u = velocity_record(300, 150)
    closed = np.array([[0.9, 0.1, 0.0], [0.2, 0.8, 0.0], [0.3, 0.3, 0.4]])
    three = IMM(kalmans(VELOCITY), closed)
    two = IMM(kalmans(VELOCITY[:2]), closed[:2, :2])
    runs = [
        three.run(z, u, start=three.init(np.zeros(4), 1.0, probabilities=[0.5, 0.5, 0.0])),
        two.run(z, u, start=two.init(np.zeros(4), 1.0, probabilities=[0.5, 0.5])),
    ]
    assert not runs[0]["probability"][:, 2].any()
    assert np.array_equal(runs[0]["probability"][:, :2], runs[1]["probability"])
    assert np.array_equal(runs[0]["state"], runs[1]["state"])
    assert np.array_equal(runs[0]["covariance"], runs[1]["covariance"])
    assert np.isfinite(runs[0]["innovation"]).all()


def test_reachable_mode_recovers_from_zero_probability() -> None:
    run = scalar_run([[0.9, 0.1], [0.2, 0.8]], [1.0, 0.0], 3)
    assert run["probability"][:, 1] == pytest.approx([0.1, 0.17, 0.219], rel=1e-13)


# --- 50 digits ----------------------------------------------------------------------------------

LAWS = {
    "KF": [kalman_law] * 3,
    "SVSF": [switching_law(PSI, GAMMA)] * 3,
    "mixed": [kalman_law, switching_law(PSI, GAMMA), kalman_law],
}


def bank_of(kind: str, *, mixing: bool = True) -> IMM:
    filters: list[GaussianFilter] = [*(kalmans(MOTION) if kind != "SVSF" else svsfs(MOTION))]
    if kind == "mixed":
        filters[1] = svsfs(MOTION)[1]
    return IMM(filters, STICKY, mixing=mixing)


@pytest.mark.nightly_cases("mixed-mixing", "SVSF-mixing")
@pytest.mark.parametrize("mixing", [True, False], ids=["mixing", "apart"])
@pytest.mark.parametrize("kind", LAWS)
def test_three_models_with_three_outputs_agree_with_50_digits(kind: str, mixing: bool) -> None:
    z, u = motion_record(30)
    bank = bank_of(kind, mixing=mixing)
    run = run_over(bank, z, u, np.zeros(5), P0)
    expected = reference(MOTION, LAWS[kind], STICKY, np.zeros(5), P0, z, u, mixing=mixing)
    assert relative(run["state"], expected.estimate) < 1e-12
    assert relative(run["covariance"], expected.covariance) < 1e-12
    assert np.abs(run["probability"] / expected.probability - 1).max() < 1e-12
    logs = run.end.log_probabilities
    assert logs == pytest.approx(expected.log_probability[-1], rel=1e-12, abs=1e-13)
    # Modes were uncertain, and rows were inside and outside of the boundary layer.
    assert np.ptp(run["probability"], axis=0).min() > 0.1
    share = (np.abs(run["innovation"][:, 1]) > PSI).mean(axis=0)
    assert np.all((share > 0.05) & (share < 0.95))


# --- A bank of one, and bitwise identical loops --------------------------------------------------


@pytest.mark.parametrize("mixing", [True, False], ids=["mixing", "apart"])
@pytest.mark.parametrize("kind", ["KF", "SVSF"])
@pytest.mark.parametrize("before", [True, False], ids=["a period before", "at the first row"])
def test_bank_of_one_is_bitwise_identical_to_its_filter(
    kind: str, mixing: bool, before: bool
) -> None:
    z, u = motion_record(150)
    z[70:75] = np.nan
    one = bank_of(kind).filters[0]
    assert isinstance(one, GaussianFilter)
    bank = IMM([one], [[1.0]], mixing=mixing)
    held = u[0] if before else None
    run = bank.run(z, u, start=bank.init(np.zeros(5), P0, u=held))
    plain = one.run(z, u, start=one.init(np.zeros(5), P0, u=held))
    assert np.array_equal(run["state"], plain["state"])
    assert np.array_equal(np.diagonal(run["covariance"], axis1=1, axis2=2), plain["variance"])
    assert np.array_equal(run["innovation"][:, 0], plain["innovation"], equal_nan=True)
    assert np.array_equal(run.end.posteriors[0].covariance, plain.end.posterior.covariance)
    assert np.array_equal(run.end.posteriors[0].error, plain.end.posterior.error)
    assert np.all(run["probability"] == 1.0)
    assert np.array_equal(run["log_likelihood"], plain["log_likelihood"])
    assert np.array_equal(run.time, plain.time)
    assert run.missing == plain.missing == 5


@pytest.mark.parametrize("before", [True, False], ids=["a period before", "at the first row"])
@pytest.mark.parametrize("mixing", [True, False], ids=["mixing", "apart"])
@pytest.mark.parametrize("kind", LAWS)
def test_stepping_and_split_runs_are_bitwise_identical(
    kind: str, mixing: bool, before: bool
) -> None:
    z, u = motion_record(100)
    z[40, 1] = z[41] = np.nan
    bank = bank_of(kind, mixing=mixing)
    start = bank.init(np.zeros(5), P0, probabilities=[0.5, 0.3, 0.2], u=u[0] if before else None)
    run = bank.run(z, u, start=start)
    state, rows = start, []
    for measurement, control in zip(z, u, strict=True):
        state, estimate = bank.step(state, measurement, control)
        rows.append(estimate.estimates)
    stepped = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    assert same_bits({**stepped, **remembered(state)}, reported(run))
    for cut in (1, 42):  # after 42 the last measurement is missing
        first = bank.run(z[:cut], u[:cut], start=start)
        second = bank.run(z[cut:], u[cut:], start=first.end)
        assert same_bits(reported(first, second), reported(run))
        assert first.missing + second.missing == run.missing == 2
        assert np.array_equal(np.append(first.time, second.time), run.time)
    assert np.array_equal(start.posteriors[0].covariance, P0), "a state is a value"
    assert np.array_equal(np.exp(start.log_probabilities), [0.5, 0.3, 0.2])


@pytest.mark.parametrize("kind", LAWS)
def test_first_row_updates_probabilities_without_prediction(kind: str) -> None:
    z, u = motion_record(1)
    bank, mu = bank_of(kind), np.array([0.5, 0.3, 0.2])
    means = np.arange(15.0).reshape(3, 5) / 15
    run = bank.run(z, u, start=bank.init(means, P0, probabilities=mu))
    alone = [
        one.correct(Gaussian(mean, P0, np.zeros(3)), z[0], u[0])
        for one, mean in zip(bank.filters, means, strict=True)
    ]
    weights = mu * np.exp([each.log_likelihood for each in alone])
    assert run["log_likelihood"][0] == pytest.approx(np.log(weights.sum()), rel=1e-12)
    assert run["probability"][0] == pytest.approx(weights / weights.sum(), rel=1e-12)
    for posterior, each in zip(run.end.posteriors, alone, strict=True):
        assert np.array_equal(posterior.mean, each.posterior.mean)
    assert run["state"][0] == pytest.approx(
        weights @ [each.posterior.mean for each in alone] / weights.sum(), rel=1e-12
    )


@dataclass(frozen=True)
class UsersOwn:
    """The minimum interface that a bank needs of a filter."""

    inner: GaussianFilter

    @property
    def model(self) -> LinearModel:
        return self.inner.model

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        return self.inner.predict(posterior, u)

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        return self.inner.correct(posterior, y, u)


@pytest.mark.parametrize("mixing", [True, False], ids=["mixing", "apart"])
@pytest.mark.parametrize("kind", ["KF", "SVSF"])
def test_user_defined_filters_give_the_bits_of_the_compiled_loop(kind: str, mixing: bool) -> None:
    z, u = motion_record(60)
    z[20:22] = np.nan
    compiled = bank_of(kind, mixing=mixing)
    called = IMM([UsersOwn(one) for one in compiled.filters], STICKY, mixing=mixing)
    for held in (None, u[0]):
        start = compiled.init(np.zeros(5), P0, u=held)
        runs = [bank.run(z, u, start=start) for bank in (called, compiled)]
        assert same_bits(reported(runs[0]), reported(runs[1]))


def test_likely_svsf_in_a_kalman_bank_equals_the_single_filter() -> None:
    z, u = motion_record(40)
    bank = bank_of("mixed", mixing=False)
    run = bank.run(z, u, start=bank.init(np.zeros(5), P0))
    smooth = svsfs(MOTION)[1]
    alone = smooth.run(z, u, start=smooth.init(np.zeros(5), P0))
    assert np.array_equal(run["innovation"][:, 1], alone["innovation"])
    only = bank.init(np.zeros(5), P0, probabilities=[0.0, 1.0, 0.0])
    fixed = IMM(bank.filters, np.eye(3)).run(z, u, start=only)
    assert np.array_equal(fixed["state"], alone["state"])


# --- Coordinates --------------------------------------------------------------------------------

SHEARS = [
    np.eye(4),
    np.eye(4) + 0.4 * np.diag([1.0, -1.0, 0.5], -1) + 0.3 * np.eye(4, k=2),
    np.diag([0.7, 1.0, 1.5, 2.0]) + 0.5 * np.diag([0.6, 1.8, -0.4], 1) + 0.4 * np.eye(4, k=-2),
]
TURNS = [np.linalg.qr(shear)[0] for shear in SHEARS]


def in_coordinates(kind: str, transforms: Sequence[Array], *, mixing: bool) -> Run[ImmState]:
    z, u = velocity_record(200, 100)
    models = [moved(model, T) for model, T in zip(VELOCITY, transforms, strict=True)]
    filters = kalmans(models) if kind == "KF" else svsfs(models, 0.05)
    bank = IMM(filters, STICKY, mixing=mixing)
    P = [symmetric(0.1 * T @ T.T) for T in transforms]
    return run_over(bank, z, u, np.zeros(4), np.array(P))


def apart(kind: str, transforms: Sequence[Array], *, mixing: bool) -> float:
    plain = in_coordinates(kind, [np.eye(4)] * 3, mixing=mixing)
    other = in_coordinates(kind, transforms, mixing=mixing)
    return float(np.abs(other["probability"] - plain["probability"]).max())


def test_unmixed_kalman_bank_does_not_depend_on_coordinates() -> None:
    assert apart("KF", SHEARS, mixing=False) < 1e-10


def test_mixed_kalman_bank_depends_on_coordinates() -> None:
    assert apart("KF", SHEARS, mixing=True) > 0.1
    assert apart("KF", TURNS, mixing=True) > 0.1


def test_common_change_of_coordinates_does_not_matter() -> None:
    for T in SHEARS[1:]:
        assert apart("KF", [T] * 3, mixing=True) < 1e-10
    plain = in_coordinates("KF", [np.eye(4)] * 3, mixing=True)
    other = in_coordinates("KF", [SHEARS[1]] * 3, mixing=True)
    assert relative(other["state"], plain["state"] @ SHEARS[1].T) < 1e-10


def test_unmixed_svsf_bank_depends_on_coordinates() -> None:
    # The pseudo-inverse of H distributes a correction by the length of states: rotations preserve
    # it.
    assert apart("SVSF", TURNS, mixing=False) < 1e-10
    assert apart("SVSF", SHEARS, mixing=False) > 1e-2


# --- Missing measurements -----------------------------------------------------------------------


def test_probabilities_follow_the_chain_over_missing_measurements() -> None:
    z, u = motion_record(80)
    z[50:60] = np.nan
    z[70] = np.nan
    bank = bank_of("KF")
    start = bank.init(np.zeros(5), P0)
    run = bank.run(z, u, start=start)
    assert run.missing == 11
    for k in [*range(50, 60), 70]:
        expected = run["probability"][k - 1] @ STICKY
        assert run["probability"][k] == pytest.approx(expected, abs=1e-14)
        assert np.isnan(run["innovation"][k]).all()
        assert run["log_likelihood"][k] == 0.0
    assert np.isfinite(run["innovation"][[49, 60, 69, 71]]).all()
    before = bank.run(z[:50], u[:50], start=start)
    assert before.missing == 0
    errors = [posterior.error for posterior in before.end.posteriors]
    over = bank.run(z[50:60], u[50:60], start=before.end)
    assert np.array_equal([posterior.error for posterior in over.end.posteriors], errors)
    assert over.missing == 10


def test_unmixed_filters_only_predict_over_missing_measurements() -> None:
    z, u = motion_record(60)
    z[50:] = np.nan
    bank = bank_of("SVSF", mixing=False)
    start = bank.init(np.zeros(5), P0)
    run = bank.run(z, u, start=start)
    before = bank.run(z[:50], u[:50], start=start)
    for one, posterior, expected in zip(
        svsfs(MOTION), run.end.posteriors, before.end.posteriors, strict=True
    ):
        moving = expected
        for k in range(50, 60):
            moving = one.predict(moving, u[k - 1])
        assert np.array_equal(posterior.mean, moving.mean)
        assert np.array_equal(posterior.covariance, moving.covariance)


def test_mean_over_missing_measurements_is_the_mixture_prediction() -> None:
    # Mixing keeps the mean of the mixture: sum_j c_j x_0j = sum_i mu_i x_i.
    z, u = velocity_record(101, 101)
    z[100] = np.nan
    bank = IMM(kalmans([VELOCITY[0]] * 3), STICKY)
    run = bank.run(z, u, start=bank.init([[0.0] * 4, [1.0] * 4, [2.0] * 4], 1.0))
    A, B = VELOCITY[0].arrays.A, VELOCITY[0].arrays.B
    expected = A @ run["state"][99] + B @ u[99]
    assert run["state"][100] == pytest.approx(expected, rel=1e-12)
    spread = A @ run["covariance"][99] @ A.T + VELOCITY[0].arrays.Q
    assert run["covariance"][100] == pytest.approx(spread, rel=1e-11, abs=1e-15)


# --- Divergence ---------------------------------------------------------------------------------

GROWING = LinearModel(
    [[10.0, 0.0], [0.0, 0.5]], np.empty((2, 0)), [[0.0, 1.0]], Q=0.0, R=1.0, sampling_period=0.25
)


@pytest.mark.parametrize("taken", [True, False], ids=["measured", "missing"])
@pytest.mark.parametrize("own", [False, True], ids=["compiled", "one by one"])
def test_diverging_bank_reports_its_row(own: bool, taken: bool) -> None:
    # State 1 is unobservable and grows tenfold per sample: its variance overflows in row 154.
    smooth: Any = svsfs([GROWING] * 2, 1.0)
    filters = [UsersOwn(one) for one in smooth] if own else smooth
    bank = IMM(filters, [[0.9, 0.1], [0.1, 0.9]])
    start = bank.init([1.0, 1.0], 1.0, u=())
    z = np.full((400, 1), 0.3 if taken else np.nan)
    run = bank.run(z, start=start, on_divergence="return")
    assert run.diverged_at == 154 * GROWING.sampling_period
    assert len(run) == len(run["state"]) == len(run["covariance"]) == len(run["probability"]) == 154
    assert np.isfinite(run["covariance"]).all()
    assert run.missing == (0 if taken else 154)
    assert run.end is start
    with pytest.raises(DivergenceError, match=r"^IMM diverged: its state is finite up to t = 0 s"):
        bank.step(bank.init([1e308, 0.0], 1.0, u=()), [0.0])


def test_unreachable_mode_keeps_its_own_posterior() -> None:
    """Not even from itself: nothing is mixed into it, so it filters as if it were alone."""
    z = 3.0 + 2.0 * ripple(60)
    slow = LinearModel([[1.0]], np.empty((1, 0)), [[1.0]], Q=1e-3, R=4.0)
    bank = IMM(kalmans([CONSTANT, slow]), [[1.0, 0.0], [1.0, 0.0]])
    run = run_over(bank, z, None, [0.0], 1.0, [0.4, 0.6])
    alone = KalmanFilter(slow)
    expected = run_over(alone, z, None, [0.0], 1.0).end
    assert run["probability"][:, 1].tolist() == [0.0] * 60
    assert run.end.posteriors[1].mean == pytest.approx(expected.posterior.mean, rel=1e-13)
    covariance = expected.posterior.covariance
    assert run.end.posteriors[1].covariance == pytest.approx(covariance, rel=1e-13)


def test_components_of_augmented_filters_have_the_names_of_both() -> None:
    model = LinearModel(
        [[0.9, 0.1], [0.0, 0.8]], None, np.eye(2), None, Q=0.1, R=0.1,
        state_names=["a", "b"], output_names=["c", "d"],
    )  # fmt: skip
    one = AugmentedKalmanFilter(
        model, fault_matrix=[[1.0], [0.0]], random_walk=0.1, unknown_input_names=["force"]
    )
    bank = IMM([one, one], [[0.9, 0.1], [0.2, 0.8]])
    run = bank.run(np.ones((3, 2)), start=bank.init(np.zeros(3), 1.0))
    assert np.array_equal(run["state_force"], run["state"][:, 2])
    assert {"covariance_force_a", "innovation_2_d"} < set(run.to_pandas())

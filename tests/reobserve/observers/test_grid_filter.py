"""A grid over a parameter is Bayes' rule; one over a delay is a state with a buffer of inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from reobserve import IMM, GridFilter, KalmanFilter, LinearModel
from reobserve.core.errors import InputError
from reobserve.observers.grid_filter import node_chain

T = 0.1


def plant(rate: float = 1.0) -> LinearModel:
    return LinearModel.from_ode(
        [[0, 1], [-rate, -0.5]], [[0], [1]], [[1, 0]], Q=[1e-8, 1e-6], R=1e-4, sampling_period=T
    )


def record(rate: float = 1.3, rows: int = 150) -> tuple[np.ndarray, np.ndarray]:
    rng, one = np.random.default_rng(5), plant(rate)
    u, x, y = rng.standard_normal((rows, 1)), np.zeros(2), np.empty(rows)
    for k in range(rows):
        y[k] = x[0] + 0.01 * rng.standard_normal()
        x = one.A @ x + one.B @ u[k] + rng.multivariate_normal([0, 0], one.Q)
    return y, u


def test_constant_parameter_has_the_posterior_of_bayes() -> None:
    y, u = record()
    rates = np.linspace(0.5, 2.0, 31)
    grid = GridFilter.of_parameter(plant, grid=rates)
    run = grid.run(y, u, start=grid.init([0, 0], 0.01))
    logs = []
    for rate in rates:
        one = KalmanFilter(plant(rate))
        found = one.run(y, u, start=one.init([0, 0], 0.01))
        logs.append(np.cumsum(found["log_likelihood"]))
    posterior = np.exp(np.array(logs).T - np.max(logs, axis=0)[:, None])
    posterior /= posterior.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(run["probability"], posterior, rtol=1e-8, atol=1e-14)
    mean = posterior @ rates
    np.testing.assert_allclose(run["parameter"], mean, rtol=1e-9)
    np.testing.assert_allclose(
        run["parameter_variance"], posterior @ rates**2 - mean**2, rtol=1e-6, atol=1e-12
    )
    assert abs(mean[-1] - 1.3) < 3 * np.sqrt(run["parameter_variance"][-1]) < 0.2


def test_chain_of_the_nodes_has_the_motion_that_is_stated() -> None:
    nodes = np.array([0.0, 0.1, 0.25, 0.3, 0.5, 0.6, 0.7])
    chain = node_chain(nodes, 0.05**2, 0.0, 0.01)
    assert np.allclose(chain.sum(axis=1), 1.0)
    moved = chain @ nodes - nodes
    spread = chain @ nodes**2 - (chain @ nodes) ** 2
    inner = slice(2, 5)  # from where both ends are out of reach within 1e-8
    np.testing.assert_allclose(moved[inner], 0.0, atol=1e-9)
    np.testing.assert_allclose(spread[inner], 0.05**2 * 0.01, rtol=1e-6)
    jumps = node_chain(nodes, 0.0, 2.0, 0.01)
    # Off the diagonal all rates are alike, so that p_ii = 1/r + (1 - 1/r) exp(-r/(r-1) rate T).
    r = len(nodes)
    stay = 1 / r + (1 - 1 / r) * np.exp(-2.0 * 0.01 * r / (r - 1))
    np.testing.assert_allclose(np.diag(jumps), stay, rtol=1e-12)
    np.testing.assert_allclose(jumps[~np.eye(r, dtype=bool)], (1 - stay) / (r - 1), rtol=1e-12)


def test_chain_with_rates_moves_values_by_them() -> None:
    """Rows are (value, rate): means, switches and jumps in closed form; ends hold."""
    nodes, rates, T = np.linspace(0.0, 1.0, 11), np.array([-0.3, 0.0, 0.5]), 0.1
    chain = node_chain(nodes, 0.2**2, 0.0, T, rates, 0.4)
    assert np.allclose(chain.sum(axis=1), 1.0, rtol=1e-12)
    value, rate = (each.ravel() for each in np.meshgrid(nodes, rates, indexing="ij"))
    leave = -np.expm1(-0.4 * T)
    inner = (value > 0.35) & (value < 0.65)
    ahead = (1 - leave) * rate + leave / 2 * (rates.sum() - rate)
    np.testing.assert_allclose((chain @ value - value)[inner], T * ahead[inner], atol=1e-5)
    np.testing.assert_allclose(chain @ rate, ahead, atol=1e-12)
    # What lies between two nodes is shared by both: f (1 - f) h^2 beside the random walk.
    (still,) = np.flatnonzero((value == nodes[5]) & (rate == 0.5))
    alone = node_chain(nodes, 0.2**2, 0.0, T, [0.5])[5]
    assert alone @ nodes**2 - (alone @ nodes) ** 2 == pytest.approx(
        0.2**2 * T + 0.5 * T * (0.1 - 0.5 * T), rel=1e-4
    )
    assert chain[still, -1] < 1e-4
    jumps = node_chain(nodes, 0.0, 2.0, T, rates, 0.0)
    end = (value == 1.0) & (rate == 0.5)
    assert jumps[end][0, end] == pytest.approx(np.exp(-0.2) + (1 - np.exp(-0.2)) / 33)
    assert np.allclose(jumps[end][0, ~end], (1 - np.exp(-0.2)) / 33)


def test_mode_far_off_has_finite_likelihoods() -> None:
    y, u = record()
    still = GridFilter.of_parameter(plant, grid=np.linspace(0.5, 2.0, 31))
    far = replace(still.init([0, 0], 0.01), log_probabilities=np.append(np.full(30, -2000.0), 0.0))
    found = still.run(y[:2], u[:2], start=far)
    assert found["probability"][1].argmax() == 30
    assert np.isfinite(found["log_likelihood"]).all()


def test_rates_follow_a_ramp_with_a_third_of_the_lag() -> None:
    """The ramp is the gain of a lag; a random walk of that variance is behind it."""
    rng, rows = np.random.default_rng(3), 600
    u, gain = np.sign(np.sin(0.7 * np.arange(rows))), 0.5 + 0.0025 * np.arange(rows)
    y, x = np.empty(rows), 0.0
    for k in range(rows):
        y[k] = x + 0.1 * rng.standard_normal()
        x = 0.5 * x + gain[k] * u[k]

    def make(value: float) -> LinearModel:
        return LinearModel([[0.5]], [[value]], [[1]], Q=1e-8, R=0.01, sampling_period=T)

    errors = []
    for walk, rates in ((4e-4, [0.0]), (4e-6, [-0.025, 0.0, 0.025])):
        grid = GridFilter.of_parameter(
            make,
            grid=np.linspace(0, 2.5, 51),
            random_walk=walk,
            jump_rate=0.0,
            rates=rates,
            switch_rate=0.01,
        )
        run = grid.run(y, u, start=grid.init([0], 1e-4))
        errors.append((run["parameter"] - gain)[200:])
    behind, followed = errors
    assert behind.mean() < -0.02
    assert abs(followed.mean()) < 0.3 * abs(behind.mean())
    assert np.square(followed).mean() < 0.4 * np.square(behind).mean()


def test_delay_of_whole_periods_is_a_buffer_of_inputs_in_the_state() -> None:
    y, u = record()
    delays = [0.0, 0.1, 0.3]
    grid = GridFilter.of_delay(plant(1.3), delays=delays, random_walk=0.04, jump_rate=0.1)
    start = grid.init([0.1, 0], 0.01)
    run = grid.run(y, u, start=start)
    one, filters = plant(1.3), []
    for late in (0, 1, 3):
        # [x, u(k-1), u(k-2), u(k-3)]
        A, B = np.zeros((5, 5)), np.zeros((5, 1))
        A[:2, :2] = one.A
        A[3, 2] = A[4, 3] = B[2, 0] = 1.0
        if late:
            A[:2, 1 + late] = one.B[:, 0]
        else:
            B[:2] = one.B
        Q = np.zeros((5, 5))
        Q[:2, :2] = one.Q
        C = np.hstack([one.C, np.zeros((1, 3))])
        filters.append(
            KalmanFilter(LinearModel(A, B, C, None, Q=Q, R=one.R, sampling_period=T, check=False))
        )
    bank = IMM(filters, grid.transition)
    P = np.zeros((5, 5))
    P[:2, :2] = 0.01 * np.eye(2)
    expected = bank.run(y, u, start=bank.init([0.1, 0, *u[[0, 0, 0], 0]], P))
    np.testing.assert_allclose(run["state"], expected["state"][:, :2], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run["probability"], expected["probability"], rtol=1e-7, atol=1e-13)
    np.testing.assert_allclose(run["parameter"], run["probability"] @ delays, rtol=1e-12)
    state = start
    for k, row in enumerate(y):
        state, estimate = grid.step(state, row, u[k])
        for name in run:
            assert np.array_equal(estimate[name], run[name][k]), name
    halves = grid.run(y[:40], u[:40], start=start)
    rest = grid.run(y[40:], u[40:], start=halves.end)
    assert np.array_equal(rest["parameter"], run["parameter"][40:])


def test_delay_between_samples_is_the_solution_of_the_differential_equation() -> None:
    """With the true delay among the nodes, innovations without noise are zero."""
    late, rows = 0.237, 60
    u = np.random.default_rng(1).standard_normal((rows, 1))

    def held(t: float) -> float:
        return float(u[max(int(np.floor(t / T + 1e-9)), 0), 0])

    x, y = np.zeros(2), np.zeros(rows)
    for k in range(rows - 1):
        y[k] = x[0]
        for since, until in ((k * T, (k + 0.37) * T), ((k + 0.37) * T, (k + 1) * T)):
            value = held(0.5 * (since + until) - late)
            found = solve_ivp(
                lambda t, s, v=value: [s[1], -s[0] - 0.5 * s[1] + v], (since, until), x,
                rtol=1e-12, atol=1e-13,
            )  # fmt: skip
            x = found.y[:, -1]
    y[-1] = x[0]
    grid = GridFilter.of_delay(plant(1.0), delays=[0.1, late, 0.4])
    run = grid.run(y, u, start=grid.init([0, 0], 1e-8))
    assert np.abs(run["innovation"][:, 1]).max() < 1e-9
    assert run["parameter"][-1] == pytest.approx(late, abs=1e-6)


def test_grids_and_models_that_cannot_be_used_are_refused() -> None:
    discrete = LinearModel([[0.9]], [[1]], [[1]], Q=1e-4, R=1e-2, sampling_period=T)
    for call, message in (
        (
            lambda: GridFilter.of_parameter(plant, grid=[1.0]),
            "grid: .* must be two numbers or more",
        ),
        (lambda: GridFilter.of_parameter(plant, grid=[1.0, 0.5]), "rising"),
        (
            lambda: GridFilter.of_parameter(plant, grid=[1, 2], random_walk=-1.0),
            "random_walk: -1 must be 0 or more",
        ),
        (lambda: GridFilter.of_parameter(lambda v: v, grid=[1, 2]), r"make\(1\)"),  # type: ignore[arg-type, return-value]
        (
            lambda: GridFilter.of_parameter(plant, grid=[1, 2], rates=[]),
            "rates: .* one number or more",
        ),
        (lambda: GridFilter.of_parameter(plant, grid=[1, 2], rates=[1, 0]), "rates: .* rising"),
        (
            lambda: GridFilter.of_parameter(plant, grid=[1, 2], rates=[0, 1], switch_rate=-1.0),
            "switch_rate: -1 must be 0 or more",
        ),
        (lambda: GridFilter.of_delay(discrete, delays=[0.0, 0.15]), "0.15 s is no whole number of"),
        (lambda: GridFilter.of_delay(discrete, delays=[-0.1, 0.1]), "-0.1, 0.1. must be from 0 s"),
        (
            lambda: GridFilter.of_delay(discrete, delays=[0.0, 1e9]),
            "delays: .* must be from 0 s to 10000 s",
        ),
        (lambda: GridFilter.of_parameter(5, grid=[1, 2]), "make: 5 must be a function"),  # type: ignore[arg-type]
        (
            lambda: GridFilter.of_delay(LinearModel([[0.9]], C=[[1]], Q=1, R=1), delays=[0, 1]),
            "model: has no input",
        ),
    ):
        with pytest.raises(InputError, match=message):
            call()
    grid = GridFilter.of_delay(discrete, delays=[0.0, 0.1])
    for late in ([0], [0, -1], [0.0, 0.5], 3):
        with pytest.raises(InputError, match=r"periods_late: .* must be 2 whole numbers from 0"):
            GridFilter(grid.filters, grid.transition, grid=grid.grid, periods_late=late)  # type: ignore[arg-type]
    moving = GridFilter.of_parameter(plant, grid=[1.0, 2.0], random_walk=0.01)
    with pytest.raises(InputError, match="must go on by the sampling period"):
        moving.run([0.0, 0.0], [0, 0], start=moving.init([0, 0], 1.0), time=[0.0, 0.5])
    after = grid.run([0.0, 1.0], [0.0, 0.0], start=grid.init([0], 1.0)).end
    without = replace(after, past=None)
    with pytest.raises(InputError, match=r"start\.past: is missing"):
        grid.step(without, 0, 0)

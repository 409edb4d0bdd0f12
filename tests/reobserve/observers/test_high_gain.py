"""Gains against Lyapunov solvers and exact fractions; the standard observer; invalid input."""

from __future__ import annotations

import pickle
from fractions import Fraction
from math import comb
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov

from reobserve.core.errors import InputError
from reobserve.core.vector_field import vector_field
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.high_gain import HighGainObserver, HighGainState
from reobserve.synthesis.high_gain_design import high_gain, high_gain_over_time, lyapunov_matrix
from reobserve.systems.triangular import TriangularModel
from tests.reobserve.observers.small_plants import pendulum

Array = NDArray[np.float64]

SIZES = range(1, 8)


def shift(size: int) -> Array:
    return np.eye(size, k=1)


def first(size: int) -> Array:
    return np.eye(size)[:1]


# --- The algebraic equation ---------------------------------------------------------------------


def solved(rows: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Gauss-Jordan elimination in fractions."""
    n = len(rows)
    work = [[*row, value] for row, value in zip(rows, right, strict=True)]
    for k in range(n):
        pivot = next(i for i in range(k, n) if work[i][k] != 0)
        work[k], work[pivot] = work[pivot], work[k]
        work[k] = [entry / work[k][k] for entry in work[k]]
        for i in range(n):
            if i != k:
                factor = work[i][k]
                work[i] = [a - factor * b for a, b in zip(work[i], work[k], strict=True)]
    return [row[n] for row in work]


@pytest.mark.parametrize("size", SIZES)
def test_closed_forms_are_exact(size: int) -> None:
    for rho in (Fraction(5), Fraction(5, 2), Fraction(7, 3)):
        # The equation entry by entry: (A^T S + S A)_ij = S_(i-1)j + S_i(j-1). It has one solution,
        # found here in the order of i + j.
        S: dict[tuple[int, int], Fraction] = {}
        for i, j in sorted(np.ndindex(size, size), key=sum):
            above, left = S.get((i - 1, j), Fraction(0)), S.get((i, j - 1), Fraction(0))
            S[i, j] = (Fraction(i == j == 0) - above - left) / rho
            assert S[i, j] == (-1) ** (i + j) * comb(i + j, i) / rho ** (i + j + 1)
        rows = [[S[i, j] for j in range(size)] for i in range(size)]
        gain = solved(rows, [Fraction(i == 0) for i in range(size)])
        assert gain == [comb(size, i) * rho**i for i in range(1, size + 1)]
        found = lyapunov_matrix(size, float(rho))
        assert found == pytest.approx(np.array(rows, dtype=float), rel=1e-14, abs=0)
        assert high_gain(size, float(rho)) == pytest.approx(
            np.array(gain, dtype=float), rel=1e-14, abs=0
        )


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("rho", [0.7, 2.5, 5.0])
def test_matrix_agrees_with_a_lyapunov_solver(size: int, rho: float) -> None:
    A, C = shift(size), first(size)
    half = A + 0.5 * rho * np.eye(size)
    reference = solve_continuous_lyapunov(half.T, C.T @ C)
    S = lyapunov_matrix(size, rho)
    assert pytest.approx(reference, rel=1e-9) == S
    assert np.array_equal(S, S.T)
    np.linalg.cholesky(S)
    assert np.linalg.solve(S, C[0]) == pytest.approx(high_gain(size, rho), rel=1e-6)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("rho", [0.5, 2.5, 5.0])
def test_all_eigenvalues_are_minus_rho(size: int, rho: float) -> None:
    closed = shift(size) - np.outer(high_gain(size, rho), first(size))
    # N equal eigenvalues of one block move by eps^(1/N): check also the characteristic polynomial
    # (s + rho)^N, and that the matrix satisfies it.
    eigenvalues = np.linalg.eigvals(closed)
    assert eigenvalues == pytest.approx(-rho, rel=10 * np.finfo(float).eps ** (1 / size))
    power = np.linalg.matrix_power(closed / rho + np.eye(size), size)
    scale = rho ** np.arange(size)
    assert power * scale / scale[:, None] == pytest.approx(0.0, abs=1e-9)
    assert np.poly(eigenvalues) == pytest.approx(
        [comb(size, i) * rho**i for i in range(size + 1)], rel=1e-10
    )


def test_gains_agree_with_the_paper() -> None:
    assert np.array_equal(high_gain(2, 5.0), [10.0, 25.0])
    assert np.array_equal(high_gain(3, 5.0), [15.0, 75.0, 125.0])
    assert np.array_equal(high_gain(3, 2.5), [7.5, 18.75, 15.625])


# --- The dynamic equation -----------------------------------------------------------------------


def integrated(size: int, rho: float, initial: Array, times: Array) -> Array:
    """S at the times, by a Runge-Kutta method of order 8."""
    A, C = shift(size), first(size)

    def rate(_: float, flat: Array) -> Array:
        S = flat.reshape(size, size)
        return (-rho * S - A.T @ S - S @ A + C.T @ C).ravel()

    span = (0, times[-1])
    flat = solve_ivp(rate, span, initial.ravel(), "DOP853", times, rtol=1e-13, atol=1e-16).y
    return np.array(flat.T.reshape(-1, size, size))


@pytest.mark.parametrize("size", SIZES)
def test_time_varying_gains_agree_with_an_integration(size: int) -> None:
    root = np.random.default_rng(size).normal(size=(size, size))
    times = np.array([0.0, 0.05, 0.3, 1.0, 2.0, 4.0])
    for rho, initial in ((2.0, np.eye(size)), (0.8, root + root.T + 4 * size * np.eye(size))):
        found = high_gain_over_time(size, rho, initial, times)
        S = integrated(size, rho, initial, times)
        if size <= 4:
            expected = [np.linalg.solve(matrix, first(size)[0]) for matrix in S]
            assert found == pytest.approx(np.array(expected), rel=1e-9)
        # S is ill-conditioned for its size: the residual of S k = C^T must be small.
        residual = np.einsum("tij,tj->ti", S, found) - first(size)
        terms = np.einsum("tij,tj->ti", np.abs(S), np.abs(found))
        assert np.all(np.abs(residual) < 1e-12 * terms.max(axis=1, keepdims=True))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("rho", [0.5, 5.0, 40.0])
def test_time_varying_gains_start_at_the_matrix_and_end_at_the_constant_gain(
    size: int, rho: float
) -> None:
    initial = np.diag(np.arange(2.0, size + 2)) + 0.1
    start, end = high_gain_over_time(size, rho, initial, [0.0, 200 / rho])
    assert start == pytest.approx(np.linalg.solve(initial, first(size)[0]), rel=1e-11)
    assert end == pytest.approx(high_gain(size, rho), rel=1e-8)
    # From the stationary S nothing changes.
    still = high_gain_over_time(size, rho, lyapunov_matrix(size, rho), np.linspace(0, 9 / rho, 7))
    assert still == pytest.approx(np.tile(high_gain(size, rho), (7, 1)), rel=1e-7)


def test_time_varying_gains_from_the_identity_agree_with_the_paper() -> None:
    gains = high_gain_over_time(3, 5.0, 1.0, [0.0, 3.0, 4.0])
    assert np.array_equal(gains[0], [1.0, 0.0, 0.0])
    assert gains[1] == pytest.approx([14.942, 74.381, 123.354], abs=1e-3)
    assert np.abs(gains[2] / high_gain(3, 5.0) - 1).max() < 3e-4


def test_gain_at_a_time_does_not_depend_on_other_times() -> None:
    times = np.linspace(0, 5, 101)
    whole = high_gain_over_time(3, 5.0, 1.0, times)
    for k in (0, 17, 99):
        assert np.array_equal(high_gain_over_time(3, 5.0, 1.0, times[k : k + 2]), whole[k : k + 2])
    assert high_gain_over_time(2, 1.0, 1.0, []).shape == (0, 2)


# --- The observer -------------------------------------------------------------------------------


def pendulum_drift(x: Any, p: Any, out: Any) -> None:
    out[0] = 0.0
    out[1] = -p[0] * np.sin(x[0]) - p[1] * x[1]


def chain_drift(x: Any, p: Any, out: Any) -> None:
    out[0] = -p[0] * x[0]
    out[1] = np.sin(x[0]) - 0.2 * x[1]
    out[2] = -x[0] * x[1] * 0.3 - np.tanh(x[2])


def lag_drift(x: Any, p: Any, out: Any) -> None:
    out[0] = -p[0] * x[0]


def no_drift(x: Any, p: Any, out: Any) -> None:
    for i in range(len(x)):
        out[i] = 0.0


def constant_gain(y: Any, p: Any, out: Any) -> None:
    out[0] = p[len(p) - 1]


def output_gain(y: Any, p: Any, out: Any) -> None:
    out[0] = 1.0 + 0.5 * np.cos(y[0])


def model(states: int, drift: Any, gain: Any, *parameters: float) -> TriangularModel:
    return TriangularModel(states, vector_field(drift), vector_field(gain), np.array(parameters))


DRIFTS = {1: lag_drift, 2: pendulum_drift, 3: chain_drift}
GAINS = {1: constant_gain, 2: constant_gain, 3: output_gain}
MODELS = {
    1: model(1, lag_drift, constant_gain, 1.0, 1.0),
    2: model(2, pendulum_drift, constant_gain, 19.62, 1.5, 20.0),
    3: model(3, chain_drift, output_gain, 0.7),
}
each_size = pytest.mark.parametrize("n", MODELS)


def y_of(time: Any, late: bool) -> Any:
    return np.sin(1.3 * time) + (0.4 * np.cos(time) if late else 0.0)


def u_of(time: Any, late: bool) -> Any:
    return 0.3 * time + (-0.5 if late else 0.2 * np.sin(2 * time))


def reference(n: int, rho: float, start: Array, jump: float, end: float) -> Array:
    """The observer at ``end`` by a Runge-Kutta method of order 8, piece by piece."""
    gain, out, driven = high_gain(n, rho), np.empty(n), np.empty(1)
    parameters = MODELS[n].parameters
    x = start
    for begin, until, late in ((0.0, jump, False), (jump, end, True)):

        def rate(time: float, x: Array, late: bool = late) -> Array:
            y = y_of(time, late)
            DRIFTS[n](x, parameters, out)
            GAINS[n]([y], parameters, driven)
            slope = shift(n) @ x + out - gain * (x[0] - y)
            slope[-1] += driven[0] * u_of(time, late)
            return slope

        x = solve_ivp(rate, (begin, until), x, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return np.asarray(x)


@each_size
def test_order_is_four_also_at_jumps_of_the_record(n: int) -> None:
    rho, jump, end = 3.0, 1.0, 2.0
    start = np.linspace(0.5, -0.5, n)
    expected = reference(n, rho, start, jump, end)
    steps, errors, without = [0.05, 0.025, 0.0125, 0.00625], [], []
    for step in steps:
        time = np.arange(round(2 * end / step) + 1) * step / 2
        late, late_before = time > jump - 1e-9, time > jump + 1e-9
        right = [np.where(late, f(time, True), f(time, False)) for f in (y_of, u_of)]
        left = [np.where(late_before, f(time, True), f(time, False)) for f in (y_of, u_of)]
        observer = HighGainObserver(MODELS[n], rho=rho, sampling_period=step)
        begun = observer.init(start)
        run = run_on_halves(
            observer, right[0], right[1], start=begun, y_before=left[0], u_before=left[1]
        )
        errors.append(np.abs(run["state"][-1] - expected).max())
        run = run_on_halves(observer, right[0], right[1], start=begun)
        without.append(np.abs(run["state"][-1] - expected).max())
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(4.0, abs=0.15)
    assert errors[-1] < 1e-7
    assert np.polyfit(np.log(steps), np.log(without), 1)[0] == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_error_of_an_integrator_chain_follows_its_matrix(n: int) -> None:
    # x_n' = 6 t - 3, the states above are its integrals; the observer is given the true delay.
    rho, step, end = 2.0, 0.005, 3.0
    observer = HighGainObserver(
        model(n, no_drift, constant_gain, 1.0), rho=rho, sampling_period=step
    )
    time = np.arange(round(2 * end / step) + 1) * step / 2
    last = np.polynomial.Polynomial([1.0, -3.0, 3.0])
    truth = np.stack([last.integ(n - 1 - i)(time) for i in range(n)], axis=1)
    offset = np.linspace(1.0, 2.0, n)
    start = observer.init(truth[0] + offset)
    run = run_on_halves(observer, truth[:, 0], last.deriv()(time), start=start)
    closed = shift(n) - np.outer(high_gain(n, rho), first(n))
    for k in (100, 300, 600):
        expected = expm(closed * k * step) @ offset
        assert run["state"][k] - truth[2 * k] == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_wrong_delay_on_a_ramp_leaves_the_predicted_error(n: int) -> None:
    # The error obeys e' = (A - S^-1 C^T C) e + (0, .., 0, slope (tau - tau_m)): at rest the i-th
    # entry is binom(n, i-1) / rho^(n+1-i) times that.
    rho, step, slope, delay, assumed = 5.0, 0.0025, 0.9, 0.6, 0.8
    observer = HighGainObserver(
        model(n, no_drift, constant_gain, 1.0), rho=rho, sampling_period=step
    )
    time = np.arange(8001) * step / 2
    last = np.polynomial.Polynomial([0.0, -slope * delay, slope / 2])
    truth = np.stack([last.integ(n - 1 - i)(time) for i in range(n)], axis=1)
    known = slope * (time - assumed)
    run = run_on_halves(observer, truth[:, 0], known, start=observer.init(truth[0]))
    at_rest = [comb(n, i) / rho ** (n - i) for i in range(n)]
    expected = slope * (delay - assumed) * np.array(at_rest)
    assert run["state"][-1] - truth[-1] == pytest.approx(expected, rel=1e-5)


# --- Divergence and bad input -------------------------------------------------------------------


def test_steps_below_the_limit_stay_stable() -> None:
    record = np.zeros(1001)
    sizes = []
    for product in (2.7, 2.85):
        observer = HighGainObserver(
            model(2, no_drift, constant_gain, 1.0), rho=10.0, sampling_period=product / 10
        )
        run = observer.run(record, record, start=observer.init([1.0, 0.0]))
        sizes.append(np.abs(run["state"][-1]))
    assert sizes[0].max() < 1e-6
    assert sizes[1].max() > 1e3


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rho": 0.0}, "rho: 0 must be greater than zero"),
        ({"rho": -5}, "rho: -5 must be greater than zero"),
        ({"rho": float("inf")}, "rho: inf has an entry that is not finite"),
        ({"rho": [1.0, 2.0]}, r"rho: .* must be one number, not an array of shape \(2,\)"),
        ({"rho": 1e200}, "rho: 1e.200 1/s must keep S and the gains inside the float range"),
        ({"sampling_period": 0.0}, "sampling_period: 0 must be greater than zero"),
    ],
)
def test_wrong_parameters_of_the_observer_are_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        HighGainObserver(**{"model": MODELS[2], "rho": 5.0, "sampling_period": 0.01, **changed})


def test_observer_can_be_pickled_if_its_functions_are_importable() -> None:
    observer, y = (
        HighGainObserver(pendulum(), rho=5.0, sampling_period=0.01),
        np.linspace(0, 1, 9),
    )
    again = pickle.loads(pickle.dumps(observer))
    start = observer.init([0.1, 0.0])
    assert np.array_equal(again.run(y, y, start=start)["state"],
                          observer.run(y, y, start=start)["state"])  # fmt: skip
    with pytest.raises(pickle.PicklingError, match="field pendulum_drift stands nowhere"):
        pickle.dumps(HighGainObserver(MODELS[2], rho=5.0, sampling_period=0.01))


def test_wrong_states_are_refused() -> None:
    observer = HighGainObserver(MODELS[2], rho=5.0, sampling_period=0.01)
    with pytest.raises(InputError, match=r"^state: has shape \(3,\)"):
        observer.init([0.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"^start: must be of an observer of 2 states$"):
        observer.run(np.zeros(3), np.zeros(3), start=HighGainState(np.zeros(3)))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: high_gain(0, 1.0), "size: 0 must be a whole number, from 1 to 500"),
        (lambda: high_gain(2.0, 1.0), "size: 2.0 must be a whole number, from 1 to 500"),
        (lambda: high_gain(2, -1.0), "rho: -1 must be greater than zero"),
        (lambda: lyapunov_matrix(3, 0.0), "rho: 0 must be greater than zero"),
        (
            lambda: lyapunov_matrix(3, 1e-80),
            "rho: 1e-80 1/s must keep S and the gains inside the float range",
        ),
        (lambda: high_gain_over_time(3, 0.0, 1.0, [0.0]), "rho: 0 must be greater than zero"),
        (
            lambda: high_gain_over_time(2, 1.0, [[1.0, 0.5], [0.4, 1.0]], [0.0]),
            "initial: .* must be symmetric",
        ),
        (
            lambda: high_gain_over_time(2, 1.0, [[1.0, 2.0], [2.0, 1.0]], [0.0]),
            "initial: must be positive definite, its eigenvalues are -1, 3",
        ),
        (
            lambda: high_gain_over_time(2, 1.0, np.eye(3), [0.0]),
            r"initial: has shape \(3, 3\), must be .* or a 2 x 2 matrix",
        ),
        (
            lambda: high_gain_over_time(2, 1.0, 1.0, [1.0, -0.5]),
            "times: -0.5 s must not be before the start at 0 s",
        ),
        (
            lambda: high_gain_over_time(2, 1.0, 1.0, [[1.0]]),
            r"times: has shape \(1, 1\), must be a list of times",
        ),
    ],
)
def test_wrong_parameters_of_the_gains_are_refused(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        call()

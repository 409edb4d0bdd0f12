"""The differentiator: predicted accuracy, scaling, the printed form, and invalid input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError
from reobserve.observers.levant import LevantDifferentiator, LevantState

Array = NDArray[np.float64]

PAPER: dict[str, Any] = {"order": 2, "lambdas": (3.0, 1.5, 1.0)}
L = 0.11  # of the paper


def waves(time: Array, order: int) -> Array:
    """sin t + 0.3 cos 0.7 t and its derivatives; each is within 1.3."""
    quarter = np.arange(order + 1) * np.pi / 2
    t = time[:, None]
    return np.sin(t + quarter) + 0.3 * 0.7 ** np.arange(order + 1) * np.cos(0.7 * t + quarter)


def paper_input(time: Array) -> Array:
    """sin 0.2 t and two derivatives."""
    quarter = np.arange(3) * np.pi / 2
    return 0.2 ** np.arange(3) * np.sin(0.2 * time[:, None] + quarter)


def errors(
    differentiator: LevantDifferentiator, truth: Array, noise: Any = 0.0, start: Any = None
) -> Array:
    first = zeros(differentiator) if start is None else differentiator.init(start)
    run = differentiator.run(truth[:, 0] + noise, start=first)
    assert run.diverged_at is None
    return run["derivatives"] - truth


def zeros(differentiator: LevantDifferentiator) -> LevantState:
    return differentiator.init(np.zeros(differentiator.order + 1))


def slopes(x: Any, y: Any) -> Array:
    """Log-log slopes of the columns of y."""
    return np.polyfit(np.log(x), np.log(y), 1)[0]


# --- One sample at a time -----------------------------------------------------------------------


def test_one_step_agrees_with_hand_calculation() -> None:
    # u = 0, z = (8, 3, 5), L = 8, T = 1/2: the injections are 3*2*4 = 24, 1.5 * sqrt(8 * 24), 8.
    differentiator = LevantDifferentiator(L=8.0, **PAPER, sampling_period=0.5)
    run = differentiator.run([0.0, 7.0], start=differentiator.init([8.0, 3.0, 5.0]))
    second = 1.5 * np.sqrt(8 * 24.0)
    expected = [8 + 0.5 * (3 - 24) + 0.125 * 5, 3 + 0.5 * (5 - second), 5 - 0.5 * 8]
    assert run["derivatives"][1] == pytest.approx(expected, rel=1e-14)
    assert np.array_equal(run["derivatives"][0], [8.0, 3.0, 5.0])


def test_run_without_a_state_starts_from_the_first_sample() -> None:
    differentiator, samples = (
        LevantDifferentiator(L=1.0, sampling_period=0.1),
        np.array([3.0, 1.0, 2.0]),
    )
    known = differentiator.run(samples, start=differentiator.init([3.0, 0.0, 0.0]))
    assert np.array_equal(differentiator.run(samples)["derivatives"], known["derivatives"])


def test_estimate_depends_only_on_earlier_samples() -> None:
    differentiator = LevantDifferentiator(L=1.0, sampling_period=0.1)
    one, other = np.zeros(9), np.zeros(9)
    other[5] = 1.0
    start = zeros(differentiator)
    runs = [differentiator.run(u, start=start)["derivatives"] for u in (one, other)]
    assert np.array_equal(runs[0][:6], runs[1][:6])
    assert not np.array_equal(runs[0][6], runs[1][6])


# --- Accuracy without noise ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "coefficients"), [(1, [3.0, -2.0]), (2, [1.0, 4.0, -6.0]), (2, [7.0, 0.0, 2.0])]
)
def test_polynomial_is_tracked_to_the_last_bit(order: int, coefficients: list[float]) -> None:
    # Every number here is a short binary fraction, so the arithmetic is exact.
    time = np.arange(400) / 64
    polynomial = np.polynomial.Polynomial(coefficients)
    truth = np.stack([polynomial.deriv(i)(time) for i in range(order + 1)], axis=1)
    differentiator = LevantDifferentiator(L=4.0, order=order, sampling_period=1 / 64)
    assert not errors(differentiator, truth, start=truth[0]).any()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_polynomials_with_bounded_next_derivative_are_tracked(order: int) -> None:
    # The highest derivative uses the whole bound L: t^(n+1) L / (n+1)!, and lower terms.
    # The period is long enough for the predicted errors to be far above the rounding of u.
    bound, period = 2.0, 1e-2
    time = np.arange(0, 30, period)
    coefficients = [1.0, -0.5, 0.3, -0.2][: order + 1]
    top = bound / np.prod(np.arange(1, order + 2))
    polynomial = np.polynomial.Polynomial([*coefficients, top])
    truth = np.stack([polynomial.deriv(i)(time) for i in range(order + 1)], axis=1)
    found = errors(LevantDifferentiator(L=bound, order=order, sampling_period=period), truth)
    late = np.abs(found[time > 25]).max(axis=0)
    theory = bound * period ** (order + 1 - np.arange(order + 1))
    assert np.all(late < 30 * theory)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_errors_fall_with_the_period_as_predicted(order: int) -> None:
    bound = 1.5
    periods = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    worst = []
    for period in periods:
        time = np.arange(0, 30, period)
        found = errors(
            LevantDifferentiator(L=bound, order=order, sampling_period=period), waves(time, order)
        )
        worst.append(np.abs(found[time > 20]).max(axis=0))
    expected = order + 1 - np.arange(order + 1)
    assert slopes(periods, worst) == pytest.approx(expected, abs=0.06)
    # The constants: within 6 for the paper's order, 16 for one more.
    scaled = worst / (bound * periods[:, None] ** expected)
    assert scaled.max() < {1: 4.5, 2: 9.5, 3: 16.0}[order]


def plain_euler(samples: Array, period: float) -> Array:
    """The paper's differentiator with Euler's rule throughout."""
    lambdas, rows, z = (3.0, 1.5, 1.0), [], np.zeros(3)
    for u in samples:
        rows.append(z)
        first = z[1] - lambdas[0] * np.cbrt(L) * abs(z[0] - u) ** (2 / 3) * np.sign(z[0] - u)
        gap = z[1] - first
        second = z[2] - lambdas[1] * np.sqrt(L) * np.sqrt(abs(gap)) * np.sign(gap)
        third = -lambdas[2] * L * np.sign(z[2] - second)
        z = z + period * np.array([first, second, third])
    return np.array(rows)


def test_exact_integration_of_the_chain_is_needed_for_the_order() -> None:
    periods = np.array([8e-3, 4e-3, 2e-3])
    plain, homogeneous = [], []
    for period in periods:
        time = np.arange(0, 40, period)
        truth = paper_input(time)
        late = time > 10
        found = plain_euler(truth[:, 0], period) - truth
        plain.append(np.abs(found[late]).max(axis=0))
        found = errors(LevantDifferentiator(L=L, **PAPER, sampling_period=period), truth)
        homogeneous.append(np.abs(found[late]).max(axis=0))
    assert slopes(periods, plain) == pytest.approx([3, 1, 1], abs=0.1)
    assert slopes(periods, homogeneous) == pytest.approx([3, 2, 1], abs=0.1)
    # Euler's z1 is the forward difference quotient of u: off by T/2 u''.
    assert plain[-1][1] == pytest.approx(periods[-1] / 2 * 0.04, rel=0.06)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_convergence_time_does_not_depend_on_the_period(order: int) -> None:
    settled = []
    for period in (2e-3, 1e-3, 5e-4):
        time = np.arange(0, 30, period)
        found = np.abs(
            errors(
                LevantDifferentiator(L=1.5, order=order, sampling_period=period), waves(time, order)
            )
        )
        level = 2 * found[time > 20].max(axis=0)
        assert np.all(found[0, 1:3] > level[1:3])
        settled.append(time[np.nonzero((found > level).any(axis=1))[0][-1]])
    assert max(settled) < 12
    assert np.ptp(settled) < 0.1


# --- Homogeneity --------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2, 3])
def test_scaling_the_signal_and_its_bound_scales_the_estimate(order: int) -> None:
    period, factor = 1e-3, 37.0
    time = np.arange(0, 20, period)
    truth = waves(time, order)
    one = LevantDifferentiator(L=1.5, order=order, sampling_period=period)
    other = LevantDifferentiator(L=factor * 1.5, order=order, sampling_period=period)
    run = one.run(truth[:, 0], start=zeros(one))["derivatives"]
    scaled = other.run(factor * truth[:, 0], start=zeros(other))["derivatives"] / factor
    # Equal up to rounding, until it decides a sign in the sliding mode.
    assert scaled[:500] == pytest.approx(run[:500], rel=1e-9, abs=1e-12)
    theory = 1.5 * period ** (order + 1 - np.arange(order + 1))
    assert np.all(np.abs(scaled - run)[time > 12] < 30 * theory)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_stretching_time_scales_each_derivative_by_its_power(order: int) -> None:
    period, factor = 1e-3, 2.5
    powers = factor ** (order + 1.0 - np.arange(order + 1))
    truth = waves(np.arange(0, 5, period), order)
    noise = np.random.default_rng(4).uniform(-0.1, 0.1, len(truth))
    one = LevantDifferentiator(L=1.5, order=order, sampling_period=period)
    other = LevantDifferentiator(L=1.5, order=order, sampling_period=factor * period)
    run = one.run(truth[:, 0] + noise, start=zeros(one))["derivatives"]
    measured = (truth[:, 0] + noise) * powers[0]
    slow = other.run(measured, start=zeros(other))["derivatives"]
    assert slow / powers == pytest.approx(run, rel=1e-8, abs=1e-9)


# --- Noise --------------------------------------------------------------------------------------


def noises(kind: str, size: float, bound: float, order: int, time: Array) -> Array:
    """Noise within ``size``, at the time scale of largest effect.

    The sine is itself a signal whose derivative of order n + 1 is within the bound: no
    differentiator can tell it from u.
    """
    scale = (size / bound) ** (1 / (order + 1))
    if kind == "sine":
        return size * np.sin(time / scale)
    rng = np.random.default_rng(7)
    if kind == "white":
        return rng.uniform(-size, size, len(time))
    held = max(1, round(0.5 * scale / time[1]))
    return np.repeat(rng.uniform(-size, size, len(time) // held + 1), held)[: len(time)]


@pytest.mark.parametrize("kind", ["held", "sine", "white"])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_errors_grow_with_the_noise_as_predicted(order: int, kind: str) -> None:
    bound, period = 1.5, 2e-4
    time = np.arange(0, 25, period)
    truth = waves(time, order)
    sizes = np.geomspace(1e-4, 1e-2, 5)
    worst = []
    for size in sizes:
        noise = noises(kind, size, bound, order, time)
        found = errors(
            LevantDifferentiator(L=bound, order=order, sampling_period=period),
            truth,
            noise,
            truth[0],
        )
        worst.append(np.abs(found[time > 8]).max(axis=0))
    share = np.arange(order + 1) / (order + 1)
    assert slopes(sizes, worst) == pytest.approx(1 - share, abs=0.06)
    scaled = worst / (bound**share * sizes[:, None] ** (1 - share))
    assert scaled.max() < 5
    if kind == "sine":  # no differentiator can do better than 1
        assert scaled.min() > 0.95


@pytest.mark.parametrize("order", [1, 2, 3])
def test_noise_errors_grow_with_the_bound_as_predicted(order: int) -> None:
    size, period = 1e-3, 2e-4
    time = np.arange(0, 25, period)
    truth = waves(time, order)
    bounds = np.array([2.0, 4.0, 8.0, 16.0])
    worst = []
    for bound in bounds:
        noise = noises("sine", size, bound, order, time)
        found = errors(
            LevantDifferentiator(L=bound, order=order, sampling_period=period),
            truth,
            noise,
            truth[0],
        )
        worst.append(np.abs(found[time > 8]).max(axis=0))
    assert slopes(bounds, worst) == pytest.approx(np.arange(order + 1) / (order + 1), abs=0.06)


# --- The paper's parameters ---------------------------------------------------------------------


@pytest.mark.parametrize("period", [1e-2, 1e-3, 1e-4])
def test_printed_last_line_fails_and_the_one_with_L_works(period: float) -> None:
    time = np.arange(0, 120, period)
    truth = paper_input(time)
    late = time >= 5
    signal, printed, corrected = (
        np.sqrt(np.mean(values[late] ** 2, axis=0))
        for values in (
            truth,
            errors(LevantDifferentiator(L=L, **PAPER, printed=True, sampling_period=period), truth),
            errors(LevantDifferentiator(L=L, **PAPER, sampling_period=period), truth),
        )
    )
    assert signal[1] == pytest.approx(0.2 / np.sqrt(2), rel=0.02)
    # The error of u' is 8 to 11 times the signal, and that of u'' some 30 times.
    assert printed[1] > 7.5 * signal[1]
    assert printed[2] > 25 * signal[2]
    if period < 1e-2:
        assert printed[1] == pytest.approx(1.14, abs=0.05)
    assert corrected[1:] == pytest.approx([0.1166 * period**2, 0.0842 * period], rel=0.03)


def test_printed_form_is_correct_for_a_bound_of_one() -> None:
    samples = np.random.default_rng(1).normal(size=50)
    runs = []
    for printed in (False, True):
        differentiator = LevantDifferentiator(L=1.0, **PAPER, printed=printed, sampling_period=0.01)
        runs.append(differentiator.run(samples, start=zeros(differentiator))["derivatives"])
    assert np.array_equal(*runs)


def test_standard_lambdas_are_used() -> None:
    assert np.array_equal(
        LevantDifferentiator(L=1.0, order=1, sampling_period=0.1).lambdas, [1.5, 1.1]
    )
    assert np.array_equal(LevantDifferentiator(L=1.0, sampling_period=0.1).lambdas, [2.0, 1.5, 1.1])
    assert np.array_equal(
        LevantDifferentiator(L=1.0, order=5, sampling_period=0.1).lambdas, [8, 5, 3, 2, 1.5, 1.1]
    )
    given = LevantDifferentiator(L=1.0, order=6, lambdas=np.arange(1, 8), sampling_period=0.1)
    assert np.array_equal(given.lambdas, np.arange(1, 8))


@pytest.mark.parametrize("order", [4, 5])
def test_standard_lambdas_work_for_high_orders(order: int) -> None:
    period = 5e-3
    time = np.arange(0, 40, period)
    found = errors(
        LevantDifferentiator(L=1.5, order=order, sampling_period=period), waves(time, order)
    )
    theory = 1.5 * period ** (order + 1 - np.arange(order + 1))
    assert np.all(np.abs(found[time > 30]).max(axis=0) < {4: 100, 5: 4000}[order] * theory)


# --- Divergence and bad input -------------------------------------------------------------------


def test_overflow_is_reported_with_time_and_finite_rows() -> None:
    differentiator = LevantDifferentiator(
        L=1e200, order=1, lambdas=(1.0, 1.0), sampling_period=1e60
    )
    start = differentiator.init([1e300, 0.0])
    run = differentiator.run(np.zeros(9), start=start, on_divergence="return")
    rows = len(run)
    assert 1 <= rows < 9
    assert np.isfinite(run["derivatives"]).all()
    assert run.diverged_at == pytest.approx((rows - 1) * 1e60)
    assert run.end is start
    assert differentiator.run(np.zeros(rows), start=start).diverged_at is None
    said = r"^LevantDifferentiator diverged: .* up to t = 7e\+60 s"
    with pytest.raises(DivergenceError, match=said):
        differentiator.step(LevantState(np.array([1e308, 1e308]), np.array([-1e308]), 7), 0.0)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"L": 0.0}, "L: 0 must be greater than zero"),
        ({"sampling_period": -0.1}, "sampling_period: -0.1 must be greater than zero"),
        ({"order": 0}, "order: 0 must be a whole number, 1 or more"),
        ({"order": 2.0}, "order: 2.0 must be a whole number, 1 or more"),
        ({"order": True}, "order: True must be a whole number, 1 or more"),
        ({"order": 6}, "lambdas: must be given for order 6: the usual ones end at order 5"),
        ({"lambdas": [3, 1.5]}, r"lambdas: has shape \(2,\), must be a list of 3 numbers"),
        ({"lambdas": [3, 0, 1]}, r"lambdas: \[3.0, 0.0, 1.0\] must all be greater than zero"),
        ({"lambdas": ["a", "b", "c"]}, "lambdas: .* is not a number or an array of numbers"),
    ],
)
def test_wrong_parameters_are_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        LevantDifferentiator(**{"L": 1.0, "sampling_period": 0.1, **changed})


def test_wrong_states_and_steps_are_refused() -> None:
    differentiator = LevantDifferentiator(L=1.0, sampling_period=0.1)
    with pytest.raises(InputError, match=r"^start: must be of a differentiator of order 2$"):
        differentiator.run(
            [1.0], start=zeros(LevantDifferentiator(L=1.0, order=3, sampling_period=0.1))
        )
    with pytest.raises(InputError, match=r"^derivatives: has shape \(2,\)"):
        differentiator.init([1.0, 2.0])

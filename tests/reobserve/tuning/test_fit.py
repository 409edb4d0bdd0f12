"""Maximum likelihood: statsmodels' answers, exact likelihoods, a pendulum's length, coverage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import solve_discrete_lyapunov

from reobserve import (
    IMM,
    ExtendedKalmanFilter,
    FixedGainObserver,
    KalmanFilter,
    LevantDifferentiator,
    LinearModel,
    NonlinearModel,
    fit,
)
from reobserve.core.errors import InputError
from reobserve.observers.nonlinear_filter import run_nonlinear


def level_record() -> np.ndarray:
    rng = np.random.default_rng(11)
    level = np.cumsum(0.5 * rng.standard_normal(400))
    return level + rng.standard_normal(400)


def local_level(p: dict[str, float]) -> tuple[KalmanFilter, object]:
    kalman = KalmanFilter(LinearModel([[1]], C=[[1]], Q=p["level"], R=p["noise"]))
    return kalman, kalman.init([0], 100.0)


RANGES = {"noise": (1e-3, 1e3), "level": (1e-4, 1e2)}


def test_local_level_as_statsmodels_finds_it() -> None:
    """`UnobservedComponents` of statsmodels 0.15.0 with a known start, cov_type="approx"."""
    found = fit(local_level, RANGES, [level_record()])
    assert found.values == pytest.approx({"noise": 1.15841029, "level": 0.12845673}, rel=1e-5)
    assert found.standard_errors == pytest.approx(
        {"noise": 0.09813366, "level": 0.03192594}, rel=2e-3
    )
    assert found.log_likelihood == pytest.approx(-665.2125690800685, rel=1e-11)
    assert found.edges == {}
    assert found.measured == 400
    assert found.bic == pytest.approx(2 * np.log(400) + 2 * 665.2125690800685)


def autoregression(p: dict[str, float]) -> tuple[KalmanFilter, object]:
    A = np.array([[p["a1"], p["a2"]], [1.0, 0.0]])
    Q = np.diag([p["variance"], 0.0])
    model = LinearModel(A, C=[[1, 0]], Q=Q, R=1e-12, check=False)
    kalman = KalmanFilter(model)
    return kalman, kalman.init([0, 0], solve_discrete_lyapunov(A, Q))


def test_autoregression_as_statsmodels_finds_it() -> None:
    """`SARIMAX` of order (2, 0, 0) of statsmodels 0.15.0 with a stationary start."""
    rng = np.random.default_rng(12)
    x, e = np.zeros(500), 0.7 * rng.standard_normal(500)
    for k in range(2, 500):
        x[k] = 1.2 * x[k - 1] - 0.5 * x[k - 2] + e[k]
    ranges = {
        "a1": (0.0, 1.6, "linear"), "a2": (-0.9, -0.2, "linear"), "variance": (1e-2, 1e1),
    }  # fmt: skip
    found = fit(autoregression, ranges, [x[100:]])
    expected = {"a1": 1.21206998, "a2": -0.52822213, "variance": 0.4796268}
    assert found.values == pytest.approx(expected, rel=1e-5)
    errors = {"a1": 0.04233813, "a2": 0.04250133, "variance": 0.03391517}
    assert found.standard_errors == pytest.approx(errors, rel=5e-3)
    assert found.log_likelihood == pytest.approx(-421.44899592059267, rel=1e-9)


@pytest.mark.parametrize("rows", [20, 2000])
def test_standard_errors_are_those_of_closed_forms(rows: int) -> None:
    """x(k+1) = a x(k) + w, measured exactly: sqrt(q / sum x^2), and q sqrt(2 / n) of q."""
    x = np.ones(rows + 1)
    for k, w in enumerate(np.random.default_rng(3).normal(0.0, 0.5, rows)):
        x[k + 1] = 0.8 * x[k] + w

    def make(p: dict[str, float]) -> tuple[KalmanFilter, object]:
        kalman = KalmanFilter(LinearModel([[p["a"]]], C=[[1]], Q=p["q"], R=0.0))
        return kalman, kalman.init([x[0]], 0.0, u=[])

    found = fit(make, {"a": (0.1, 0.99, "linear"), "q": (1e-3, 10.0)}, [x[1:]])
    squares = float(x[:-1] @ x[:-1])
    a = float(x[:-1] @ x[1:]) / squares
    q = float(np.mean((x[1:] - a * x[:-1]) ** 2))
    errors = {"a": np.sqrt(q / squares), "q": q * np.sqrt(2.0 / rows)}
    assert found.values == pytest.approx({"a": a, "q": q}, rel=1e-6)
    assert found.standard_errors == pytest.approx(errors, rel=2e-5)


def test_likelihood_of_many_records_is_that_of_their_joint_distribution() -> None:
    y = level_record()
    records = [y[:150], {"y": y[200:260]}]
    found = fit(local_level, RANGES, records)
    level, noise = found.values["level"], found.values["noise"]
    total = 0.0
    for one in (y[:150], y[200:260]):
        k = np.arange(len(one))
        covariance = 100.0 + level * np.minimum(k[:, None], k) + noise * np.eye(len(one))
        total += stats.multivariate_normal(np.zeros(len(one)), covariance).logpdf(one)
    assert found.log_likelihood == pytest.approx(total, rel=1e-10)
    # It is the maximum, and the second derivatives there are those of the errors.
    for name in RANGES:
        for by in (0.98, 1.02):
            other = dict(found.values) | {name: by * found.values[name]}
            kalman, start = local_level(other)
            runs = [kalman.run(one, start=start) for one in (y[:150], y[200:260])]
            assert sum(run["log_likelihood"].sum() for run in runs) < found.log_likelihood


def pendulum(p: dict[str, float]) -> tuple[ExtendedKalmanFilter, object]:
    model = NonlinearModel.from_ode(
        ["rate", "-9.81/length*sin(angle)"], ["angle"], Q=[1e-12, p["push"]], R=p["noise"],
        state_names=["angle", "rate"], parameters={"length": p["length"]}, sampling_period=0.05,
    )  # fmt: skip
    one = ExtendedKalmanFilter(model)
    return one, one.init([0.5, 0.0], [1e-4, 1e-4])


def test_length_of_a_pendulum_is_found_and_nothing_is_compiled_for_it() -> None:
    truth, rng = {"length": 0.7, "push": 1e-6, "noise": 1e-4}, np.random.default_rng(4)
    records = []
    for _ in range(2):
        x, y = np.array([0.5, 0.0]), np.empty(300)
        for k in range(300):
            y[k] = x[0] + 1e-2 * rng.standard_normal()
            for _ in range(5):  # with steps of a fifth
                slopes, h = [], 0.01
                for ahead in (0.0, 0.5, 0.5, 1.0):
                    at = x + ahead * h * slopes[-1] if slopes else x
                    slopes.append(np.array([at[1], -9.81 / 0.7 * np.sin(at[0])]))
                x = x + h / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
            x[1] += 1e-3 * rng.standard_normal()
        records.append(y)
    pendulum(truth)[0].run(records[0], start=pendulum(truth)[1])
    before = len(run_nonlinear.signatures)
    ranges = {"length": (0.3, 2.0), "push": (1e-9, 1e-3), "noise": (1e-6, 1e-2)}
    found = fit(pendulum, ranges, records)
    assert len(run_nonlinear.signatures) == before
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 3 * found.standard_errors[name], name
    assert found.standard_errors["length"] < 0.002


def test_standard_errors_cover_the_truth_as_often_as_they_say() -> None:
    rng, inside = np.random.default_rng(6), 0
    for _ in range(30):
        y = np.cumsum(0.5 * rng.standard_normal(300)) + rng.standard_normal(300)
        found = fit(local_level, RANGES, [y])
        off = np.log(found.values["noise"])  # nearly normal in the logarithm
        inside += abs(off) < 1.96 * found.standard_errors["noise"] / found.values["noise"]
    assert inside >= stats.binom.ppf(0.001, 30, 0.95)


def test_value_at_an_end_of_its_range_has_no_error() -> None:
    found = fit(local_level, {**RANGES, "level": (1.0, 10.0)}, [level_record()])
    assert found.edges == {"level": "low"}
    assert np.isnan(found.standard_errors["level"])
    assert found.standard_errors["noise"] > 0
    assert "level 1 (nan)" in repr(found)


@pytest.mark.parametrize("limit", [0.15, 0.3, 1.0])
def test_maximum_is_found_beside_values_that_cannot_run(limit: float) -> None:
    def partly(p: dict[str, float]) -> object:
        if p["level"] > limit:
            raise InputError("level", "is too large")
        return local_level(p)

    found = fit(partly, RANGES, [level_record()])
    assert found.values == pytest.approx({"noise": 1.15841029, "level": 0.12845673}, rel=1e-3)
    assert found.log_likelihood == pytest.approx(-665.2125690800685, abs=1e-5)


@pytest.mark.parametrize(("high", "end"), [(1e2, "low"), (1.159, "high")])
def test_maximum_near_the_end_of_a_linear_range_has_errors(high: float, end: str) -> None:
    tried = []

    def level(p: dict[str, float]) -> object:
        tried.append(p["noise"])
        return local_level(p)

    ranges = {"noise": (1e-3, high, "linear"), "level": (1e-4, 1e1, "linear")}
    found = fit(level, ranges, [level_record()])
    assert 1e-3 <= min(tried) < max(tried) <= high
    assert found.edges == {"noise": end, "level": "low"}
    assert found.standard_errors == pytest.approx(
        {"noise": 0.09813366, "level": 0.03192594}, rel=1e-2
    )


def test_measurements_are_counted_once_in_a_bank() -> None:
    def bank(p: dict[str, float]) -> object:
        one = local_level({"noise": p["noise"], "level": 0.1})[0]
        both = IMM([one, one], [[0.9, 0.1], [0.1, 0.9]])
        return both, both.init([0], 100.0)

    y = level_record()
    y[10] = np.nan
    assert fit(bank, {"noise": (1e-2, 1e2)}, [y]).measured == 399


def test_what_cannot_be_fitted_is_refused() -> None:
    y = level_record()

    def without(p: dict[str, float]) -> object:
        return LevantDifferentiator(L=1.0, order=1, sampling_period=0.1), None

    def gated(p: dict[str, float]) -> object:
        kalman = KalmanFilter(local_level(p)[0].model, gate=3)
        return kalman, kalman.init([0], 100.0)

    def unstable(p: dict[str, float]) -> object:
        return FixedGainObserver(LinearModel([[1]], C=[[1]], Q=1, R=1), gain=[[p["gain"]]]), None

    for call, message in (
        (lambda: fit(local_level, RANGES, []), "records"),
        (lambda: fit(local_level, RANGES, y[:, None, None]), "records"),
        (lambda: fit(local_level, {"noise": (1, 0.1)}, [y]), r"ranges\.noise\.high"),
        (lambda: fit(local_level, RANGES, [{"u": y}]), r"records\[0\]: must have y"),
        (lambda: fit(local_level, RANGES, [y], budget=30), "budget: 30 is spent before"),
        (lambda: fit(lambda p: KalmanFilter, RANGES, [y]), "make: returned"),
        (lambda: fit(without, {"a": (1, 2)}, [y]), "no log_likelihood"),
        (lambda: fit(unstable, {"gain": (3, 9)}, [y]), "hold none of 16 choices that work"),
        (lambda: fit(gated, RANGES, [y]), "make: returned a filter whose gate skips"),
        (lambda: fit(local_level, RANGES, [[np.nan] * 3]), "records: have no measurement"),
        (lambda: fit(local_level, RANGES, [[1.0, np.inf]]), "hold none of .*inf"),
    ):
        with pytest.raises(InputError, match=message):
            call()

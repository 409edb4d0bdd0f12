"""Every pair of what filters can do: right against a filter written plainly, or refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    FaultBank,
    FixedGainObserver,
    GridFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
)
from tests.reobserve.observers import plain_filters
from tests.reobserve.observers.by_row import differing, part
from tests.reobserve.observers.plain_filters import Plain, assert_alike

Array = NDArray[np.float64]

T, ROWS, TURN = 0.1, 14, 2 * np.pi
C, D = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([[0.0], [0.1]])
R, DENSITY = np.array([[0.0025, 0.001], [0.001, 0.01]]), np.array([[2e-3, 0.0], [0.0, 0.05]])
L = np.array([[0.5, 0.01], [0.1, 0.4]])
PSI, GAMMA = 0.2, 0.1
E, WALK = np.array([[0.0], [0.1]]), 1e-2
MODES, CHAIN = (0.4, 0.9), np.array([[0.9, 0.1], [0.2, 0.8]])
CORRELATED = np.array([[3e-4, 0.0], [2e-4, 2e-3]])
GAPS = np.array([1, 1, 0.4, 1, 2.5, 1, 1, 0.7, 3, 1, 1, 1, 0.5, 1]) * T  # from each row on
TIMES = np.concatenate([[0.0], np.cumsum(GAPS[:-1])])
DAMPING = np.linspace(0.2, 0.9, ROWS)

ABILITIES = ("skip", "inflate", "S", "rows", "nan", "memory", "periods", "uneven", "parameters")
LINEAR = ("Kalman", "augmented", "SVSF", "fixed gain")
NONLINEAR = ("EKF", "UKF")
BANKS = ("IMM", "IMM of EKFs", "fault bank", "grid")


def sampled(damping: float, period: float) -> tuple[Array, Array, Array]:
    """A, B and Q of angle' = rate, rate' = -damping rate + torque, with white noise."""
    whole = np.zeros((3, 3))
    whole[:2] = [[0.0, 1.0, 0.0], [0.0, -damping, 1.0]]
    moved = expm(whole * period)
    # Q = int_0^T exp(A s) W exp(A s)' ds by Van Loan's exponential
    A = whole[:2, :2]
    both = expm(np.block([[-A, DENSITY], [np.zeros((2, 2)), A.T]]) * period)
    return moved[:2, :2], moved[:2, 2:], both[2:, 2:].T @ both[:2, 2:]


def by_runge_kutta(damping: float, period: float) -> tuple[Array, Array, Array]:
    """The same as text is sampled: steps of a period at most, each with the noise W h."""
    parts = max(1, int(np.ceil(period / T - 1e-3)))
    A, h = np.array([[0.0, 1.0], [0.0, -damping]]), period / parts
    terms = [np.linalg.matrix_power(A * h, i) / np.prod(np.arange(1, i + 1)) for i in range(5)]
    step, effect = sum(terms), sum(term * h / (i + 1) for i, term in enumerate(terms[:4]))
    F, G, Q = np.eye(2), np.zeros((2, 1)), np.zeros((2, 2))
    for _ in range(parts):
        F, G = step @ F, step @ G + effect[:, 1:]
        Q = step @ Q @ step.T + DENSITY * h
    return F, G, Q


@dataclass
class Problem:
    """A filter, what it is given, and the same for the one written plainly."""

    observer: Any
    given: dict[str, Any]
    modes: list[Plain]
    y: Array
    u: Array
    x: Array
    P: Array
    chain: Array | None = None
    mu: Array | None = None
    start: dict[str, Any] = field(default_factory=dict)

    @property
    def state(self) -> Any:
        return self.observer.init(self.x[:2], self.P[:2, :2], **self.start)

    def wanted(self) -> Mapping[str, Array]:
        if self.chain is None:
            return plain_filters.run(self.modes[0], self.y, self.u, self.x, self.P)
        assert self.mu is not None
        return plain_filters.run_bank(
            self.modes, self.chain, self.mu, self.y, self.u, self.x, self.P
        )


def linear_model(damping: float, periods: dict[str, Any]) -> LinearModel:
    return LinearModel.from_ode(
        [[0.0, 1.0], [0.0, -damping]], [[0.0], [1.0]], C, D, R=R, density=DENSITY,
        sampling_period=T, **periods,
    )  # fmt: skip


@cache
def text_model(angles: bool) -> NonlinearModel:
    return NonlinearModel.from_ode(
        ["rate", "-damping*rate + torque"], ["angle", "rate + torque/10"], R=R, density=DENSITY,
        sampling_period=T, state_names=["angle", "rate"], input_names=["torque"],
        parameters={"damping": 0.4}, **periods(angles),
    )  # fmt: skip


def periods(angles: bool) -> dict[str, Any]:
    return {"state_periods": [TURN, None], "output_periods": [TURN, None]} if angles else {}


def given_gain(cross: Array, factor: Array, e: Array, error: Array) -> Array:
    return L


def switching_gain(cross: Array, factor: Array, e: Array, error: Array) -> Array:
    return np.asarray(np.linalg.pinv(cross) * ((np.abs(e) + GAMMA * np.abs(error)) / np.maximum(
        np.abs(e), PSI
    )))  # fmt: skip


def record(abilities: set[str]) -> tuple[Array, Array]:
    """Measurements of an angle that goes round, with outliers and gaps, and torques."""
    rng = np.random.default_rng(7)
    at = TIMES if "uneven" in abilities else T * np.arange(ROWS)
    y = np.column_stack([3.0 + 0.5 * at, np.full(ROWS, 0.5)])
    y += rng.normal(size=y.shape) * [0.05, 0.1]
    if {"skip", "inflate"} & abilities:
        y[5, 0] += 1.2
        y[8, 1] -= 4.0
    if "nan" in abilities:
        y[3] = y[6, 1] = y[9, 0] = np.nan
    if "periods" in abilities:
        y[:, 0] = plain_filters.round_(y[:, 0], np.array(TURN))
    return y, rng.normal(size=(ROWS, 1)) * 0.3


def options_of(abilities: set[str]) -> dict[str, Any]:
    """What a filter is made with."""
    options: dict[str, Any] = {}
    if {"skip", "inflate"} & abilities:
        options["gate"] = 4.0
    if "inflate" in abilities:
        options["outliers"] = "inflate"
    if "memory" in abilities:
        options["noise_memory"] = 2.0
    return options


def plain_mode(kind: str, abilities: set[str], damping: Array) -> Plain:
    """The matrices of a filter's model, and what it is made with."""
    options, of_text = options_of(abilities), kind in (*NONLINEAR, "IMM of EKFs")
    lengths = GAPS if "uneven" in abilities else np.full(ROWS, T)
    sample, pairs = by_runge_kutta if of_text else sampled, zip(damping, lengths, strict=True)
    A, B, Q = (np.array(each) for each in zip(*(sample(*pair) for pair in pairs), strict=True))
    turns = np.array([TURN if "periods" in abilities else 0.0, 0.0])
    tiled = [np.tile(matrix, (ROWS, 1, 1)) for matrix in (C, D, R, np.zeros((2, 2)))]
    return Plain(
        A, B, tiled[0], tiled[1], Q, tiled[2], tiled[3], gate=options.get("gate", np.inf),
        inflates="outliers" in options, weight=T / options.get("noise_memory", np.inf),
        periods=(turns, turns),
    )  # fmt: skip


def given_to(kind: str, abilities: set[str], one: Plain) -> dict[str, Any]:
    """What a run is given: matrices by row, S, times and parameters."""
    rng, given = np.random.default_rng(3), dict[str, Any]()
    scale = rng.uniform(0.5, 2.0, (ROWS, 1, 1))
    if "rows" in abilities:
        given["R"] = one.R * scale
        if kind not in ("fault bank", "grid"):
            given["Q"] = one.Q * scale[::-1]
        if kind in (*LINEAR, "IMM"):
            given["A"] = np.array([sampled(d, T)[0] for d in rng.uniform(0.2, 0.8, ROWS)])
            given["B"], given["D"] = one.B * scale, one.D + scale
        if kind in (*LINEAR, "IMM") and kind != "SVSF":
            given["C"] = one.C + np.array([[0.0, 0.1], [0.0, 0.2]]) * scale
    if "S" in abilities:
        given["S"] = CORRELATED * (0.4 if {"rows", "uneven"} & abilities else 1.0)
        if "rows" in abilities:
            given["S"] = given["S"] * rng.uniform(-1.0, 1.0, (ROWS, 1, 1))
    if "uneven" in abilities:
        given["time"] = TIMES
    if "parameters" in abilities:
        given["parameters"] = {"damping": DAMPING}
    return given


def problem(kind: str, abilities: set[str]) -> Problem:
    """The filter of a kind that has these abilities, on a record that asks for them."""
    angles, options = "periods" in abilities, options_of(abilities)
    damping = DAMPING if "parameters" in abilities else np.full(ROWS, 0.4)
    modes = [plain_mode(kind, abilities, damping)]
    given = given_to(kind, abilities, modes[0])
    if kind in ("IMM", "IMM of EKFs"):
        modes = [plain_mode(kind, abilities, np.full(ROWS, d)) for d in MODES]
    modes = [replace(mode, **{
        name: np.broadcast_to(value, getattr(mode, name).shape)
        for name, value in given.items() if name not in ("time", "parameters")
    }) for mode in modes]  # fmt: skip
    y, u = record(abilities)
    made = Problem(None, given, modes, y, u, np.array([3.0, 0.4]), np.diag([0.01, 0.04]))
    model = linear_model(0.4, periods(angles))
    if kind == "Kalman":
        made.observer = KalmanFilter(model, **options)
    elif kind == "fixed gain":
        made.observer = FixedGainObserver(model, gain=L, **options)
        made.modes = [replace(modes[0], gain=given_gain)]
    elif kind == "SVSF":
        made.observer = SmoothVariableStructureFilter(
            model, boundary_layer=PSI, convergence_rate=GAMMA, **options
        )
        made.modes = [replace(modes[0], gain=switching_gain)]
    elif kind == "augmented":
        made.observer = AugmentedKalmanFilter(model, fault_matrix=E, random_walk=WALK, **options)
        made.modes = [widened(modes[0])]
        made.x, made.P = np.append(made.x, 0.0), np.diag([0.01, 0.04, 1.0])
    elif kind in NONLINEAR:
        filter_ = ExtendedKalmanFilter if kind == "EKF" else UnscentedKalmanFilter
        made.observer = filter_(text_model(angles), **options)
    else:
        bank(kind, made, options, angles)
    return made


def widened(one: Plain) -> Plain:
    """The matrices of [x, d]."""
    eye, none = np.tile(np.eye(1), (ROWS, 1, 1)), np.zeros
    A = np.concatenate([one.A, np.tile(E, (ROWS, 1, 1))], axis=2)
    A = np.concatenate([A, np.concatenate([none((ROWS, 1, 2)), eye], axis=2)], axis=1)
    Q = np.zeros((ROWS, 3, 3))
    Q[:, :2, :2], Q[:, 2, 2] = one.Q, T * WALK
    state, output = one.periods
    return replace(
        one, A=A, B=np.concatenate([one.B, none((ROWS, 1, 1))], axis=1), Q=Q,
        C=np.concatenate([one.C, none((ROWS, 2, 1))], axis=2),
        S=np.concatenate([one.S, none((ROWS, 1, 2))], axis=1),
        periods=(np.append(state, 0.0), output),
    )  # fmt: skip


def bank(kind: str, made: Problem, options: dict[str, Any], angles: bool) -> None:
    """Set the bank of a kind, and its modes written plainly."""
    turn = periods(angles)
    if kind == "IMM":
        filters = [KalmanFilter(linear_model(damping, turn)) for damping in MODES]
        made.observer = IMM(filters, CHAIN, **options)
    elif kind == "IMM of EKFs":
        model = text_model(angles)
        filters = [ExtendedKalmanFilter(replace(model, parameters={"damping": d})) for d in MODES]
        made.observer = IMM(filters, CHAIN, **options)
    elif kind == "grid":
        made.observer = GridFilter.of_parameter(
            lambda damping: linear_model(damping, turn), grid=[0.2, 0.4, 0.8], random_walk=0.3,
            **options,
        )  # fmt: skip
    else:
        made.observer = FaultBank(
            linear_model(0.4, turn), fault_matrix=E, drift=0.3, jump=2.0, jump_rate=0.5,
            jump_time=0.2, **options,
        )  # fmt: skip
    made.chain, r = made.observer.transition, len(made.observer.filters)
    made.mu = np.full(r, 1.0 / r)
    if kind in ("grid", "fault bank"):
        first, made.modes = made.modes[0], []
        for each in made.observer.filters:
            own = {
                name: np.tile(getattr(each.model, name), (ROWS, 1, 1))
                for name in "ABCDQR" if name != "R" or "R" not in made.given
            }  # fmt: skip
            n = each.model.states
            state = np.append(first.periods[0], np.zeros(n - 2))
            turns = (state, first.periods[1])
            made.modes.append(replace(first, **own, S=np.zeros((ROWS, n, 2)), periods=turns))
    if kind == "fault bank":
        made.mu = np.eye(r)[0]
        made.start = {"fault_covariance": 0.3, "rate_covariance": 0.02}
        made.x, made.P = np.append(made.x, [0.0, 0.0]), np.diag([0.01, 0.04, 0.3, 0.02])


KEYWORD = r".*unexpected keyword argument "


def refusals(kind: str, abilities: set[str]) -> list[str]:
    """How a filter refuses one of the abilities, or both together."""
    found, one_by_one = [], kind == "IMM of EKFs"
    if "inflate" in abilities and kind in BANKS:
        found.append(f"{KEYWORD}'outliers'")
    if "S" in abilities and kind in ("SVSF", "fixed gain", "UKF", "fault bank", "grid"):
        found.append(r"S: is not taken by \w+")
    if one_by_one and {"S", "rows"} & abilities:
        found.append(r"[QRS]: is taken by banks of filters of one kind on linear models alone")
    if "memory" in abilities and kind in ("SVSF", "fixed gain"):
        found.append(r"noise_memory: must be left out: \w+ has another gain than Kalman's")
    if "memory" in abilities and one_by_one:
        found.append("noise_memory: must be left out: it is for banks of Kalman filters")
    if "uneven" in abilities:
        goes = r"time: goes from .* must go on by the sampling period of 0.1 s"
        if kind == "augmented":
            found.append(f"{goes}; for other times give from_ode the matrices")
        if kind in ("fault bank", "grid", "IMM of EKFs"):
            found.append(f"{goes}; for other times a bank needs linear models with a density")
        if "memory" in abilities:
            found.append(f"{goes}, which noise_memory counts")
        if "S" in abilities and kind == "EKF":
            found.append("S: must be left out where rows are more than a sampling period apart")
    if "parameters" in abilities and kind not in NONLINEAR:
        found.append(f"{KEYWORD}'parameters'")
    if {"rows", "memory"} <= abilities:
        found.append("R: must be left out: noise_memory says that it is estimated")
    return found


PAIRS = [pair for pair in combinations(ABILITIES, 2) if pair != ("skip", "inflate")]


@pytest.mark.nightly_after(140)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
@pytest.mark.parametrize("kind", [*LINEAR, *NONLINEAR, *BANKS])
def test_a_pair_is_right_or_refused(kind: str, pair: tuple[str, str]) -> None:
    refused = refusals(kind, set(pair))
    if refused:
        with pytest.raises((InputError, TypeError), match="|".join(f"^{one}" for one in refused)):
            attempt(problem(kind, set(pair)))
        return
    one = problem(kind, set(pair))
    found, wanted = attempt(one), one.wanted()
    n = found["state"].shape[1]
    turns = one.modes[0].periods[0][:n]
    assert_alike(found, wanted, turns)
    if {"skip", "inflate"} & set(pair):
        assert found.outliers >= 2
    cut = 6
    first = attempt(one, slice(cut))
    second = attempt(one, slice(cut, None), first.end)
    joined = {name: np.concatenate([first[name], second[name]]) for name in first}
    assert not differing(joined, found.estimates)


def attempt(one: Problem, rows: slice = slice(None), state: Any = None) -> Any:
    given = part(one.given, rows) if rows != slice(None) else one.given
    if "S" in given and one.given["S"].ndim == 2:
        given["S"] = one.given["S"]
    start = one.state if state is None else state
    return one.observer.run(one.y[rows], one.u[rows], start=start, **given)

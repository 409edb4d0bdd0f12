"""Models and records of filters that take matrices by row, and how to cut them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    steady_kalman,
)
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

Array = NDArray[np.float64]

ROWS = 9
KEEP = ["predicted_state", "predicted_covariance", "gain"]
TIMES = np.array([0.0, 0.1, 0.2, 0.35, 0.37, 0.47, 0.6, 0.7, 0.95])  # some are a period apart

MODEL = LinearModel(
    [[0.9, 0.2, 0.0], [-0.1, 0.8, 0.1], [0.0, 0.3, 0.7]],
    [[0.1, 0.0], [0.0, 0.5], [0.2, 0.3]],
    [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]],
    [[0.7, -1.2], [0.0, 2.0]],
    Q=[0.2, 0.1, 0.3], R=0.1, sampling_period=0.1,
)  # fmt: skip
OTHER = LinearModel(0.8 * MODEL.A, MODEL.B, MODEL.C, MODEL.D, Q=0.5, R=0.2, sampling_period=0.1)
SLOW = LinearModel(MODEL.A, MODEL.B, MODEL.C, MODEL.D, Q=0.01, R=0.1, sampling_period=0.1)
SPRING = LinearModel.from_ode(
    [[0.0, 1.0], [-2.0, -0.4]], [[0.0, 0.0], [1.0, 0.3]], np.eye(2), [[0.0, 0.1], [0.2, 0.0]],
    R=0.05, density=[[0.2, 0.05], [0.05, 0.3]], sampling_period=0.1,
)  # fmt: skip
STIFF = LinearModel.from_ode(
    [[0.0, 1.0], [-9.0, -0.4]], [[0.0, 0.0], [1.0, 0.3]], np.eye(2), [[0.0, 0.1], [0.2, 0.0]],
    R=0.05, density=[[0.2, 0.05], [0.05, 0.3]], sampling_period=0.1,
)  # fmt: skip
PENDULUM = NonlinearModel.from_ode(
    ["rate", "-stiffness*sin(angle) - 0.4*rate + torque + 0.3*push"],
    ["angle + 0.1*push", "rate*stiffness/5"], R=0.05, density=[0.02, 0.3], sampling_period=0.1,
    state_names=["angle", "rate"], input_names=["torque", "push"], parameters={"stiffness": 5.0},
    substeps=2,
)  # fmt: skip


def random_rows(rows: int = ROWS, seed: int = 4) -> dict[str, Array]:
    """Matrices of the sizes of `MODEL`, other ones in each row, with noise that is correlated."""
    rng, (n, p, m) = np.random.default_rng(seed), (3, 2, 2)
    shapes = {"A": (n, n), "B": (n, p), "C": (m, n), "D": (m, p)}
    found = {name: rng.normal(size=(rows, *shape)) for name, shape in shapes.items()}
    found["A"] *= 0.6
    root = rng.normal(size=(rows, n + m, n + m))
    joint = root @ root.transpose(0, 2, 1)
    joint = 0.5 * (joint + joint.transpose(0, 2, 1)) + 0.1 * np.eye(n + m)
    return {**found, "Q": joint[:, :n, :n], "R": joint[:, n:, n:], "S": joint[:, :n, n:]}


def record(rows: int = ROWS, seed: int = 1) -> tuple[Array, Array]:
    """Measurements, of which a row and a single number are missing, and inputs."""
    rng = np.random.default_rng(seed)
    y, u = rng.normal(size=(rows, 2)), rng.normal(size=(rows, 2))
    y[2], y[4, 1] = np.nan, np.nan
    return y, u


class Given(NamedTuple):
    """A filter, the mean of the state that it starts from, and what it is given by row."""

    observer: Any
    given: Mapping[str, Any]
    mean: tuple[float, ...] = (0.3, -0.2, 0.1)

    @property
    def state(self) -> Any:
        return self.observer.init(self.mean, 0.5)


def all_but(*names: str) -> dict[str, Array]:
    return {name: rows for name, rows in random_rows().items() if name not in names}


def by_mode() -> dict[str, Array]:
    """Matrices by row and mode."""
    pairs = zip(random_rows().items(), random_rows(seed=5).values(), strict=True)
    return {name: np.stack([one, other], axis=1) for (name, one), other in pairs}


def bank(*filters: Any) -> IMM:
    return IMM(filters, [[0.9, 0.1], [0.2, 0.8]])


def svsf(model: LinearModel = MODEL) -> SmoothVariableStructureFilter:
    return SmoothVariableStructureFilter(model, boundary_layer=0.5, convergence_rate=0.1)


def augmented(model: LinearModel = MODEL, **options: Any) -> AugmentedKalmanFilter:
    return AugmentedKalmanFilter(
        model,
        fault_matrix=[[1.0], [0.0], [0.5]],
        random_walk=0.5,
        output_fault_matrix=[[0.2], [-0.1]],
        **options,
    )


def kalman_bank() -> IMM:
    return bank(KalmanFilter(MODEL), KalmanFilter(OTHER))


def spring_bank() -> IMM:
    return bank(KalmanFilter(SPRING), KalmanFilter(STIFF))


def nonlinear(kind: Any, **given: Any) -> Given:
    return Given(kind(PENDULUM), given, (0.3, -0.2))


STIFFNESS = {"stiffness": np.linspace(3.0, 8.0, ROWS)}
LENGTHS = np.linspace(0.05, 0.3, ROWS)
POSITIVE = {name: random_rows()[name][:, :2, :2] for name in "QR"}

GIVEN: dict[str, Callable[[], Given]] = {
    "Kalman": lambda: Given(KalmanFilter(MODEL), {**all_but("S"), "keep": KEEP}),
    "Kalman with S": lambda: Given(KalmanFilter(MODEL), random_rows()),
    "Kalman with S alone": lambda: Given(KalmanFilter(MODEL), {"S": np.full((ROWS, 3, 2), 0.02)}),
    "augmented": lambda: Given(augmented(), {**all_but("S"), "keep": KEEP}),
    "augmented with S": lambda: Given(augmented(), random_rows()),
    "Kalman with S and a gate": lambda: Given(KalmanFilter(MODEL, gate=1.0), random_rows()),
    "augmented with S, inflating": lambda: Given(
        augmented(gate=1.0, outliers="inflate"), random_rows()
    ),
    "Kalman with S, R estimated": lambda: Given(
        KalmanFilter(SLOW, noise_memory=1.0), {"S": np.full((ROWS, 3, 2), 0.002)}
    ),
    "SVSF": lambda: Given(svsf(), all_but("C", "S")),
    "fixed gain": lambda: Given(steady_kalman(MODEL), all_but("S")),
    "IMM": lambda: Given(kalman_bank(), all_but("S")),
    "IMM, uneven": lambda: Given(spring_bank(), {"time": TIMES}, (0.3, -0.2)),
    "IMM by mode": lambda: Given(kalman_bank(), by_mode()),
    "IMM with S": lambda: Given(kalman_bank(), random_rows()),
    "IMM by mode with S and a gate": lambda: Given(
        IMM(kalman_bank().filters, kalman_bank().transition, gate=1.0), by_mode()
    ),
    "IMM of SVSFs": lambda: Given(bank(svsf(), svsf(OTHER)), all_but("C", "S")),
    "EKF": lambda: nonlinear(ExtendedKalmanFilter, parameters=STIFFNESS, dt=LENGTHS, keep=KEEP),
    "UKF": lambda: nonlinear(UnscentedKalmanFilter, parameters=STIFFNESS, dt=LENGTHS, keep=KEEP),
    "EKF with Q and R": lambda: nonlinear(ExtendedKalmanFilter, **POSITIVE),
    "EKF with S": lambda: nonlinear(
        ExtendedKalmanFilter, **POSITIVE, S=0.3 * random_rows()["S"][:, :2], parameters=STIFFNESS
    ),
    "UKF with Q and dt": lambda: nonlinear(UnscentedKalmanFilter, **POSITIVE, dt=LENGTHS),
    "Kalman, uneven": lambda: Given(KalmanFilter(SPRING), {"time": TIMES}, (0.3, -0.2)),
    "EKF, uneven": lambda: nonlinear(ExtendedKalmanFilter, time=TIMES),
    "UKF, uneven": lambda: nonlinear(UnscentedKalmanFilter, time=TIMES, parameters=STIFFNESS),
}


def part(given: Mapping[str, Any], rows: slice) -> dict[str, Any]:
    """What is given for some of the rows."""
    found: dict[str, Any] = {}
    for name, value in given.items():
        if isinstance(value, Mapping):
            found[name] = {key: values[rows] for key, values in value.items()}
        else:
            found[name] = value if name == "keep" else value[rows]
    return found


def stepped(one: Given, y: Array, u: Array) -> tuple[dict[str, Array], Any]:
    """Estimates of all rows by one call of `step` for each, and the state after them."""
    state, found = one.state, []
    for k in range(len(y)):
        given = part(one.given, slice(k, k + 1))
        if "time" in given:
            given["time"] = float(given["time"][0])
        state, estimate = one.observer.step(state, y[k], u[k], **given)
        found.append(estimate)
    return {name: np.array([each[name] for each in found]) for name in found[0]}, state


def differing(found: Mapping[str, Array], wanted: Mapping[str, Array]) -> list[str]:
    """Names of estimates of which a bit differs, or one is missing."""
    names = {*found, *wanted}
    return sorted(
        name
        for name in names
        if name not in found
        or name not in wanted
        or not np.array_equal(found[name], wanted[name], equal_nan=True)
    )


def remembered(state: Any) -> dict[str, Array]:
    """Arrays of a state by name, those of its posterior among them."""
    whole = {**vars(state), **(vars(state.posterior) if hasattr(state, "posterior") else {})}
    return {name: value for name, value in whole.items() if isinstance(value, np.ndarray)}

"""Random faults of stated classes on some channels of a record, and scores of some channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.validation import Names, Positive, checked
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.smoother import rts_smoother
from reobserve.tuning import record_score
from reobserve.tuning.record_score import Score
from reobserve.tuning.task import Array, Estimates, Runner, TaskRecord, estimates_with

CLASSES = ("step", "sine", "ramp", "square")


def _check(place: str, names: Sequence[str]) -> None:
    if unknown := sorted(set(names) - set(CLASSES)):
        raise InputError(place, f"{shown(unknown[0])} must be one of {', '.join(CLASSES)}")


FaultClasses = Annotated[Names, checked(_check)]
Ends = tuple[float, float]
Faulty = tuple[int, int]  # the smallest and the largest number of channels with a fault
Scored = Literal["all", "healthy"]  # channels


@dataclass(frozen=True, kw_only=True)
class FaultyPlant:
    """Keys of a plant with faults on some of its channels, and of which channels are scored."""

    channels: ClassVar[int]

    horizon: Positive  # [s]
    faults: FaultClasses
    onset: Ends  # of faults [s]
    size: Ends  # of faults, in the unit of the plant
    frequency: Ends  # of faults [rad/s]
    faulty: Faulty
    scored: Scored = "all"

    def __post_init__(self) -> None:
        """Refuse numbers of channels that there are not, or that leave none to be scored."""
        most = self.channels if self.scored == "all" else self.channels - 1
        if not 1 <= self.faulty[0] <= self.faulty[1] <= most:
            left = "" if self.scored == "all" else ", as a healthy channel is scored"
            problem = (
                f"{shown(list(self.faulty))} must be two numbers from 1 to {most}, rising{left}"
            )
            raise InputError("faulty", problem)


def random_faults(
    draw: np.random.Generator, plant: FaultyPlant, step: float
) -> list[dict[str, Any]]:
    """Terms of a signal: faults on some channels, of other classes as far as there are some.

    As many channels are faulty as a number between the ends of ``faulty``, each equally likely.
    Sign, size and onset [s] are random. A sine begins at zero, a ramp ends at its size, and a
    square goes from plus to minus its size. Frequencies [rad/s] are spread evenly on a logarithmic
    scale. Onsets and jumps are multiples of ``step`` [s]. As many random numbers are drawn whatever
    the classes and numbers are.
    """
    horizon, faulty = plant.horizon, plant.faulty
    ranks = draw.uniform(size=len(CLASSES))
    order = sorted(plant.faults, key=lambda kind: ranks[CLASSES.index(kind)])
    places = np.argsort(draw.uniform(size=plant.channels))
    count = faulty[0] + int(draw.uniform() * (faulty[1] - faulty[0] + 1))
    faults = []
    for k, channel in enumerate(places.tolist()):
        begin, ends = draw.uniform(*plant.onset), np.log(plant.frequency).tolist()
        rate = float(np.exp(draw.uniform(*ends)))
        end = draw.uniform(*plant.size) * np.sign(draw.uniform(-1.0, 1.0))
        if k >= count:
            continue
        begin, half = (step * round(time / step) for time in (begin, np.pi / rate))
        terms: dict[str, dict[str, Any]] = {
            "step": {"kind": "constant", "size": end},
            "sine": {"kind": "sine", "amplitude": end, "frequency": rate, "phase": -rate * begin},
            "ramp": {"kind": "ramp", "slope": end / (horizon - begin)},
            "square": {"kind": "square", "high": end, "low": -end, "period": 2 * half,
                       "until": horizon + 1.0},
        }  # fmt: skip
        faults.append({"axis": channel + 1, "from": begin, **terms[order[k % len(order)]]})
    return faults


def random_walks(
    observer: AugmentedKalmanFilter, y: Array, u: Array | None, noise: float, *, smooth: bool
) -> Estimates:
    """Unknown inputs, zero at first, at each row by those up to it, or if ``smooth`` by all."""
    start, name = observer.init(y[0], noise**2, unknown_input_covariance=0.0), "unknown_input"
    if not smooth:
        return estimates_with(f"{name}_covariance", observer, name, y, u, start=start)
    late = rts_smoother(observer.run(y, u, start=start, keep=[f"state_{name}_covariance"]))
    return Estimates(late[name], late[f"{name}_covariance"])


@dataclass(frozen=True, eq=False)
class HealthyRecord(TaskRecord):
    """Record of which the healthy channels are scored, beside faulty ones."""

    @property
    def healthy(self) -> NDArray[np.bool_]:
        """True for each channel without a fault."""
        return np.asarray(~self.truth.any(axis=0))


@dataclass(frozen=True, eq=False)
class _HealthyPart(TaskRecord):
    """The healthy channels alone, where an error as large as the faults of the others counts as 1.

    Both are root mean squares of a channel.
    """

    size: float  # type: ignore[misc]


def score(run: Runner, record: TaskRecord, since: float, *, details: bool = True) -> Score:
    """Compare an estimate with the truth, of a `HealthyRecord` on the healthy channels alone."""
    if not isinstance(record, HealthyRecord):
        return record_score.score(run, record, since, details=details)
    healthy, whole = record.healthy, run(record)
    first = int(np.searchsorted(record.time, since - 1e-9))
    power = (record.truth[first:, ~healthy] ** 2).mean() * healthy.sum()
    truth = record.truth[:, healthy]
    part = _HealthyPart(record.time, record.inputs, record.measurements, truth, float(power**0.5))
    scored = record_score.score(lambda _: _channels(whole, healthy), part, since, details=details)
    return replace(scored, lag=np.nan)  # there is nothing to be late for


def _channels(estimate: Array | Estimates, chosen: NDArray[np.bool_]) -> Array | Estimates:
    if not isinstance(estimate, Estimates):
        return estimate[:, chosen]
    P = estimate.covariances
    return Estimates(
        estimate.values[:, chosen],
        P[:, chosen] if P.ndim == 2 else P[:, chosen][:, :, chosen],
    )

"""The ledger without noise, its observers built once, and the record of the stuck fault."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from reobserve.core.validation import Terms
from reobserve.observers.rigid_body_observer import RigidBodyObserver
from reobserve.papers.ilo import keys
from reobserve.papers.ilo.body import known_body
from reobserve.papers.ilo.lyapunov import gyroscopic_eta
from reobserve.papers.ilo.observe import observe
from reobserve.papers.ilo.plant import simulate
from reobserve.papers.ilo.reading import READINGS
from reobserve.papers.ilo.scoring import Errors
from reobserve.papers.ilo.setup import build_observer
from reobserve.replication.parameters.job import Job, named
from reobserve.signals.series import Series

Array = NDArray[np.float64]

NEEDED = {**READINGS, "adaptive": keys.Adaptive}  # observers, by name and form


@dataclass(frozen=True)
class Bench:
    """What the runs of the theory share; ``job`` has no noise."""

    job: Job
    built: dict[str, RigidBodyObserver]
    stuck: Series

    @classmethod
    def of(cls, job: Job) -> Bench:
        """Build the observers and simulate the stuck fault."""
        plant = replace(job.plant, noise=0.0)
        built = {
            name: build_observer(plant, named(job.observers, name, kind))
            for name, kind in NEEDED.items()
        }
        stuck = _record(plant, job.theory.stuck, 0)
        return cls(replace(job, plant=plant), built, stuck)

    def record(self, fault: Terms, noise: float = 0.0) -> Series:
        """The plant under another fault, measured with noise of this standard deviation."""
        plant = replace(self.job.plant, noise=noise)
        return _record(plant, fault, self.job.theory.random_seed)

    def estimate(self, name: str, record: Series, **start: list[float]) -> Series:
        """By an observer of the ledger, from another start if one is given."""
        observer = replace(self.job.observers[name], **start)
        return observe(self.built[name], Job(self.job.plant, observer=observer), record)

    def estimate_by(self, observer: keys.Observer, record: Series) -> Series:
        """By an observer that the ledger does not have."""
        built = build_observer(self.job.plant, observer)
        return observe(built, Job(self.job.plant, observer=observer), record)

    def errors(self, estimate: Series, record: Series) -> Errors:
        """Of the fault on the faulty axis."""
        return Errors.of(record, estimate, self.job.metrics.axis - 1)

    def late(self, errors: Errors) -> float:
        """Relative error in the last window of the run."""
        window = self.job.metrics.late_window
        late = errors.window(float(self.stuck.time[-1]) - window)
        return late.relative_root_mean_square

    @property
    def eta(self) -> float:
        """The constant [N m s] that Assumption 2 needs on the record."""
        inertia = known_body(self.job.plant).inertia
        return gyroscopic_eta(inertia, float(np.max(np.linalg.norm(self.stuck["rate"], axis=1))))


def _record(plant: keys.Plant, fault: Terms, seed: int) -> Series:
    return _simulated(json.dumps([asdict(plant), fault, seed]))


@lru_cache(maxsize=8)
def _simulated(stated: str) -> Series:
    """Records stay as they are while gains are drawn, which is done many times."""
    plant, fault, seed = json.loads(stated)
    return simulate(Job(keys.Plant(**plant), seed, scenario=keys.Scenario(fault)))


def rate_and_error(plant: Series, estimate: Series) -> tuple[Array, Array]:
    """w~ [rad/s] and e [N m] on all axes at the steps of the estimate."""
    every = round(estimate.step / plant.step)
    return (
        plant["rate"][::every] - estimate["rate"],
        plant["fault"][::every] - estimate["fault"],
    )

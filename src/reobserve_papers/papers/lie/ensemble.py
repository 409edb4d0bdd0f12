"""Observers compared with the constant gain over initial states, all from the same estimate.

`run` is the study of every order in both forms, `run_injections` that of cubic injections.
All runs are compiled: a plant and an observer over twenty seconds take some milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import DivergenceError, located
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    TransformedObserver,
)
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.plant import build_system
from reobserve_papers.papers.lie.scoring import (
    integral_of_sizes,
    integral_of_squares,
    ratios,
    settling_time,
    settling_time_of,
    share_better,
)
from reobserve_papers.papers.lie.setup import build_observer, build_problem, forms
from reobserve_papers.papers.lie.study_rows import Row
from reobserve_papers.parameters.job import named
from reobserve_papers.plants.polynomial import PolynomialPlant
from reobserve_papers.signals.grid import multiple

Array = NDArray[np.float64]

# Without the gain composed of truncated T and S. At order 10 it is a polynomial of degree 110, and
# with any step used here it depends on the step whether it diverges.
GAINS = ("series", "jacobian")


class RunOutcome(NamedTuple):
    """Outcome of a run: integrals of squared errors [s], and settling time [s], or nan if never.

    ``sizes`` are the integrals of |x^ - x| and of its components' absolute values [s]. The settling
    times of components, ``settling_times``, are into the same band.
    """

    squares: tuple[float, ...]
    settling_time: float
    diverged: bool
    sizes: tuple[float, ...] = ()
    settling_times: tuple[float, ...] = ()

    @property
    def ise(self) -> float:
        """The integral of |x^ - x|^2 [s]."""
        return float(sum(self.squares))

    def size(self, error: str, measure: str) -> float:
        """One of `MEASURES` of the whole error, ``x``, or of one component, ``x1`` or ``x2``."""
        component = 0 if error == "x" else int(error[1:])
        of = {
            "square": (self.ise, *self.squares),
            "absolute": self.sizes,
            "settling": (self.settling_time, *self.settling_times),
        }
        return of[measure][component]

    @property
    def settled(self) -> bool:
        """True if e settles within the run."""
        return bool(np.isfinite(self.settling_time))


@dataclass(frozen=True, eq=False)
class EnsembleRecord:
    """The plant from one initial state: its states and outputs in half steps of ``step`` [s]."""

    start: Array
    states: Array
    output: Array
    step: float

    def outcome(self, observer: NormalFormObserver, estimate: ArrayLike, band: float) -> RunOutcome:
        """The outcome of an observer that starts from ``estimate``, with the settling ``band``."""
        state = observer.init(estimate)
        run = run_on_halves(observer, self.output, start=state, on_divergence="return")
        if run.diverged_at is not None:
            none = (float("nan"),) * len(self.start)
            return RunOutcome(none, float("nan"), True, (float("nan"), *none), none)
        return self.scored(run["state"], band)

    def scored(self, estimates: Array, band: float) -> RunOutcome:
        """The outcome of estimates at every step."""
        error, step = estimates - self.states[::2], self.step
        level = float(band * np.linalg.norm(error[0]))
        return RunOutcome(
            tuple(integral_of_squares(error, step).tolist()),
            settling_time(error, step, band),
            diverged=False,
            sizes=tuple(integral_of_sizes(error, step).tolist()),
            settling_times=tuple(settling_time_of(np.abs(e), step, level) for e in error.T),
        )


def records(
    plant: PolynomialPlant, axis: Array, estimate: ArrayLike, steps: int, step: float
) -> Iterator[EnsembleRecord]:
    """Records from all states with coordinates on ``axis``, except the estimate itself."""
    for point in product(axis, repeat=plant.system.states):
        start = np.array(point)
        if np.array_equal(start, estimate):
            continue  # no initial error
        try:
            states = plant.simulate(start, 0.5 * step, 2 * steps)
        except DivergenceError as problem:
            raise DivergenceError(f"plant from {point}", problem.time) from None
        yield EnsembleRecord(start, states, plant.output(states), step)


def axis(half_width: float, points: int) -> Array:
    """Evenly spaced numbers from -``half_width`` to ``half_width``."""
    numbers = np.linspace(-1.0, 1.0, points)
    numbers *= half_width
    return numbers


def run(job: keys.Job, study: keys.EnsembleStudy, design: Mapping[str, Any]) -> list[Row]:
    """Run each initial state and observer: ``ise`` [s], and ``settled`` and ``diverged`` (0, 1).

    The name of a row is the kind of gain of the identity form, ``transformed``, or the name of an
    observer of the study. The plant's own record is not used.
    """
    built = _observers(job, study, design)
    estimate = _estimate(job)
    rows = []
    for record in _records(job, study):
        for name, order, observer in built:
            outcome = record.outcome(observer, estimate, job.metrics.settling_band)
            place = (name, order, float(record.start[0]), float(record.start[1]))
            rows += [
                Row(*place, "ise", outcome.ise, "s"),
                Row(*place, "settled", float(outcome.settled), "1"),
                Row(*place, "diverged", float(outcome.diverged), "1"),
            ]
    return rows


def run_injections(
    job: keys.Job, study: keys.InjectionsStudy, design: Mapping[str, Any]
) -> list[Row]:
    """Share of better initial states and median ratio, by pair of coefficients of y^3.

    Thomas, Kwatny & Chang, Remark 3.13.

    ``share_better`` is the share of initial states with an integral of the squared error below that
    of the constant gain. ``median_ise_ratio`` is over all of them, nan if most runs diverge. There
    are also rows of the observers of the study. Order and gain are those of ``cubic4``.
    """
    step = study.sampling_period
    cubic = named(job.observers, "cubic4", keys.Identity)
    runs, estimate = list(_records(job, study)), _estimate(job)

    def squares(observer: NormalFormObserver) -> list[float]:
        return [run.outcome(observer, estimate, job.metrics.settling_band).ise for run in runs]

    observers = _job_observers(job, study, design)
    errors = {name: squares(observer) for name, observer in observers.items()}
    reference = errors["constant"]
    rows: list[Row] = []
    for name, ise in errors.items():
        rows += _summary((name, observers[name].order, "", ""), ise, reference)
    for pair in product(axis(study.largest, study.coefficients), repeat=2):
        first, second = map(float, pair)
        ise = squares(_with_cubic(job, cubic, (first, second), step))
        rows += _summary(("cubic", cubic.order, first, second), ise, reference)
    return rows


def _summary(
    place: tuple[str, int, float | str, float | str], ise: list[float], reference: list[float]
) -> Iterator[Row]:
    median = float(np.median(ratios(ise, reference)))
    yield Row(*place, "share_better", share_better(ise, reference), "1")
    yield Row(*place, "median_ise_ratio", median if np.isfinite(median) else float("nan"), "1")


def _with_cubic(
    job: keys.Job, body: keys.Identity, cubic: tuple[float, float], step: float
) -> IdentityObserver:
    """The identity form with these coefficients of y^3, and linear terms as in the design."""
    design = job.designs[job.study.design]
    terms = [
        {"component": k + 1, "powers": [3], "coefficient": value} for k, value in enumerate(cubic)
    ]
    injected = replace(design, injection=[*design.injection, *terms])
    problem = build_problem(job.plant, injected, degree=body.order + 1)
    form = normal_form(problem.system, problem.degree, injection=problem.injection)
    return IdentityObserver(form, order=body.order, gain=body.gain, sampling_period=step)


def _records(
    job: keys.Job, study: keys.EnsembleStudy | keys.InjectionsStudy
) -> Iterator[EnsembleRecord]:
    step = study.sampling_period
    with located(f"studies.{study.method}"):
        steps = multiple("sampling_period", job.plant.horizon, step, "the step")
    plant = PolynomialPlant(build_system(job.plant))
    return records(plant, axis(study.half_width, study.points), _estimate(job), steps, step)


def _estimate(job: keys.Job) -> Array:
    """The initial estimate of the first observer, which is used for all."""
    return np.array(next(iter(job.observers.values())).initial_estimate)


def _job_observers(
    job: keys.Job, study: keys.EnsembleStudy | keys.InjectionsStudy, design: Mapping[str, Any]
) -> dict[str, NormalFormObserver]:
    """The observers of the study, with its sampling period."""
    known, built = forms(job, study.design, design), {}
    for name, body in job.observers.items():
        changed = replace(body, sampling_period=study.sampling_period)
        with located(f"observers.{name}"):
            built[name] = build_observer(changed, known[body.design])
    return built


def _observers(
    job: keys.Job, study: keys.EnsembleStudy, design: Mapping[str, Any]
) -> list[tuple[str, int, NormalFormObserver]]:
    step = study.sampling_period
    built = [(name, body.order, body) for name, body in _job_observers(job, study, design).items()]
    form = forms(job, study.design, design)[study.design]
    for order in study.orders:
        with located("studies.ensemble.orders"):
            for gain in GAINS:
                observer = IdentityObserver(form, order=order, gain=gain, sampling_period=step)
                built.append((gain, order, observer))
            other = TransformedObserver(form, order=order, sampling_period=step)
            built.append(("transformed", order, other))
    return built

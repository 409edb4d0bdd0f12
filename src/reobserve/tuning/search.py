"""Settings of an observer that are best on training records, found by one rule for all observers.

The objective is the mean over the records of log s, where s is the score of a record: an error that
is normalised, so that 1 is what an estimate of zero earns. A record on which an observer is refused
or diverges, or has a worse score than ``failed``, counts as ``failed``.

Differential evolution (Storn & Price 1997) starts from 16 points of Sobol's sequence in the ranges,
on logarithmic scales unless a range says otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from reobserve.core.arguments import as_whole, as_word
from reobserve.core.errors import InputError, ReobserveError, one_line, shown
from reobserve.core.matrices import as_positive, as_scalar
from reobserve.core.progress import progress
from reobserve.tuning.optimisers import Array, SpentError, search

Settings = dict[str, float]
Outcome = tuple[float, int, str]  # the objective, failed records, and why the last one failed

SCALES = ("log", "linear")
FAILURES = (ReobserveError, ArithmeticError, np.linalg.LinAlgError)
_EDGE = 0.02  # of a range: a best setting that is nearer to an end is flagged
_DIGITS = 6  # of a setting
SMALLEST = 1e-12  # a score below it counts as this: the logarithm of zero has no mean
_MOST = 1_000_000  # evaluations, or records


@dataclass(frozen=True)
class Range:
    """Range of a setting: ends, and the scale on which settings are spread evenly."""

    low: float
    high: float
    scale: str = "log"

    def __post_init__(self) -> None:
        low, high = as_scalar("low", self.low), as_scalar("high", self.high)
        if as_word("scale", self.scale, SCALES) == "log" and low <= 0:
            raise InputError("low", f"{low:g} must be greater than zero on a log scale")
        if not low < high:
            raise InputError("high", f"{high:g} must be greater than the lower end, {low:g}")

    def value(self, place: float) -> float:
        """The setting at a place from 0 to 1, to all digits."""
        if self.scale == "log":
            return math.exp((1 - place) * math.log(self.low) + place * math.log(self.high))
        return (1 - place) * self.low + place * self.high

    def at(self, place: float) -> float:
        """The setting at a place from 0 to 1, to six digits."""
        return min(max(float(f"{self.value(place):.{_DIGITS}g}"), self.low), self.high)

    def place(self, value: float) -> float:
        """The place of a setting, from 0 to 1."""
        ends = [self.low, value, self.high]
        low, here, high = map(math.log, ends) if self.scale == "log" else ends
        return (here - low) / (high - low)


@dataclass(frozen=True)
class Evaluation:
    """One of the settings that were tried.

    ``number`` counts from 1; ``best`` is the best objective up to here; ``failures`` counts records
    on which the observer was refused or diverged.
    """

    number: int
    objective: float
    best: float
    settings: Settings
    failures: int


@dataclass(frozen=True)
class Tuned:
    """The result of `tune`.

    ``settings`` are the best that were tried and ``objective`` is theirs, the mean of log score.
    ``history`` has all evaluations in order. ``edges`` names the settings that are within 2 % of an
    end of their range, with ``low`` or ``high``: a wider range may have better ones.
    """

    settings: Settings
    objective: float
    history: tuple[Evaluation, ...]
    edges: dict[str, str]

    @property
    def score(self) -> float:
        """The geometric mean of the scores of the training records."""
        return math.exp(self.objective)

    def after(self, evaluations: int) -> Settings:
        """The best settings of the first so many evaluations."""
        tried = self.history[: as_whole("evaluations", evaluations, 1)]
        return min(tried, key=lambda trial: trial.objective).settings


def tune(
    make: Callable[[Settings], Any],
    ranges: Mapping[str, Any],
    records: Sequence[Any],
    score: Callable[[Any, Any], float],
    budget: int = 200,
    seed: int = 1,
    *,
    failed: float = 3.0,
    workers: int = 1,
) -> Tuned:
    """Search ranges for the settings of an observer with the best scores on records.

    The result depends on the seed and not on the number of workers. A larger budget goes on where a
    smaller one with the same seed ended. On a terminal, a line on standard error shows progress.

    Parameters
    ----------
    make
        Called with settings, a value for each name in ``ranges``; returns an observer, or anything
        that ``score`` takes.
    ranges
        For each setting (low, high), or (low, high, "linear") where no logarithmic scale is meant.
    records
        Whatever ``score`` takes, one for each training record. Eight or more are advised: with
        three, one search in three came out 15 % worse on other records.
    score
        Called with an observer and a record; returns its error there, zero or more, normalised so
        that 1 is what an estimate of zero has. nan counts as failed.
    budget
        Evaluations, each of one choice of settings on all records.
    seed
        Of the random numbers of the search.
    failed
        The worst score, and that of a record on which an observer raises an error of this package
        or of arithmetic.
    workers
        Threads. Compiled loops run at once, Python takes turns.

    Raises
    ------
    InputError
        If a range, the budget, the seed or another argument cannot be used; a score is negative or
        no number; or every choice fails on all records.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import FixedGainObserver, LinearModel, tune
    >>> model = LinearModel([[1.0]], C=[[1]], Q=0, R=1)
    >>> def score(observer, record):
    ...     run = observer.run(record, start=observer.init([0]))
    ...     return float(np.sqrt(np.mean(run["state"] ** 2)))
    >>> records = np.random.default_rng(1).standard_normal((8, 100))  # noise, of a truth of zero
    >>> found = tune(lambda settings: FixedGainObserver(model, gain=[[settings["gain"]]]),
    ...              {"gain": (0.01, 1.0)}, records, score, budget=20)
    >>> print(found.edges)
    {}
    """
    bounds = as_ranges(ranges)
    budget = as_whole("budget", budget, 1, _MOST)
    seed = as_whole("seed", seed, 0, 2**63 - 1)
    workers = as_whole("workers", workers, 1, 1024)
    most = as_positive("failed", failed)
    for name, function in (("make", make), ("score", score)):
        if not callable(function):
            raise InputError(name, f"{shown(function)} must be a function")
    if not np.iterable(records) or not (records := list(islice(records, _MOST + 1))):
        raise InputError("records", f"{shown(records)} must be one record or more")
    if len(records) > _MOST:
        raise InputError("records", f"must be {_MOST} or fewer")
    objective = Objective(make, records, score, most)
    history: list[Evaluation] = []
    reason = ""
    shown_as = f"{{}} of {budget} evaluations, best score {{:.4g}}"
    with _mapping(workers) as mapped, progress(shown_as) as tell:

        def batch(points: Iterable[Array]) -> list[float]:
            nonlocal reason
            trials = [
                {name: bounds[name].at(place) for name, place in zip(bounds, point, strict=True)}
                for point in points
            ]
            objectives = []
            for settings, (value, failures, why) in zip(
                trials, mapped(objective, trials), strict=True
            ):
                best = min(value, history[-1].best if history else math.inf)
                history.append(Evaluation(len(history) + 1, value, best, settings, failures))
                reason = why or reason
                objectives.append(value)
                tell(len(history), math.exp(best))
            return objectives

        with suppress(SpentError):
            search(batch, len(bounds), budget, seed)
    if all(trial.failures == len(records) for trial in history):
        problem = f"hold no settings that work on a record, of {len(history)} that were tried"
        raise InputError("ranges", f"{problem}; the last one: {reason}")
    best = min(history, key=lambda trial: trial.objective)
    places = {name: span.place(best.settings[name]) for name, span in bounds.items()}
    return Tuned(best.settings, best.objective, tuple(history), edges_of(places))


def edges_of(places: Mapping[str, float]) -> dict[str, str]:
    """The ends, ``low`` or ``high``, of those places from 0 to 1 that are near to one."""
    return {
        name: "low" if place < _EDGE else "high"
        for name, place in places.items()
        if not _EDGE <= place <= 1 - _EDGE
    }


def as_ranges(ranges: Any) -> dict[str, Range]:
    """Ranges by name, or `InputError` for what is none."""
    if not isinstance(ranges, Mapping) or not ranges:
        raise InputError("ranges", f"{shown(ranges)} must name one setting or more")
    bounds = {}
    for name, value in ranges.items():
        if not isinstance(name, str):
            raise InputError("ranges", f"{shown(name)} must be the name of a setting")
        if isinstance(value, Range):
            bounds[name] = value
            continue
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) not in (2, 3):
            wanted = '(low, high) or (low, high, "linear")'
            raise InputError(f"ranges.{name}", f"{shown(value)} must be {wanted}")
        try:
            bounds[name] = Range(*value)
        except InputError as error:
            raise error.renamed(f"ranges.{name}.{error.parameter}") from None
    return bounds


@dataclass(frozen=True)
class Objective:
    """The mean over records of log score. The arguments are those of `tune`."""

    make: Callable[[Settings], Any]
    records: list[Any]
    score: Callable[[Any, Any], float]
    failed: float

    def __call__(self, settings: Settings) -> Outcome:
        """The objective of settings, how many records failed, and why the last one did."""
        try:
            observer = self.make(dict(settings))
        except FAILURES as error:
            return math.log(self.failed), len(self.records), one_line(error)
        total, failures, reason = 0.0, 0, ""
        for record in self.records:
            try:
                value = self.score(observer, record)
            except FAILURES as error:
                value, reason = math.nan, one_line(error)
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise InputError("score", f"returned {shown(value)}, must return a number")
            if value < 0:
                raise InputError("score", f"returned {value:g}, must return zero or more")
            failures += math.isnan(value)
            reason = reason or ("the score is nan" if math.isnan(value) else "")
            capped = self.failed if math.isnan(value) else min(float(value), self.failed)
            total += math.log(max(capped, SMALLEST))
        return total / len(self.records), failures, reason


@contextmanager
def _mapping(workers: int) -> Iterator[Callable[..., Iterable[Outcome]]]:
    if workers == 1:
        yield map
        return
    with ThreadPoolExecutor(workers) as pool:
        yield pool.map

"""Tasks that observers are tuned and compared on: a file that states one, and its module.

The file, NAME.yaml, states plant, conditions and methods with their ranges. The module of the same
name, beside the file, simulates it and has

    Plant                                      a dataclass, the keys of ``plant`` in the file
    simulate(plant, condition, seed, period)   a `TaskRecord`; equal seeds: equal faults and noise
    METHODS                                    by name, make(plant, settings, period, noise)

A method is made from the plant as stated, its settings, the sampling period [s] and the standard
deviation of the noise, which is that of the plant unless the method is given another.
It is a function that takes a record and returns an estimate in the shape of ``truth``, or
`Estimates`, with variances or covariances, for which the table has a normalised squared error.

``Plant`` has a field ``noise``. A task whose estimates have no such error has a function ``score``
with the arguments and the result of `reobserve.tuning.record_score.score`: a detector, say, whose
estimate is an alarm. Its error, too, must be 1 for a method without information. ``COLUMNS`` may
then name its lag and its quantile in the table, and ``NOTE`` say what they are. A task whose
designs or results are cached has a function ``forget`` that clears them, for methods to be timed.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.documents import read_yaml
from reobserve.core.errors import DivergenceError, InputError, located, nearest
from reobserve.core.seals import digest
from reobserve.core.validation import Count, Names, NotNegative, Positive, Seed, Text, items, parse
from reobserve.observers.contract import Observer
from reobserve.tuning.search import Range, Settings

Array = NDArray[np.float64]
Runner = Callable[["TaskRecord"], "Array | Estimates"]


@dataclass(frozen=True, eq=False)
class TaskRecord:
    """Record for a method, rows at the sampling period, and the truth that it estimates.

    Arrays have the shapes (k,), (k, p), (k, m) and (k, q). The columns of the truth have one unit,
    or are scaled to be of one size: their errors are added. ``size`` is the root mean square of an
    error that counts as 1; left out, that of the truth.
    """

    time: Array
    inputs: Array
    measurements: Array
    truth: Array
    size: ClassVar[float | None] = None


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates of a record, in the shape of its truth, with variances or covariances.

    ``values`` have the shape (k, q), ``covariances`` (k, q) if they are variances, or (k, q, q).
    """

    values: Array
    covariances: Array


def estimates_of(
    observer: Observer[Any], name: str, y: ArrayLike, u: ArrayLike | None = None, **options: Any
) -> Array:
    """An estimate of an observer over a record. ``options`` are those of its ``run``.

    Raises
    ------
    DivergenceError
        If it diverges, without the search for the cause that `Observer.run` makes.
    """
    return estimates_with(name, observer, name, y, u, **options).values


def estimates_with(
    covariance: str, observer: Observer[Any], name: str, y: ArrayLike, u: ArrayLike | None = None,
    **options: Any,
) -> Estimates:  # fmt: skip
    """Estimates of an observer with what it calls their variance or covariance, as `estimates_of`.

    Raises
    ------
    DivergenceError
        As `estimates_of`.
    """
    run = observer.run(y, u, on_divergence="return", **options)
    if run.diverged_at is not None:
        raise DivergenceError(type(observer).__name__, run.diverged_at)
    return Estimates(run[name], run[covariance])


@dataclass(frozen=True)
class Condition:
    """Difference of records from what methods know of them, empty for the nominal condition.

    ``noise`` and ``period`` are factors; ``model`` is by which share parameters of the plant are
    wrong, with random signs; ``plant`` replaces keys of the plant, for the methods as well.
    """

    title: Text
    noise: Positive = 1.0
    model: NotNegative = 0.0
    period: Count = 1
    plant: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Training:
    """Conditions whose records settings are tuned on, each with all training seeds.

    They are scored in the same ones and in those that ``scored`` names; those of the first training
    set of a file are scored in all conditions.
    """

    title: Text
    conditions: Names
    scored: list[str] = field(default_factory=list)
    repeats: Count = 1


@dataclass(frozen=True)
class SettingRange:
    """The range of a setting, and why it ends there."""

    range: tuple[float, float]
    unit: str
    why: Text
    scale: str = "log"

    def __post_init__(self) -> None:
        Range(*self.range, self.scale)


@dataclass(frozen=True)
class Own:
    """Settings that a paper has used, and where."""

    settings: dict[str, float]
    source: Text


@dataclass(frozen=True)
class Method:
    """A method: what it needs and guarantees, its function, and ranges of its settings.

    ``make`` is a name in METHODS, that of the method itself if left out, or ``module:function``.
    With ``given_noise`` it is also scored when it is given the noise of each condition. One that is
    not ``causal`` reads what comes later, and is never the best that others are compared with. A
    condition in ``fails`` is one in which it may diverge or be refused, and why; elsewhere that is
    an error.
    """

    label: Text
    needs: Text
    guarantees: Text
    ranges: Annotated[dict[str, SettingRange], items()]
    make: str = ""
    fixed: dict[str, float] = field(default_factory=dict)
    given_noise: bool = False
    causal: bool = True
    paper: Own | None = None
    fails: dict[str, Text] = field(default_factory=dict)


@dataclass(frozen=True)
class Seeds:
    """Seeds for training, from 1, of repeat r from 1 + 100 r, and held-out ones, from 1001.

    More are drawn, ``step`` at a time, until every comparison is decided or there are ``most``.
    """

    training: Count = 8
    step: Count = 16
    most: Count = 64


def _known(place: str, names: Iterable[str], known: Iterable[str]) -> None:
    for name in names:
        if name not in known:
            raise InputError(place, f"there is no {name!r}{nearest(name, known)}")


@dataclass(frozen=True)
class TaskFile:
    """The keys of a task file.

    ``table`` names the conditions in which all comparisons are decided, ``shown`` the methods of
    the figures that are too small for all.
    """

    title: Text
    estimates: Text
    period: Positive
    scored_from: NotNegative
    plant: dict[str, Any]
    conditions: Annotated[dict[str, Condition], items()]
    training: Annotated[dict[str, Training], items()]
    methods: Annotated[dict[str, Method], items()]
    table: Names
    shown: Annotated[Names, items(1, 5)]
    budget: Count = 200
    seeds: Seeds = field(default_factory=Seeds)
    seed: Seed = 1


@dataclass(frozen=True)
class Task(TaskFile):
    """A task with the module that simulates it, both found by ``file``."""

    name: str = ""
    file: str = ""
    own: ClassVar[str] = "the paper's settings"  # that `Method.paper` has, in the table
    place: ClassVar[str] = "methods"  # the key of the file under which they stand

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """The task in a file.

        Raises
        ------
        InputError
            With the file and the key of what is missing, unknown or not as it must be.
        """
        path = Path(path)
        content = parse(TaskFile, read_yaml(path), str(path))
        task = cls(**vars(content), name=path.stem, file=str(path))
        with located(str(path)):
            task._check()
        return task

    def _check(self) -> None:
        _known("table", self.table, self.conditions)
        _known("shown", self.shown, self.methods)
        for name, training in self.training.items():
            for place in ("conditions", "scored"):
                _known(f"training.{name}.{place}", getattr(training, place), self.conditions)
        for name in self.conditions:
            with located(f"conditions.{name}"):
                self.plant_in(name)
        for name, method in self.methods.items():
            with located(f"methods.{name}"):
                self.function(name)
                _known("fails", method.fails, self.conditions)
                if method.paper and set(method.paper.settings) != set(method.ranges):
                    listed = ", ".join(method.ranges)
                    raise InputError("paper.settings", f"must be those of the ranges: {listed}")

    @property
    def main(self) -> str:
        """The first training set, whose settings are compared in all conditions."""
        return next(iter(self.training))

    @cached_property
    def module(self) -> ModuleType:
        """The module that simulates the task, beside the file.

        Raises
        ------
        InputError
            If there is none.
        """
        path = Path(self.file).with_suffix(".py")
        if not path.is_file():
            raise InputError(self.file, f"needs a module {path.name} beside it")
        spec = importlib.util.spec_from_file_location(f"bench_task_{self.name}", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    def function(self, method: str) -> Callable[..., Runner]:
        """The function that makes a method."""
        name = self.methods[method].make or method
        if ":" in name:
            module, _, attribute = name.partition(":")
            function: Any = getattr(importlib.import_module(module), attribute, None)
        else:
            function = self.module.METHODS.get(name)
        if not callable(function):
            problem = f"{name!r} is no function of the task{nearest(name, self.module.METHODS)}"
            raise InputError("make", problem)
        made: Callable[..., Runner] = function
        return made

    def plant_in(self, condition: str) -> Any:
        """The plant as methods know it in a condition, or `InputError` if a key is wrong."""
        tree = {**self.plant, **self.conditions[condition].plant}
        return parse(self.module.Plant, tree, "plant")

    def record(self, condition: str, seed: int) -> TaskRecord:
        """The record of a condition and a seed."""
        entry = self.conditions[condition]
        record: TaskRecord = self.module.simulate(
            self.plant_in(condition), entry, seed, self.period
        )
        return record

    def make(self, method: str, settings: Settings, condition: str, *, given: bool) -> Runner:
        """A method in a condition, with the noise ``given``, or that of the plant."""
        entry, plant = self.conditions[condition], self.plant_in(condition)
        values = {**self.methods[method].fixed, **settings}
        noise = plant.noise * (entry.noise if given else 1.0)
        return self.function(method)(plant, values, self.period * entry.period, noise)

    def training_seeds(self, repeat: int) -> list[int]:
        """The seeds of the training records of a repeat, counted from 0."""
        return [1 + 100 * repeat + k for k in range(self.seeds.training)]

    def held_out_seeds(self, count: int) -> list[int]:
        """The first so many seeds of held-out records."""
        return [1001 + k for k in range(count)]

    def digest(self, method: str, training: str) -> str:
        """A short hash of everything in the file that decides what a tuning finds."""
        entry, conditions = self.methods[method], self.training[training].conditions
        content: Mapping[str, Any] = {
            "plant": self.plant, "period": self.period, "scored_from": self.scored_from,
            "budget": self.budget, "seed": self.seed, "records": self.seeds.training,
            "conditions": [
                {**vars(self.conditions[name]), "title": ""} for name in conditions
            ],
            "make": entry.make or method, "fixed": entry.fixed,
            "ranges": {name: [*value.range, value.scale] for name, value in entry.ranges.items()},
        }  # fmt: skip
        return digest(content)

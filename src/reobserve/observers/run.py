"""Estimates of an observer by name: of one sample, or over a record."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, one_line, shown
from reobserve.core.extras import package

Array = NDArray[np.float64]
StateKind = TypeVar("StateKind")
AxisNames = tuple[tuple[str, ...] | None, ...]

_LONGEST = 280  # characters of an estimate that is printed


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """Estimates at one sample.

    ``time`` [s]; ``estimates`` by name, each a number or an array of its own shape; ``units`` by
    the same names, empty where the observer has no names. ``estimate["fault"]`` is one of them.
    """

    time: float
    estimates: Mapping[str, Array]
    units: Mapping[str, str]

    def __getitem__(self, name: str) -> Array:
        return _named(self.estimates, name)

    def __iter__(self) -> Iterator[str]:
        """The names of the estimates."""
        return iter(self.estimates)

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {shown(self[name].tolist(), 40)}" for name in self.estimates)
        return one_line(f"Estimate at {self.time:g} s: {listed}", _LONGEST)


@dataclass(frozen=True, eq=False, repr=False)
class Run(Generic[StateKind]):
    """Estimates at the samples of a record, one row a sample; ``run["fault"]`` is one of them.

    ``time`` [s] has shape (k,), each of ``estimates`` (k, ...); ``units`` go by the same names,
    empty where the observer has no names. ``before`` holds limits from the left of estimates that
    jump at samples. ``missing`` counts samples that were not taken. ``diverged_at`` is None, or
    the time [s] after which an estimate left the range of floating-point numbers; then k counts
    the rows up to it. ``state`` is the one to go on from, or after a divergence the one that the
    run started from. ``component_names`` name the components of estimates, a tuple for each axis,
    where the model names its signals; an axis without names is None.
    """

    time: Array
    estimates: Mapping[str, Array]
    units: Mapping[str, str]
    state: StateKind
    diverged_at: float | None = None
    before: Mapping[str, Array] = field(default_factory=dict)
    missing: int = 0
    component_names: Mapping[str, AxisNames] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        return _named(self.estimates, name)

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[str]:
        """The names of the estimates, so that ``"fault" in run`` asks for one."""
        return iter(self.estimates)

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {self[name].shape[1:]}" for name in self.estimates)
        ending = "" if self.diverged_at is None else f", diverged at {self.diverged_at:g} s"
        return f"Run of {len(self)} samples: {listed}{ending}"

    def labels(self, name: str, index: tuple[int, ...]) -> list[str]:
        """What a component of an estimate is called along each axis: its name, or its number."""
        axes = self.component_names.get(name, (None,) * len(index))
        return [
            str(1 + place) if names is None else names[place]
            for names, place in zip(axes, index, strict=True)
        ]

    def to_pandas(self) -> Any:
        """A data frame: a row a sample, the time [s] as its index, a column for each component.

        Components are numbered from 1: ``fault_1``, or ``covariance_2_1`` of a matrix. Where the
        model names its signals, they have those names: ``state_position``.
        """
        package("pandas", "make a data frame")
        import pandas as pd

        columns = {
            "_".join((name, *self.labels(name, index))): values[(slice(None), *index)]
            for name, values in self.estimates.items()
            for index in np.ndindex(values.shape[1:])
        }
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time"))

    def plot(self, names: Iterable[str] | None = None) -> Any:
        """A matplotlib figure of the estimates over time, one panel each; see `run_plot`.

        Raises
        ------
        InputError
            If there is no estimate of such a name, or matplotlib is not installed.
        """
        from reobserve.observers.run_plot import plot

        return plot(self, list(self.estimates if names is None else names))


def _named(estimates: Mapping[str, Array], name: str) -> Array:
    if not isinstance(name, str) or name not in estimates:
        raise InputError("estimate", f"there is no {shown(name)}{nearest(str(name), estimates)}")
    return estimates[name]


def names_by_model(model: Any) -> dict[str, AxisNames]:
    """The names of components of a filter's estimates, from a model's names of its signals."""
    states, outputs = (getattr(model, f"{kind}_names", None) for kind in ("state", "output"))
    axes: dict[str, AxisNames] = {
        "state": (states,),
        "variance": (states,),
        "covariance": (states, states),
        "innovation": (outputs,),
        "innovation_covariance": (outputs, outputs),
    }
    return {name: names for name, names in axes.items() if any(names)}

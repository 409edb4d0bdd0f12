"""Estimates of an observer by name: of one sample, or over a record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, one_line, shown
from reobserve.core.extras import package

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from reobserve.observers.run_diagnostics import Diagnostics

Array = NDArray[np.float64]
StateKind = TypeVar("StateKind")
AxisNames = tuple[tuple[str, ...] | None, ...]

# What filters keep if asked for, and an estimate that all have which do so.
ON_REQUEST = dict.fromkeys(
    ("predicted_state", "predicted_covariance", "gain"), "innovation_covariance"
) | {"state_unknown_input_covariance": "unknown_input_covariance"}

_LONGEST = 280  # characters of an estimate that is printed


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """Estimates at one sample.

    ``time`` [s]; ``estimates`` by name, each a number or an array of its own shape; ``units`` by
    the same names, empty where the observer has no names. ``estimate["fault"]`` is one of them.

    Examples
    --------
    >>> from reobserve import LevantDifferentiator
    >>> observer = LevantDifferentiator(L=1.0, order=1, sampling_period=0.1)
    >>> state, estimate = observer.step(observer.init([0.5, 1.0]), y=0.5)
    >>> print(list(estimate), estimate["derivatives"])
    ['derivatives'] [0.5 1. ]
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
    """Estimates at the samples of a record by name, as ``run["fault"]``, one row a sample.

    ``time`` [s] has shape (k,), each of ``estimates`` (k, ...); ``units`` go by the same names,
    empty where the observer has no names. ``before`` holds limits from the left of estimates that
    jump at samples. ``missing`` counts samples that were not taken. ``diverged_at`` is None, or
    the time [s] after which an estimate left the range of floating-point numbers; then k counts
    the rows up to it. ``end`` is the state to go on from, or after a divergence the one that the
    run started from. ``component_names`` name the components of estimates, a tuple for each axis,
    where the model names its signals; an axis without names is None. ``run["state_position"]`` is
    the component of that name. ``index`` is that of the frame of measurements, if it is of times.
    ``periods`` are those of the components of estimates that are angles, zero for the others.
    ``source`` is what `rts_smoother` reads of a Kalman filter's run, None of others.

    A run of many records has estimates (records, k, ...), nan from where one diverged, tuples of
    states and sources, and in ``diverged_at`` and ``missing`` an entry each, nan where one did not
    diverge; `record` is the run of one.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel
    >>> model = LinearModel([[0.9]], C=[[1]], Q=1e-4, R=1e-2, state_names=["level"])
    >>> kalman = KalmanFilter(model)
    >>> run = kalman.run([1.0, 0.9, 0.8], start=kalman.init([1.0], 0.1))
    >>> print(len(run), "variance" in run, run["state_level"].round(3))
    3 True [1.    0.9   0.807]
    """

    time: Array
    estimates: Mapping[str, Array]
    units: Mapping[str, str]
    end: StateKind
    diverged_at: Any = None
    before: Mapping[str, Array] = field(default_factory=dict)
    missing: Any = 0
    component_names: Mapping[str, AxisNames] = field(default_factory=dict)
    index: Any = None
    periods: Mapping[str, Array] = field(default_factory=dict)
    source: Any = None

    def __getitem__(self, name: str) -> Array:
        if isinstance(name, str) and name not in self.estimates:
            for whole in self.component_names:
                shape = self.estimates[whole].shape if whole in self.estimates else ()
                axes = shape[len(shape) - len(self.component_names[whole]) :]
                for index in np.ndindex(axes if shape else (0,)):
                    if "_".join((whole, *self.labels(whole, index))) == name:
                        return self.estimates[whole][(..., *index)]
        return _named(self.estimates, name)

    @property
    def outliers(self) -> Any:
        """The number of rows with an innovation beyond the filter's gate, zero without one.

        Of a run of many records, an entry each.
        """
        if "outlier" not in self.estimates:
            return 0
        rows = np.nan_to_num(self.estimates["outlier"]).any(axis=-1).sum(axis=-1)
        return rows if rows.ndim else int(rows)

    def record(self, number: int) -> Run[Any]:
        """The run of one of many records, by its ``number`` from 0 on.

        Raises
        ------
        InputError
            If it is a run of one record, or there is no such record.
        """
        states: Any = self.end
        count = len(states) if type(states) is tuple else 0
        whole = isinstance(number, int | np.integer) and not isinstance(number, bool)
        if not whole or not 0 <= number < count:
            raise InputError("number", f"{shown(number)} must be a record, below {count}")
        last = None if self.diverged_at is None else float(self.diverged_at[number])
        good = len(self) if last is None or np.isnan(last) else int((self.time <= last).sum())
        if good == 1 and all(np.isnan(rows[number, 0]).all() for rows in self.estimates.values()):
            good = 0  # it diverged at the first row, whose time stands for none before it
        return Run(
            self.time[:good],
            {name: values[number, :good] for name, values in self.estimates.items()},
            self.units,
            states[number],
            None if good == len(self) else last,
            {name: values[number, :good] for name, values in self.before.items()},
            int(self.missing[number]),
            self.component_names,
            periods=self.periods,
            source=None if self.source is None else self.source[number],
        )

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[str]:
        """The names of the estimates, so that ``"fault" in run`` asks for one."""
        return iter(self.estimates)

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {self[name].shape[1:]}" for name in self.estimates)
        states: Any = self.end
        if type(states) is tuple:
            records = len(states)
            return f"Run of {records} records of {len(self)} samples: {', '.join(self)}"
        ending = "" if self.diverged_at is None else f", diverged at {self.diverged_at:g} s"
        return f"Run of {len(self)} samples: {listed}{ending}"

    def _refuse_many(self) -> None:
        if type(self.end) is tuple:
            raise InputError("run", "is of many records; take one of them, run.record(0)")

    def labels(self, name: str, index: tuple[int, ...]) -> list[str]:
        """The names of a component along each axis, or its numbers.

        Parameters
        ----------
        name
            Of the estimate.
        index
            Of the component, a number for each axis.
        """
        axes = self.component_names.get(name, (None,) * len(index))
        return [
            str(1 + place) if names is None else names[place]
            for names, place in zip(axes, index, strict=True)
        ]

    def to_pandas(self) -> Any:
        """A data frame: a row a sample, a column for each component.

        Its index is the time [s], or that of the frame of measurements if it was one of times.

        Components are numbered from 1: ``fault_1``, or ``covariance_2_1`` of a matrix. Where the
        model names its signals, they have those names: ``state_position``.
        """
        self._refuse_many()
        package("pandas", "make a data frame")
        import pandas as pd

        columns = {
            "_".join((name, *self.labels(name, index))): values[(slice(None), *index)]
            for name, values in self.estimates.items()
            for index in np.ndindex(values.shape[1:])
        }
        index = pd.Index(self.time, name="time") if self.index is None else self.index
        return pd.DataFrame(columns, index=index)

    def plot(
        self, names: Sequence[str] | None = None, known: Mapping[str, ArrayLike] | None = None
    ) -> Any:
        """A matplotlib figure of the estimates ``names`` over time, one panel each, by `run_plot`.

        Where the run has their variances, bands of two deviations are around the estimates of a
        filter, and around zero for innovations. ``known`` are true values by the same names, such
        as a fault or states that were simulated, of the shape of the estimates.

        Raises
        ------
        InputError
            If there is no estimate of such a name, true values have another shape, or matplotlib is
            not installed.
        """
        self._refuse_many()
        from reobserve.observers.run_plot import plot

        return plot(self, names, {} if known is None else known)

    def diagnostics(self) -> Diagnostics:
        """Signs against the model in the innovations and covariances of a Gaussian filter.

        Raises
        ------
        InputError
            If the run is of many records, or has no innovations.
        """
        self._refuse_many()
        from reobserve.observers.run_diagnostics import diagnose

        return diagnose(self)


def _named(estimates: Mapping[str, Array], name: str) -> Array:
    if isinstance(name, str) and ON_REQUEST.get(name) in estimates and name not in estimates:
        raise InputError("estimate", f'there is no {name!r}: run the filter with keep="{name}"')
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
        "outlier": (outputs,),
        "noise_variance": (outputs,),
    }
    return {name: names for name, names in axes.items() if any(names)}

"""A run at a glance. matplotlib is imported when it is asked for: observers do without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.matrices import as_numbers
from reobserve.observers.run import Run
from reobserve.systems.signal_names import as_names

Array = NDArray[np.float64]

_MAX_LINES = 12  # in one panel: more cannot be distinguished
_MAX_ROWS = 8  # in a column of the legend


def plot(run: Run[Any], names: Sequence[str] | None, known: Mapping[str, ArrayLike]) -> Any:
    """A figure with a panel for each name that has components, these as lines (see `Run.plot`)."""
    names = as_names("names", names) or tuple(run)
    known = as_kind("known", known, Mapping)  # type: ignore[type-abstract]
    true = {name: _as_true(run, name, value) for name, value in known.items()}
    values = {name: run[name].reshape(len(run), -1) for name in names if run[name].size}
    labels = {
        name: [_label(run, name, index) for index in np.ndindex(run[name].shape[1:])]
        for name in values
    }
    figure = package("matplotlib.figure", "plot a run").Figure(
        figsize=(6.4, 0.8 + 1.7 * max(len(values), 1)), layout="constrained"
    )
    axes = figure.subplots(max(len(values), 1), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (name, rows) in zip(axes, values.items(), strict=False):
        centre, spread = _band(run, name, rows)
        periods = run.periods.get(name, np.zeros(rows.shape[1]))
        for column in range(min(rows.shape[1], _MAX_LINES)):
            period = periods[column]
            drawn = _without_turns(run.time, rows[:, column], period)
            (line,) = ax.plot(*drawn, label=labels[name][column], linewidth=1.2)
            if name in true:
                behind = _without_turns(run.time, true[name][:, column], period)
                ax.plot(*behind, color="0.6", linewidth=2.5, zorder=1)
            if spread is not None:
                middle, wide = centre[:, column], 2.0 * spread[:, column]
                edges = [_without_turns(run.time, middle, period, off) for off in (-wide, wide)]
                (time, low), (_, high) = edges
                ax.fill_between(
                    time, low, high, color=line.get_color(), alpha=0.2, linewidth=0, zorder=0
                )
        unit = run.units.get(name)
        ax.set_ylabel(f"{name} [{unit}]" if unit else name)
        if rows.shape[1] > 1 or name in run.component_names:
            columns = 1 + (len(ax.lines) > _MAX_ROWS)
            ax.legend(fontsize="small", ncols=columns, loc="upper left", bbox_to_anchor=(1, 1))
        if run.diverged_at is not None:
            ax.axvline(run.diverged_at, color="0.3", linestyle=":", label="diverged")
    axes[-1].set_xlabel("time [s]")
    return figure


def _without_turns(
    time: Array, values: Array, period: float, off: Array | float = 0.0
) -> tuple[Array, Array]:
    """A line, interrupted where an angle goes round: times and values, with nan between rows."""
    jumps = np.abs(np.diff(values)) > (0.5 * period if period else np.inf)
    turns = np.flatnonzero(jumps) + 1
    return np.insert(time, turns, time[turns]), np.insert(values + off, turns, np.nan)


def _band(run: Run[Any], name: str, rows: Array) -> tuple[Array, Array | None]:
    """The centre of an estimate's band, and its standard deviation, or None where it has none."""
    if name == "innovation" and "innovation_covariance" in run:
        variance = np.diagonal(run["innovation_covariance"], axis1=-2, axis2=-1)
        return np.zeros_like(rows), np.sqrt(np.maximum(variance, 0.0))
    key = {"state": "variance", "unknown_input": "unknown_input_variance"}.get(name, "")
    if key not in run or run[key].size != rows.size:
        return rows, None
    return rows, np.sqrt(np.maximum(run[key].reshape(rows.shape), 0.0))


def _as_true(run: Run[Any], name: str, value: ArrayLike) -> Array:
    """True values of an estimate as rows."""
    wanted, array = run[name].shape, as_numbers(f"known {name}", value)
    if array.size != run[name].size or array.shape[:1] != wanted[:1]:
        raise InputError(f"known {name}", f"has shape {array.shape}, must be {wanted}")
    return array.reshape(len(run), -1)


def _label(run: Run[Any], name: str, index: tuple[int, ...]) -> str:
    """The name of a component in the legend: by its signals, or by its estimate and numbers."""
    labels = ", ".join(run.labels(name, index))
    return labels if name in run.component_names else f"{name} {labels}".strip()

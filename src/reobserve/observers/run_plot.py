"""A run at a glance. matplotlib is imported when it is asked for: observers do without."""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.core.extras import package
from reobserve.observers.run import Run

_MAX_LINES = 12  # in one panel: more cannot be distinguished
_MAX_ROWS = 8  # in a column of the legend


def plot(run: Run[Any], names: list[str]) -> Any:
    """A figure with a panel for each name that has components, these as lines.

    Raises
    ------
    InputError
        If there is no estimate of such a name, or matplotlib is not installed.
    """
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
        for column in range(min(rows.shape[1], _MAX_LINES)):
            ax.plot(run.time, rows[:, column], label=labels[name][column], linewidth=1.2)
        unit = run.units.get(name)
        ax.set_ylabel(f"{name} [{unit}]" if unit else name)
        if rows.shape[1] > 1 or name in run.component_names:
            columns = 1 + (len(ax.lines) > _MAX_ROWS)
            ax.legend(fontsize="small", ncols=columns, loc="upper left", bbox_to_anchor=(1, 1))
        if run.diverged_at is not None:
            ax.axvline(run.diverged_at, color="0.3", linestyle=":", label="diverged")
    axes[-1].set_xlabel("time [s]")
    return figure


def _label(run: Run[Any], name: str, index: tuple[int, ...]) -> str:
    """The name of a component in the legend: by its signals, or by its estimate and numbers."""
    labels = ", ".join(run.labels(name, index))
    return labels if name in run.component_names else f"{name} {labels}".strip()

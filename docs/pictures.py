"""Figures of the pages: one style for all, and PNG files on white.

Lines differ in colour and in dashes: they stay apart in greyscale.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

_INK = "#1f2328"
_BLUE, _ORANGE, _GREEN = "#1f6fb5", "#c2600a", "#2b8a57"

TRUTH: dict[str, Any] = {"color": _INK, "linewidth": 2.4, "alpha": 0.45}
FIRST: dict[str, Any] = {"color": _BLUE, "linewidth": 1.3}
SECOND: dict[str, Any] = {"color": _ORANGE, "linewidth": 1.3, "linestyle": (0, (5, 2))}
THIRD: dict[str, Any] = {"color": _GREEN, "linewidth": 1.6, "linestyle": (0, (1, 1.5))}
LIMIT: dict[str, Any] = {"color": _INK, "linewidth": 0.9, "linestyle": (0, (6, 3, 1, 3))}

_STYLE: dict[Any, Any] = {
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.labelsize": 10,
    "axes.titlesize": 10,
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "grid.alpha": 0.3,
    "grid.color": "#808080",
    "grid.linewidth": 0.6,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "savefig.dpi": 150,
    "savefig.facecolor": "white",
    "text.color": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
}


def panels(rows: int = 1, *, height: float = 2.2, share: bool = True) -> tuple[Figure, list[Any]]:
    """An empty figure and its panels, one below the other, ``height`` inches each."""
    with matplotlib.rc_context({**matplotlib.rcParamsDefault, **_STYLE}):
        figure = Figure(figsize=(7.0, 0.5 + height * rows), layout="constrained")
        axes = figure.subplots(rows, 1, sharex=share, squeeze=False)[:, 0]
    return figure, list(axes)


def save(figure: Figure, path: Path) -> None:
    """Write the figure as PNG, with a legend above each panel, where it covers no line."""
    with matplotlib.rc_context({**matplotlib.rcParamsDefault, **_STYLE}):
        for axes in figure.axes:
            labels = axes.get_legend_handles_labels()[1]
            if labels:
                axes.legend(
                    loc="lower left",
                    bbox_to_anchor=(0.0, 1.0),
                    ncols=len(labels),
                    borderaxespad=0.2,
                )
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, metadata={"Software": None}, pil_kwargs={"optimize": True})

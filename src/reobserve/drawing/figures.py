"""How every figure looks and is saved: sized for print, safe in greyscale, the same bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.plain_data.files import write_whole

Array = NDArray[np.float64]

WIDTH = 6.6  # inches: a text width, so that print needs no scaling

matplotlib.rcParams.update(
    {
        "font.family": "DejaVu Sans",
        "mathtext.fontset": "dejavusans",
        "font.size": 8.5,
        "axes.labelsize": 8.5,
        "axes.titlesize": 9,
        "axes.titlelocation": "left",
        "axes.grid": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "grid.color": "0.88",
        "grid.linewidth": 0.5,
        "legend.fontsize": 7.5,
        "legend.frameon": False,
        "lines.linewidth": 1.1,
        "figure.constrained_layout.use": True,
        "savefig.dpi": 160,
        "pdf.fonttype": 42,
        "svg.hashsalt": "reobserve",
        "path.simplify": True,
    }
)

# Only the fonts that come with matplotlib: a font of the same name on this machine may differ.
_BUNDLED = matplotlib.get_data_path()
font_manager.fontManager.ttflist = [
    font for font in font_manager.fontManager.ttflist if font.fname.startswith(_BUNDLED)
]

# What would differ from build to build, by format.
_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
}


@dataclass(frozen=True)
class Style:
    """A line that is told from the others without colour: by dash, width and lightness."""

    color: str
    linestyle: Any = "-"
    linewidth: float = 1.1
    marker: str = ""

    def line(self) -> dict[str, Any]:
        """Keyword arguments for ``Axes.plot`` without markers."""
        return {"color": self.color, "linestyle": self.linestyle, "linewidth": self.linewidth}

    def points(self) -> dict[str, Any]:
        """Keyword arguments for ``Axes.plot`` with markers."""
        return {**self.line(), "marker": self.marker, "markersize": 4}


TRUTH = Style("0.70", "-", 3.0)
STYLES = (
    Style("#1a1a1a", "-", 1.0, "o"),
    Style("#c4500a", (0, (5, 1.5)), 1.2, "s"),
    Style("#2a7fc1", (0, (1.5, 1.2)), 1.3, "^"),
    Style("#7a5195", (0, (5, 1.5, 1, 1.5)), 1.2, "D"),
    Style("#5b8c2a", (0, (8, 2)), 1.2, "v"),
)


def new_figure(heights: tuple[float, ...], *, share_time: bool = True) -> tuple[Figure, list[Axes]]:
    """A figure of text width with one panel a row; ``heights`` in inches."""
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.35))
    axes = figure.subplots(len(heights), 1, sharex=share_time, height_ratios=heights, squeeze=False)
    return figure, list(axes[:, 0])


def thin(time: Array, values: Array, buckets: int = 1200) -> tuple[Array, Array]:
    """Fewer points with the same picture: the least and the greatest of each bucket, in order.

    There are ``buckets`` of them or a few more; a series of less than four points a bucket is
    left alone.
    """
    size = len(time) // buckets
    if size < 4:
        return time, values
    first = np.arange(len(time) // size) * size
    block = values[: len(first) * size].reshape(len(first), size)
    kept = [first + block.argmin(axis=1), first + block.argmax(axis=1)]
    rest = np.arange(len(first) * size, len(time))
    index = np.unique(np.concatenate([[0], *kept, rest]))
    return time[index], values[index]


def envelope(time: Array, size: Array, width: float) -> tuple[Array, Array]:
    """The largest value in each bin of ``width`` seconds, gaps left out."""
    per_bin = max(1, round(width / (time[1] - time[0])))
    bins = len(time) // per_bin
    blocks = size[: bins * per_bin].reshape(bins, per_bin)
    return time[: bins * per_bin : per_bin], np.fmax.reduce(blocks, axis=1)


def time_axis(axes: Axes, time: Array) -> None:
    """The axis of panels over time, from end to end of a record."""
    axes.set_xlabel("time [s]")
    axes.set_xlim(time[0], time[-1])


def headroom(axes: Axes, share: float) -> None:
    """Room for the legend above the curves."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + share * (high - low))


def few_ticks(axes: Axes, levels: Sequence[float]) -> None:
    """Label these levels on a logarithmic axis of abscissae, and no others."""
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.set_xticks(levels)


def decades(axis: Axis) -> None:
    """Label whole powers of ten of a logarithmic axis, in plain letters: mathtext is slow."""
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

    def label(value: float, _: float) -> str:
        return "10" + str(round(np.log10(value))).translate(raised)

    axis.set_major_formatter(label)
    axis.set_minor_formatter(NullFormatter())


def add_note(figure: Figure, text: str) -> None:
    """Small print under the panels: what was chosen where the paper is silent."""
    figure.supxlabel(text, fontsize=6.3, color="0.35", x=0.012, ha="left", linespacing=1.35)


def fix_layout(figure: Figure) -> None:
    """Place the panels now and for good: every format gets the same layout, computed once."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")


def save(figure: Figure, path: Path) -> None:
    """Write the format of the path's suffix, whole or not at all, without dates or versions.

    Raises
    ------
    InputError
        If the format is none of ours or the folder cannot be written.
    """
    kind = path.suffix.removeprefix(".")
    if kind not in _METADATA:
        raise InputError(str(path), f"must end in one of .{', .'.join(_METADATA)}")
    write_whole(
        path, lambda partial: figure.savefig(partial, format=kind, metadata=_METADATA[kind])
    )

"""Parts of figures: panels, line styles that differ without colour, axes, notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from reobserve_papers.plotting import style_sheet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Style:
    """A line style that differs from the others without colour: by dash, width and lightness."""

    color: str
    linestyle: Any = "-"
    linewidth: float = 1.1
    marker: str = ""

    def line(self) -> dict[str, Any]:
        """Keyword arguments for ``Axes.plot`` without markers."""
        width = style_sheet.thick(self.linewidth)
        return {"color": self.color, "linestyle": self.linestyle, "linewidth": width}

    def points(self) -> dict[str, Any]:
        """Keyword arguments for ``Axes.plot`` with markers."""
        return {**self.line(), "marker": self.marker, "markersize": style_sheet.mark(4)}


TRUTH = Style("0.70", "-", 3.0)
STYLES = (
    Style("#1a1a1a", "-", 1.0, "o"),
    Style("#c4500a", (0, (5, 1.5)), 1.2, "s"),
    Style("#2a7fc1", (0, (1.5, 1.2)), 1.3, "^"),
    Style("#7a5195", (0, (5, 1.5, 1, 1.5)), 1.2, "D"),
    Style("#5b8c2a", (0, (8, 2)), 1.2, "v"),
)


class PaperFigure(Figure):
    """A figure that remembers what narrower styles put elsewhere.

    Attributes
    ----------
    note
        What stands below the panels, or in the caption, by paragraph.
    bare
        The limits of ordinates without headroom for the legend, where there is some.
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.note: tuple[str, ...] = ()
        self.bare: dict[Axes, tuple[float, float]] = {}


def blank(height: float) -> PaperFigure:
    """A figure as wide as the style, without panels, ``height`` in inches at the default width."""
    return PaperFigure(figsize=style_sheet.size(height))


def new_figure(
    heights: tuple[float, ...], *, share_time: bool = True
) -> tuple[PaperFigure, list[Axes]]:
    """A figure as wide as the style with one panel a row, ``heights`` in inches."""
    figure = blank(sum(heights) + 0.35)
    axes = figure.subplots(len(heights), 1, sharex=share_time, height_ratios=heights, squeeze=False)
    return figure, list(axes[:, 0])


def mosaic(
    rows: Sequence[Sequence[str]], height: float, *, stacked: Mapping[str, float], **ratios: Any
) -> tuple[PaperFigure, dict[str, Axes]]:
    """A figure with panels by name, as in ``rows``, of relative ``ratios``.

    Where a style is too narrow for panels side by side they go below each other, all in the order
    and of the heights in inches that ``stacked`` says.
    """
    if style_sheet.narrow():
        figure, panels = new_figure(tuple(stacked.values()), share_time=False)
        return figure, dict(zip(stacked, panels, strict=True))
    figure = blank(height)
    return figure, figure.subplot_mosaic([list(row) for row in rows], **ratios)


def thin(time: Array, values: Array, buckets: int = 1200) -> tuple[Array, Array]:
    """Fewer points with the same plot: the minimum and the maximum of each bucket, in order.

    There are ``buckets`` of them or a few more; a series of less than four points a bucket is
    left alone.
    """
    size = len(time) // buckets
    if size < 4:
        return time, values
    first = np.arange(len(time) // size) * size
    block = values[: len(first) * size].reshape(len(first), size)
    extremes = [first + block.argmin(axis=1), first + block.argmax(axis=1)]
    rest = np.arange(len(first) * size, len(time))
    index = np.unique(np.concatenate([[0], *extremes, rest]))
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


def headroom(
    axes: Axes, share: float = 0.0, *, factor: float = 1.0, to: float | None = None
) -> None:
    """Space for the legend above the curves: a share of the height, a factor, or a new limit."""
    low, high = axes.get_ylim()
    if isinstance(axes.figure, PaperFigure):
        axes.figure.bare[axes] = (low, high)
    if to is None:
        to = factor * high if factor != 1.0 else high + share * (high - low)
    axes.set_ylim(low, to)


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


def add_note(figure: PaperFigure, *paragraphs: str) -> None:
    """Footnotes under the panels: what was chosen where the paper is silent.

    Lines are broken where the paragraphs are; in a narrower style also elsewhere.
    """
    figure.note = paragraphs


def note_of(figure: PaperFigure) -> str:
    """The note as running text, or nothing if the figure has none."""
    notes = [" ".join(line.split()) for line in figure.note]
    joined = [note if note.endswith((".", ":", ";")) else f"{note};" for note in notes[:-1]]
    return " ".join([*joined, *notes[-1:]])

"""A figure made ready to be saved: its note placed, what does not fit adjusted, the layout fixed.

Figures are made for the default style. Where a sheet leaves less space, titles, labels and
notes are broken into more lines, legends that cover something go between title and panel, labels
of ticks that touch are left out, and the figure grows by what that takes.
"""

from __future__ import annotations

import re
import warnings
from itertools import pairwise
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import LayoutEngine
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.ticker import Formatter, Locator
from matplotlib.transforms import Bbox

from reobserve_papers.plotting.figures import PaperFigure
from reobserve_papers.plotting.style_sheet import as_designed, laid_out, points

_EDGE = 0.012  # of the width, beside a note
_PANELS = 0.62  # of the height that a figure asks for, at least, which its panels have
_ROUNDS = 4  # a broken title moves the panels, which moves what fits
_GAP = 2.0  # points between what must not touch
_DPI = 400  # at which text is measured: at fewer its letters are put on whole pixels
_SLACK = 0.96  # of its space, which text takes at most: at other resolutions it is wider


def fix_layout(figure: Figure, *, notes: bool = True) -> None:
    """Place the panels now and for good: every format gets the same layout, computed once."""
    engine = figure.get_layout_engine()
    fits = as_designed()
    if not fits:
        figure.set_dpi(_DPI)
    paragraphs = figure.note if notes and isinstance(figure, PaperFigure) else ()
    if paragraphs:
        note = figure.supxlabel(
            "\n".join(paragraphs), fontsize=points(6.3), color="0.35", x=_EDGE, ha="left",
            linespacing=1.35,
        )  # fmt: skip
        if not fits:
            measure, wide = _Measure(figure), figure.bbox.width * (1 - 2 * _EDGE)
            note.set_text("\n".join(measure.broken(text, note, wide) for text in paragraphs))
    if engine is not None:
        if not fits:
            _fit(figure, engine)
        engine.execute(figure)
        with laid_out():
            figure.set_layout_engine(None)


def _fit(figure: Figure, engine: LayoutEngine) -> None:
    measure, designed = _Measure(figure), figure.get_figheight()
    asked = _PANELS * designed
    labels: dict[Axis, tuple[Locator, Formatter]] = {}
    for done in range(_ROUNDS):
        for axis, (locator, formatter) in labels.items():
            axis.set_major_locator(locator)
            axis.set_major_formatter(formatter)
        for axes in figure.axes:
            if (legend := axes.get_legend()) is not None:  # one that is too wide leaves no panel
                legend.set_in_layout(done > 0)
        _place(figure, engine)
        for legend in figure.legends:
            _fewer_columns(measure, figure, legend)
        for axes in figure.axes:
            _break_texts(measure, figure, axes)
            _lift_legend(measure, axes, only_wide=not done)
            if done:
                for axis in (axes.xaxis, axes.yaxis):
                    labels.setdefault(axis, (axis.get_major_locator(), axis.get_major_formatter()))
                    if axis is axes.xaxis or not _in_words(axis):
                        _fewer_labels(measure, axis)
        _place(figure, engine)
        asked = max([asked, *(_crowded(measure, axes) * _height(figure) for axes in figure.axes)])
        figure.set_figheight(max(designed, figure.get_figheight() + asked - _height(figure)))


_WORD = re.compile(r"(?:\[[^\]]*\]|\S)+")  # a unit in its brackets is one


def _place(figure: Figure, engine: LayoutEngine) -> None:
    """Lay the panels out, in a figure high enough to hold what stands around them."""
    for _ in range(_ROUNDS):
        with warnings.catch_warnings(record=True) as collapsed:
            warnings.simplefilter("always")
            engine.execute(figure)
        if not collapsed:
            break
        figure.set_figheight(1.3 * figure.get_figheight())


def _height(figure: Figure) -> float:
    """Inches of the figure's height at which there are panels."""
    total = top = 0.0
    for low, high in sorted(axes.get_position().intervaly.tolist() for axes in figure.axes):
        total += max(high - max(low, top), 0.0)
        top = max(top, high)
    return total * figure.get_figheight()


class _Measure:
    """Sizes of parts of a figure, in pixels."""

    def __init__(self, figure: Figure) -> None:
        canvas: Any = FigureCanvasAgg(figure)  # whose methods matplotlib does not annotate
        self.renderer = canvas.get_renderer()
        self.gap = _GAP * figure.dpi / 72
        self._whole: dict[Text, str] = {}

    def box(self, artist: Text | Legend | Axes) -> Bbox:
        """The place of an artist."""
        box: Bbox = artist.get_window_extent(self.renderer)
        return box

    def broken(self, running: str, text: Text, space: float) -> str:
        """Running text with line breaks so that each line fits, as far as words allow it."""
        lines: list[str] = []
        space *= _SLACK
        for word in _WORD.findall(running):
            longer = " ".join([*lines[-1:], word])
            wide, *_ = self.renderer.get_text_width_height_descent(
                longer, text.get_fontproperties(), ismath=False
            )
            lines[-1:] = [longer] if wide <= space or not lines else [*lines[-1:], word]
        return "\n".join(lines)

    def break_up(self, text: Text, space: float) -> None:
        """Break a text that is longer than its space."""
        whole = self._whole.setdefault(text, text.get_text())
        text.set_text(whole)
        box = self.box(text)
        if whole and (box.height if text.get_rotation() == 90 else box.width) > _SLACK * space:
            text.set_text(self.broken(whole, text, space))


def _break_texts(measure: _Measure, figure: Figure, axes: Axes) -> None:
    """The title, which ends where the next panel begins, the labels, and what stands inside."""
    box = measure.box(axes)
    places = [(other, measure.box(other)) for other in figure.axes if other is not axes]
    neighbours = [(o, place) for o, place in places if place.y0 < box.y1 and box.y0 < place.y1]
    ends = [
        figure.bbox.width,
        *(place.x0 for _, place in neighbours if place.x0 > box.x0 + measure.gap),
    ]
    measure.break_up(_title(axes), min(ends) - 2 * measure.gap - box.x0)
    alone = not any(other.get_xlabel() for other, _ in neighbours)
    measure.break_up(axes.xaxis.label, (figure.bbox.width if alone else min(ends)) - box.x0)
    measure.break_up(axes.yaxis.label, 1.15 * box.height)
    for text in axes.texts:
        measure.break_up(text, box.width)


def _title(axes: Axes) -> Text:
    """The title on the left."""
    title = axes.get_title(loc="left")
    return next(
        text
        for text in axes.get_children()
        if isinstance(text, Text) and text not in axes.texts and text.get_text() == title
    )


def _lift_legend(measure: _Measure, axes: Axes, *, only_wide: bool) -> None:
    """Put a legend between title and panel if it is too wide, or lies on what it tells of."""
    legend = axes.get_legend()
    if legend is None:
        return
    lifted = legend.get_gid() == _LIFTED
    in_the_way = _too_wide if only_wide else _in_the_way
    if not (lifted or in_the_way(measure, axes, legend)):
        return
    if isinstance(axes.figure, PaperFigure) and axes in axes.figure.bare:
        axes.set_ylim(axes.figure.bare.pop(axes))
    handles, labels = axes.get_legend_handles_labels()
    space = measure.box(axes).width
    for columns in range(len(labels), 0, -1):
        legend = axes.legend(
            handles, labels, ncols=columns, loc="lower left", bbox_to_anchor=(0.0, 1.0),
            borderaxespad=0.15, borderpad=0.0, columnspacing=1.2,
        )  # fmt: skip
        if measure.box(legend).width <= space:
            break
    legend.set_gid(_LIFTED)
    if text := _title(axes).get_text():
        above = measure.box(legend).height * 72 / axes.figure.dpi
        pad = above + matplotlib.rcParams["axes.titlepad"]
        axes.set_title(text, loc="left", pad=pad, fontsize=_title(axes).get_fontsize())


_LIFTED = "lifted legend"


def _too_wide(measure: _Measure, axes: Axes, legend: Legend) -> bool:
    """True if a legend sticks out to a side."""
    box, panel = measure.box(legend), measure.box(axes)
    return bool(
        box.x0 < min(panel.x0 - measure.gap, measure.gap) or box.x1 > panel.x1 + measure.gap
    )


def _in_the_way(measure: _Measure, axes: Axes, legend: Legend) -> bool:
    """True if a legend sticks out to a side, covers lines or bands, the title or a label."""
    box, panel = measure.box(legend), measure.box(axes)
    if _too_wide(measure, axes, legend):
        return True
    if _title(axes).get_text() and box.overlaps(measure.box(_title(axes))):
        return True
    if axes.get_xlabel() and box.overlaps(measure.box(axes.xaxis.label)):
        return True
    if box.y1 > panel.y1 + measure.gap:
        return False
    return any(
        path.transformed(artist.get_transform()).intersects_bbox(box, filled=filled)
        for artist, paths, filled in (
            *((line, [line.get_path()], False) for line in axes.lines),
            *((band, band.get_paths(), True) for band in axes.collections),
        )
        for path in paths
        if len(np.asarray(path.vertices))
    )


def _fewer_columns(measure: _Measure, figure: Figure, legend: Legend) -> None:
    """A legend of the whole figure, above it, with as many columns as fit."""
    if measure.box(legend).width <= figure.bbox.width:
        return
    labels = [text.get_text() for text in legend.get_texts()]
    known = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    handles = [known[label] for label in labels]
    legend.remove()
    for columns in range(len(labels), 0, -1):
        fewer = figure.legend(
            handles, labels, ncols=columns, loc="outside upper left", columnspacing=1.2
        )
        if measure.box(fewer).width <= figure.bbox.width:
            return
        if columns > 1:
            fewer.remove()


def _fewer_labels(measure: _Measure, axis: Axis) -> None:
    """Label every second tick, or third, so that no two labels touch."""
    ticks, shown = _labelled(axis)
    boxes = [measure.box(tick.label1).padded(measure.gap / 2) for tick in shown]
    step = 1
    while any(left.overlaps(right) for left, right in pairwise(boxes[::step])):
        step += 1
    if step > 1:
        labels = {tick.get_loc(): tick.label1.get_text() for tick in shown[::step]}
        places = [tick.get_loc() for tick in ticks]
        axis.set_ticks(places, [labels.get(place, "") for place in places])


def _labelled(axis: Axis) -> tuple[list[Tick], list[Tick]]:
    """The ticks that are seen, and those of them with a label."""
    low, high = sorted(axis.get_view_interval())
    ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    return ticks, [t for t in ticks if t.label1.get_visible() and t.label1.get_text()]


def _in_words(axis: Axis) -> bool:
    """True if ticks are named, so that none of them can do without its label."""
    texts = (tick.label1.get_text() for tick in _labelled(axis)[1])
    return any(a.isalpha() and b.isalpha() for text in texts for a, b in pairwise(text))


def _crowded(measure: _Measure, axes: Axes) -> float:
    """The factor by which a panel must be higher for the names beside it."""
    if not _in_words(axes.yaxis):
        return 1.0
    heights = [measure.box(tick.label1).height for tick in _labelled(axes.yaxis)[1]]
    return max(1.0, sum(heights) / float(measure.box(axes).height))

"""Fitting: in a smaller style nothing overlaps, is clipped or lost."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from reobserve_papers.plotting import fitting
from reobserve_papers.plotting.figures import (
    STYLES,
    PaperFigure,
    add_note,
    headroom,
    mosaic,
    new_figure,
    note_of,
)
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.style_sheet import use_sheet
from tests import ROOT

COLUMN = ROOT / "config" / "styles" / "ieee-column.mplstyle"
TIME = np.linspace(0, 10, 200)
NOTE = (
    "A note that is much longer than a line of a narrow column can be, and says what was chosen "
    "where the paper is silent [1], [2 and 3]."
)
TITLE = "(a) a title that is as long as a default line of text, that is 6.6 inches, and not of 3.5"


def drawing() -> PaperFigure:
    """A long title, a legend that covers a line, many ticks, a word on each of many rows."""
    figure, (above, below) = new_figure((1.5, 2.0), share_time=False)
    for k, style in enumerate(STYLES[:3]):
        label = f"an observer whose name is long, {k}"
        above.plot(TIME, np.sin(TIME + k), **style.line(), label=label)
    above.set_title(TITLE)
    above.set_ylabel("a label [N m]")
    headroom(above, 0.5)
    above.legend(loc="upper left", ncols=2)
    above.set_xticks(np.arange(0, 10.1, 0.5))
    rows = 24
    below.plot(np.arange(rows), np.arange(rows), **STYLES[1].points())
    below.set_yticks(range(rows), [f"row {chr(65 + k)}" for k in range(rows)])
    add_note(figure, NOTE, "A paragraph of its own.")
    return figure


def extents(artists: list[Text]) -> list[Bbox]:
    figure = artists[0].get_figure(root=True)
    assert isinstance(figure, Figure)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    return [artist.get_window_extent(renderer) for artist in artists]


def labels(axes: Axes, which: str) -> list[Text]:
    axis = axes.xaxis if which == "x" else axes.yaxis
    low, high = sorted(axis.get_view_interval())
    ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    return [tick.label1 for tick in ticks if tick.label1.get_text()]


@pytest.fixture
def fitted() -> PaperFigure:
    use_sheet(COLUMN)
    figure = drawing()
    fix_layout(figure)
    return figure


def test_everything_lies_within_the_figure(fitted: PaperFigure) -> None:
    texts = [text for text in fitted.findobj(Text) if text.get_text() and text.get_visible()]
    shown = [text for text in texts if text not in hidden(fitted)]
    for text, box in zip(shown, extents(shown), strict=True):
        assert box.x0 >= -1, text
        assert box.x1 <= fitted.bbox.width + 1, text


def hidden(figure: Figure) -> list[Text]:
    """Tick labels beyond the limits, which are not drawn."""
    found = []
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                found += (
                    [tick.label2] if low <= tick.get_loc() <= high else [tick.label1, tick.label2]
                )
    return found


def test_legend_lies_between_title_and_panel(fitted: PaperFigure) -> None:
    above = fitted.axes[0]
    legend = above.get_legend()
    assert legend is not None
    (title,) = [text for text in fitted.findobj(Text) if text.get_text().startswith("(a) a title")]
    place = legend.get_window_extent()
    panel, words = above.get_window_extent(), extents([title])[0]
    assert panel.y1 <= place.y0 < place.y1 <= words.y0
    assert " ".join(title.get_text().split()) == TITLE
    assert [text.get_text()[-1] for text in legend.get_texts()] == ["0", "1", "2"]
    assert above.get_ylim()[1] < 1.2, "no space for a legend that is in another place"


def test_tick_labels_do_not_overlap_and_no_name_is_lost(fitted: PaperFigure) -> None:
    above, below = fitted.axes
    shown = labels(above, "x")
    assert 4 <= len(shown) < 21
    assert not any(one.overlaps(other) for one, other in pairwise(extents(shown)))
    names = labels(below, "y")
    assert len(names) == 24
    heights = [box.y0 for box in extents(names)]
    assert min(np.abs(np.diff(heights))) >= 0.75 * extents(names)[0].height


def test_note_is_rewrapped_or_omitted() -> None:
    use_sheet(COLUMN)
    inside, outside = drawing(), drawing()
    fix_layout(inside)
    fix_layout(outside, notes=False)
    note = inside.get_supxlabel()
    assert len(note.splitlines()) >= 3
    assert note.endswith("\nA paragraph of its own.")
    assert " ".join(note.split()) == note_of(inside) == f"{NOTE} A paragraph of its own."
    assert outside.get_supxlabel() == ""
    assert note_of(outside) == note_of(inside)


def test_line_that_fits_exactly_is_not_wrapped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "_SLACK", 1.0)
    figure = drawing()
    measure, text = fitting._Measure(figure), figure.axes[0].title
    words = "three words [N m]"
    wide, *_ = measure.renderer.get_text_width_height_descent(
        words, text.get_fontproperties(), ismath=False
    )
    assert measure.broken(words, text, wide) == words
    assert measure.broken(words, text, np.nextafter(wide, 0.0)) == "three words\n[N m]"


def test_line_breaks_and_a_legend_are_kept_if_they_fit() -> None:
    use_sheet(COLUMN)
    figure, (panel,) = new_figure((1.5,))
    panel.plot(TIME, TIME, label="a line")
    legend = panel.legend(loc="lower right")
    panel.set_xlabel("two\nlines")
    fix_layout(figure)
    assert panel.get_legend() is legend
    assert panel.get_xlabel() == "two\nlines"


def test_second_axis_does_not_reduce_the_title_width() -> None:
    def lines(*, second: bool) -> int:
        figure, (panel,) = new_figure((1.5,))
        panel.plot(TIME, TIME)
        panel.set_title(TITLE)
        if second:
            panel.twinx().plot(TIME, -TIME)
        fix_layout(figure)
        return len(panel.get_title(loc="left").splitlines())

    use_sheet(COLUMN)
    assert lines(second=True) == lines(second=False) == 2


def test_default_style_figure_is_unchanged() -> None:
    figure = drawing()
    fix_layout(figure)
    assert figure.get_size_inches() == pytest.approx([6.6, 3.85])
    assert figure.get_supxlabel() == f"{NOTE}\nA paragraph of its own."
    assert figure.axes[0].get_title(loc="left") == TITLE
    assert len(labels(figure.axes[0], "x")) == 21


def test_side_by_side_panels_are_stacked_in_a_column() -> None:
    def places() -> list[Bbox]:
        figure, panels = mosaic([["a", "b"]], 2.0, stacked={"a": 1.5, "b": 2.0})
        fix_layout(figure)
        return [panels[name].get_position() for name in "ab"]

    left, right = places()
    assert left.x1 < right.x0
    use_sheet(COLUMN)
    top, bottom = places()
    assert bottom.y1 < top.y0
    assert not any(one.overlaps(other) for one, other in combinations((top, bottom), 2))

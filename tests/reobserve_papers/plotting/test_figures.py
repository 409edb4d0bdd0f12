"""Plots: reproducible bytes, thinning without loss, lines distinguishable without colour."""

from __future__ import annotations

import itertools
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib import font_manager
from matplotlib.colors import to_rgb

from reobserve.core.errors import InputError
from reobserve_papers.plotting.figures import (
    STYLES,
    TRUTH,
    Style,
    decades,
    envelope,
    few_ticks,
    new_figure,
    thin,
)
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.formats import save


def lightness(color: str) -> float:
    return float(np.dot(to_rgb(color), [0.2126, 0.7152, 0.0722]))


def test_lines_are_distinguishable_without_colour() -> None:
    """Lines differ by dash and marker, and from the truth by lightness and width."""
    dashes = [str(style.linestyle) for style in STYLES]
    markers = [style.marker for style in STYLES]
    assert len(set(dashes)) == len(set(markers)) == len(STYLES)
    for style in STYLES:
        assert lightness(TRUTH.color) - lightness(style.color) > 0.2
        assert TRUTH.linewidth > 2 * style.linewidth
    for one, other in itertools.combinations(STYLES, 2):
        assert Style(one.color, one.linestyle) != Style(other.color, other.linestyle)


# Properties of every figure in the default style, and the reasons.
LOOK = {
    "axes.grid": (True, "numbers can be read off print"),
    "axes.spines.top": (False, "a frame says nothing"),
    "axes.spines.right": (False, "a frame says nothing"),
    "axes.titlelocation": ("left", "titles are read as text"),
    "legend.frameon": (False, "a legend hides no line"),
    "figure.constrained_layout.use": (True, "no label is clipped"),
    "path.simplify": (True, "files of long records stay small"),
    "pdf.fonttype": (42, "journals take no fonts of type 3"),
    "svg.hashsalt": ("reobserve", "the same bytes each time"),
    "font.family": (["DejaVu Sans"], "comes with matplotlib, so it is on every machine"),
    "mathtext.fontset": ("dejavusans", "formulas look like text"),
}


@pytest.mark.parametrize("name", LOOK)
def test_every_figure_has_the_project_style(name: str) -> None:
    wanted, why = LOOK[name]
    assert matplotlib.rcParams[name] == wanted, why


def test_envelope_has_the_maximum_of_each_complete_bin() -> None:
    size = np.array([1.0, 3.0, 2.0, np.nan, 0.5, 0.25, np.nan, np.nan, np.nan, 9.0])
    begins, largest = envelope(0.1 * np.arange(10), size, 0.3)
    assert begins == pytest.approx([0.0, 0.3, 0.6])
    np.testing.assert_array_equal(largest, [3.0, 0.5, np.nan])
    np.testing.assert_array_equal(envelope(0.1 * np.arange(10), size, 0.01)[1], size)


def test_figure_is_sized_for_print() -> None:
    """On the page without scaling: text of 7 to 9 points, a grid below all lines."""
    figure, panels = new_figure((1.0, 2.0))
    assert figure.axes == panels
    assert len(panels) == 2
    assert figure.get_size_inches() == pytest.approx([6.6, 3.35])
    sizes = [matplotlib.rcParams[f"{part}size"] for part in ("font.", "axes.label", "axes.title")]
    assert all(7 <= size <= 9 for size in [*sizes, matplotlib.rcParams["legend.fontsize"]])
    assert lightness(matplotlib.rcParams["grid.color"]) > lightness(TRUTH.color)
    assert matplotlib.rcParams["grid.linewidth"] < matplotlib.rcParams["lines.linewidth"]
    assert matplotlib.rcParams["savefig.dpi"] >= 150


def test_thinning_keeps_all_extremes() -> None:
    rng = np.random.default_rng(1)
    time, values = np.arange(50_003.0), rng.normal(size=50_003)
    values[[7, 31_234, 50_002]] = [90, -80, 70]
    fewer_time, fewer = thin(time, values)
    assert len(fewer) < 2 * 1200 + 100
    assert np.all(np.diff(fewer_time) > 0)
    assert np.array_equal(np.interp(fewer_time, time, values), fewer)
    size = 50_003 // 1200
    for start in range(0, 50_003 - size, size):
        inside = (fewer_time >= start) & (fewer_time < start + size)
        block = values[start : start + size]
        assert fewer[inside].max() == block.max()
        assert fewer[inside].min() == block.min()
    assert {90, -80, 70} <= set(fewer)


def test_short_series_are_not_thinned() -> None:
    time = np.arange(100.0)
    assert thin(time, time)[0] is time


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_figure_files_are_reproducible(tmp_path: Path, suffix: str) -> None:
    def drawn(name: str) -> bytes:
        figure, (axes,) = new_figure((2.0,))
        axes.plot([0, 1], [0, 1], **STYLES[1].points(), label="Γ τ K₁")
        axes.legend()
        fix_layout(figure)
        save(figure, tmp_path / f"{name}.{suffix}")
        return (tmp_path / f"{name}.{suffix}").read_bytes()

    first = drawn("first")
    assert first == drawn("second")
    assert len(first) > 1000
    for word in (b"Creat", b"Producer", b"Software", b"dc:date", matplotlib.__version__.encode()):
        assert word not in first


def test_unknown_format_is_named(tmp_path: Path) -> None:
    figure, _ = new_figure((2.0,))
    with pytest.raises(InputError, match=r"fig\.gif: must end in one of \.pdf, \.svg, \.png"):
        save(figure, tmp_path / "fig.gif")
    assert list(tmp_path.iterdir()) == []


def test_only_bundled_fonts_are_used() -> None:
    bundled = matplotlib.get_data_path()
    fonts = font_manager.fontManager.ttflist
    assert fonts
    assert all(font.fname.startswith(bundled) for font in fonts)
    assert font_manager.findfont("DejaVu Sans").startswith(bundled)


def test_logarithmic_axis_is_labelled_by_powers_of_ten() -> None:
    _, (axes,) = new_figure((2.0,))
    axes.set_xscale("log")
    decades(axes.xaxis)
    label = axes.xaxis.get_major_formatter()
    assert [label(value, 0) for value in (1e-12, 0.001, 1.0, 1e3, 1e10)] == [
        "10⁻¹²", "10⁻³", "10⁰", "10³", "10¹⁰",
    ]  # fmt: skip
    assert axes.xaxis.get_minor_formatter()(3.0, 0) == ""


def test_only_a_few_ticks_are_labelled() -> None:
    _, (axes,) = new_figure((1.0,))
    axes.set_xscale("log")
    axes.set_xlim(0.05, 30)
    few_ticks(axes, [0.1, 0.5, 20])
    axes.figure.draw_without_rendering()
    labels = [tick.get_text() for tick in axes.get_xticklabels(which="both")]
    assert [text for text in labels if text] == ["0.1", "0.5", "20"]

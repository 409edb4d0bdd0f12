"""Style sheets: those of the project, those of users, and how an invalid one is refused."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import pytest

from reobserve.core.errors import InputError
from reobserve_papers.parameters.config import known_styles
from reobserve_papers.plotting import style_sheet
from reobserve_papers.plotting.figures import STYLES, new_figure
from tests import ROOT

SHEETS = ROOT / "config" / "styles"

# Publishers' requirements: the width in inches, and the minimum text size in points.
# IEEE: 3.5 and 7.16 inches. Elsevier: 90 and 190 mm, text of 7 points.
ASKED = {
    "default": (6.6, 7.5),
    "ieee-column": (3.5, 7),
    "ieee-page": (7.16, 7),
    "elsevier-column": (90 / 25.4, 6.5),
    "elsevier-page": (190 / 25.4, 6.5),
    "slides": (10, 12),
}
TEXTS = ("font.size", "axes.labelsize", "axes.titlesize", "legend.fontsize")


def test_every_style_sheet_belongs_to_a_publisher_format() -> None:
    assert known_styles(ROOT) == sorted(ASKED)


@pytest.mark.parametrize("name", ASKED)
def test_style_sheet_meets_required_width_and_text_size(name: str) -> None:
    style_sheet.use_sheet(SHEETS / f"{name}.mplstyle")
    width, least = ASKED[name]
    figure, _ = new_figure((2.0,))
    assert figure.get_figwidth() == pytest.approx(width, abs=0.5 / 72)
    assert all(matplotlib.rcParams[text] >= least for text in TEXTS)
    assert matplotlib.rcParams["pdf.fonttype"] == matplotlib.rcParams["ps.fonttype"] == 42


def test_default_style_sheet_states_exactly_the_project_style() -> None:
    style_sheet.use_sheet(SHEETS / "default.mplstyle")
    assert style_sheet.as_designed()


def test_style_sheet_is_applied_on_the_default_style_only(tmp_path: Path) -> None:
    first, second = tmp_path / "first.mplstyle", tmp_path / "second.mplstyle"
    first.write_text("font.size: 10\nlines.linewidth: 2.2 # twice\n")
    second.write_text('grid.color: "0.5"\n\n# nothing more\n')
    style_sheet.use_sheet(first)
    assert not style_sheet.as_designed()
    assert style_sheet.points(8.5) == 10
    assert STYLES[0].line()["linewidth"] == 2.0
    usual = matplotlib.rcParamsDefault["lines.markersize"]
    assert style_sheet.mark(2.0) == 2.0
    first.write_text(f"lines.markersize: {1.5 * style_sheet.mark(usual)}\n")
    style_sheet.use_sheet(first)
    assert style_sheet.mark(2.0) == 3.0
    style_sheet.use_sheet(second)
    assert matplotlib.rcParams["font.size"] == 8.5
    assert matplotlib.rcParams["grid.color"] == "0.5"
    style_sheet.use_sheet(None)
    assert style_sheet.as_designed()
    assert style_sheet.points(7) == 7.0
    assert STYLES[0].line()["linewidth"] == 1.0


def test_small_text_stays_legible(tmp_path: Path) -> None:
    """6.3 points by default would become 3.7; text below 6 points by default is only scaled."""
    sheet = tmp_path / "small.mplstyle"
    sheet.write_text("font.size: 5\n")
    style_sheet.use_sheet(sheet)
    assert style_sheet.points(6.3) == 6.0
    assert style_sheet.points(8.5) == 6.0


def test_panels_are_stacked_in_narrow_styles() -> None:
    found = {}
    for name in ASKED:
        style_sheet.use_sheet(SHEETS / f"{name}.mplstyle")
        found[name] = style_sheet.narrow()
    assert {name for name, narrow in found.items() if narrow} == {"ieee-column", "elsevier-column"}


REFUSED = {
    "font.size 8": "line 2: 'font.size 8' must be KEY: VALUE",
    "font.size: large": "line 2: font.size: .*large.*",
    "fontsize: 8": "line 2: there is no parameter 'fontsize'",
    "font.size: 8\nfont.size: 9": "line 3: font.size stands there twice",
    "font.size: 400": "line 2: font.size, in points: 400 must be from 3 to 72",
    "font.size: nan": "line 2: font.size, in points: nan must be from 3 to 72",
    "font.family: Comic Sans": "line 2: font.family: 'Comic Sans' does not come with matplotlib",
    "font.serif: Times": "line 2: font.serif: 'Times' does not come with matplotlib",
    "figure.figsize: 0.1, 3": "line 2: figure.figsize, width in inches: 0.1 must be from 1 to 40",
    "figure.figsize: 3, 99": "line 2: figure.figsize, height in inches: 99 must be from 0.5 to 40",
    "figure.figsize: 3": "line 2: figure.figsize: .*",
    "figure.constrained_layout.use: False": "line 2: .*must be True, so that no label is clipped",
    "text.usetex: True": "line 2: text.usetex: 'True' must be False, so that no LaTeX is needed",
    "savefig.bbox: tight": "line 2: savefig.bbox: 'tight' must be None, so that the width is",
    "pdf.fonttype: 3": "line 2: pdf.fonttype: '3' must be 42, which journals take",
    "backend: agg": "line 2: backend is no matter of looks",
}


@pytest.mark.parametrize("lines", REFUSED)
def test_invalid_style_sheet_is_reported_with_the_line(tmp_path: Path, lines: str) -> None:
    sheet = tmp_path / "mine.mplstyle"
    sheet.write_text(f"# mine\n{lines}\n")
    with pytest.raises(InputError, match=rf"mine\.mplstyle: {REFUSED[lines]}") as refused:
        style_sheet.use_sheet(sheet)
    assert "\n" not in str(refused.value)
    assert style_sheet.as_designed(), "nothing of it is used"


def test_generic_and_bundled_fonts_are_accepted(tmp_path: Path) -> None:
    sheet = tmp_path / "mine.mplstyle"
    sheet.write_text("font.family: serif\nfont.serif: STIXGeneral, DejaVu Serif\n")
    assert style_sheet.read_sheet(sheet) == {
        "font.family": ["serif"], "font.serif": ["STIXGeneral", "DejaVu Serif"],
    }  # fmt: skip


def test_unreadable_style_sheet_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.mplstyle: cannot be read"):
        style_sheet.use_sheet(tmp_path / "none.mplstyle")
    (tmp_path / "bytes.mplstyle").write_bytes(b"font.size: \xff\n")
    with pytest.raises(InputError, match="is not UTF-8"):
        style_sheet.use_sheet(tmp_path / "bytes.mplstyle")

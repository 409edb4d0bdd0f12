"""The default style, and style sheets laid over it: widths, text sizes, fonts.

A sheet is one of matplotlib's. It may change whatever is a matter of looks. What makes a figure
the same bytes everywhere, with its fonts inside and as wide as the sheet says, it may not.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib import font_manager

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.files import read_text

WIDTH = 6.6  # inches: a text width, so that print needs no scaling
_TEXT = 8.5  # points
_LINE = 1.1  # points
_MARKER = 6.0  # points
_SMALLEST = 6.0  # points, below which journals take no text

_PARAMETERS: Any = matplotlib.rcParams  # annotated with each name, which no sheet knows

_OWN: dict[str, Any] = {
    "figure.figsize": (WIDTH, 4.8),
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": _TEXT,
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
    "lines.linewidth": _LINE,
    "lines.markersize": _MARKER,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 160,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "pgf.rcfonts": False,
    "svg.hashsalt": "reobserve",
    "path.simplify": True,
}

# Only the fonts that come with matplotlib: a font of the same name on this machine may differ.
_BUNDLED = matplotlib.get_data_path()
_FONTS = [font for font in font_manager.fontManager.ttflist if font.fname.startswith(_BUNDLED)]
font_manager.fontManager.ttflist = _FONTS

# All parameters, whatever a user's own settings say.
_DEFAULTS: Any = matplotlib.rcParamsDefault
_PARAMETERS.update({key: _DEFAULTS[key] for key in _DEFAULTS if key != "backend"})
_PARAMETERS.update(_OWN)
_DEFAULT = {key: value for key, value in _PARAMETERS.copy().items() if key != "backend"}
_DESIGNED = _DEFAULT["figure.figsize"]
_GENERIC = ("sans-serif", "serif", "monospace")

# What a sheet may state in this way only, and why.
_FIXED: dict[str, tuple[Any, str]] = {
    "figure.constrained_layout.use": (True, "so that no label is clipped"),
    "figure.autolayout": (False, "so that no label is clipped"),
    "savefig.bbox": (None, "so that the width is that of figure.figsize"),
    "text.usetex": (False, "so that no LaTeX is needed"),
    "pdf.fonttype": (42, "which journals take"),
    "pdf.use14corefonts": (False, "so that fonts are embedded"),
    "ps.fonttype": (42, "which journals take"),
    "ps.useafm": (False, "so that fonts are embedded"),
    "ps.usedistiller": (None, "so that no other program is needed"),
    "pgf.rcfonts": (False, "so that the document's fonts are used"),
    "svg.fonttype": ("path", "so that fonts are embedded"),
    "svg.hashsalt": ("reobserve", "so that the bytes repeat"),
}
_NO_LOOK = ("backend", "interactive", "toolbar", "timezone", "webagg", "macosx", "tk")
_WIDTHS, _HEIGHTS, _SIZES = (1.0, 40.0), (0.5, 40.0), (3.0, 72.0)


def laid_out() -> AbstractContextManager[None]:
    """Lay nothing out from here on: a figure with a layout engine is drawn twice for each format.

    Even an engine that does nothing is one; a figure has none only where this says so.
    """
    return matplotlib.rc_context({"figure.constrained_layout.use": False})


def use_sheet(path: Path | None) -> None:
    """Lay a sheet over the default style, in place of any other."""
    sheet = read_sheet(path) if path else {}
    _PARAMETERS.update({**_DEFAULT, **sheet})
    font_manager.fontManager.ttflist = _FONTS


def read_sheet(path: Path) -> dict[str, Any]:
    """The statements of a sheet, by the names of matplotlib's parameters."""
    settings: dict[str, Any] = {}
    for number, key, text in _lines(path):
        place = f"line {number}: {key}"
        if key.startswith(_NO_LOOK):
            raise InputError(str(path), f"{place} is no matter of looks")
        if key not in _DEFAULT:
            near = nearest(key, list(_DEFAULT))
            raise InputError(str(path), f"line {number}: there is no parameter {shown(key)}{near}")
        if key in settings:
            raise InputError(str(path), f"{place} stands there twice")
        try:
            parameters: Any = matplotlib.RcParams({key: text})
            value = parameters[key]
        except ValueError as error:
            reason = re.sub(r"\s+", " ", str(error)).removeprefix(f"Key {key}: ")
            raise InputError(str(path), f"{place}: {reason}") from None
        if key in _FIXED and value != _FIXED[key][0]:
            fixed, why = _FIXED[key]
            raise InputError(str(path), f"{place}: {shown(text)} must be {fixed}, {why}")
        if key.startswith("font."):
            _check_font(f"{path}", place, key, value)
        if key == "figure.figsize":
            _check_bounds(f"{path}", f"{place}, width in inches", value[0], _WIDTHS)
            _check_bounds(f"{path}", f"{place}, height in inches", value[1], _HEIGHTS)
        settings[key] = value
    return settings


def _lines(path: Path) -> Iterator[tuple[int, str, str]]:
    """Number, key and value of each line that has them, up to a # outside quotes: a comment."""
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        statement = re.match(r'(?:[^"#]|"[^"]*")*', line)
        content = (statement[0] if statement else "").strip()
        if not content:
            continue
        key, colon, text = (part.strip() for part in content.partition(":"))
        if not (key and colon):
            raise InputError(str(path), f"line {number}: {shown(content)} must be KEY: VALUE")
        yield number, key, text[1:-1] if re.fullmatch(r'"[^"]*"', text) else text


def _check_font(path: str, place: str, key: str, value: Any) -> None:
    """Check families by the names of matplotlib's fonts, and a size that can be read."""
    if key == "font.size":
        _check_bounds(path, f"{place}, in points", value, _SIZES)
    if not isinstance(value, list):
        return
    known = sorted({font.name for font in _FONTS})
    for name in value:
        if name not in (*known, *(_GENERIC if key == "font.family" else ())):
            listed = ", ".join(font for font in known if font.startswith(("DejaVu", "STIXG", "cm")))
            raise InputError(
                path, f"{place}: {shown(name)} does not come with matplotlib, must be of {listed}"
            )


def _check_bounds(path: str, place: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        raise InputError(path, f"{place}: {value:g} must be from {bounds[0]:g} to {bounds[1]:g}")


def as_designed() -> bool:
    """True if figures look as those who wrote the drawings saw them: nothing needs to be fitted."""
    return all(_PARAMETERS[key] == value for key, value in _DEFAULT.items())


def size(height: float) -> tuple[float, float]:
    """Width and height in inches of a figure ``height`` inches high in the default style."""
    width, tall = _PARAMETERS["figure.figsize"]
    return width, height * (tall / _DESIGNED[1])


def narrow() -> bool:
    """True if a line of text is so much shorter than the default that panels go one by one."""
    lines = _PARAMETERS["figure.figsize"][0] / _PARAMETERS["font.size"]
    return bool(lines < 0.75 * WIDTH / _TEXT)


def points(text: float) -> float:
    """The size of text of so many points in the default style, never too small for print."""
    scaled = text * (_PARAMETERS["font.size"] / _TEXT)
    return float(max(scaled, min(text, _SMALLEST)))


def thick(line: float) -> float:
    """The width of a line of so many points in the default style."""
    return float(line * (_PARAMETERS["lines.linewidth"] / _LINE))


def mark(marker: float) -> float:
    """The size of a marker of so many points in the default style."""
    return float(marker * (_PARAMETERS["lines.markersize"] / _MARKER))

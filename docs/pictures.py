"""Pictures of the tutorials: drawn at build, written into the page as SVG.

Text and axes take the colour of the page's text, so that a picture is as legible on a dark page as
on a light one. Lines differ in colour and in dashes: they stay apart in greyscale.
"""

from __future__ import annotations

import re
from html import escape
from io import StringIO
from typing import Any

import matplotlib
from matplotlib.figure import Figure

# Stands for the colour of the page's text until the file is written.
_INK = "#010203"
_BLUE, _ORANGE, _GREEN = "#2f86d0", "#d9730d", "#2f9e63"

TRUTH: dict[str, Any] = {"color": _INK, "linewidth": 2.4, "alpha": 0.45}
FIRST: dict[str, Any] = {"color": _BLUE, "linewidth": 1.3}
SECOND: dict[str, Any] = {"color": _ORANGE, "linewidth": 1.3, "linestyle": (0, (5, 2))}
THIRD: dict[str, Any] = {"color": _GREEN, "linewidth": 1.6, "linestyle": (0, (1, 1.5))}
LIMIT: dict[str, Any] = {"color": _INK, "linewidth": 0.9, "linestyle": (0, (6, 3, 1, 3))}

_LOOK: dict[Any, Any] = {
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.titlecolor": _INK,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.labelsize": 10,
    "axes.titlesize": 10,
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "grid.color": "#808080",
    "grid.alpha": 0.3,
    "grid.linewidth": 0.6,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.labelcolor": _INK,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "svg.fonttype": "none",
    "text.color": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
}


def panels(rows: int = 1, *, height: float = 2.2, share: bool = True) -> tuple[Figure, list[Any]]:
    """An empty figure and its panels, one below the other, ``height`` inches each."""
    with matplotlib.rc_context(_LOOK):
        figure = Figure(figsize=(7.0, 0.5 + height * rows), layout="constrained")
        axes = figure.subplots(rows, 1, sharex=share, squeeze=False)[:, 0]
    return figure, list(axes)


def show(figure: Figure, *, alt: str, caption: str) -> str:
    """The figure as HTML: what a screen reader says of it is ``alt``; the caption stands below."""
    stream = StringIO()
    with matplotlib.rc_context({**_LOOK, "svg.hashsalt": caption}):
        for axes in figure.axes:
            labels = axes.get_legend_handles_labels()[1]
            if labels:  # above the panel, where it covers no line
                axes.legend(
                    loc="lower left",
                    bbox_to_anchor=(0.0, 1.0),
                    ncols=len(labels),
                    borderaxespad=0.2,
                )
        figure.savefig(stream, format="svg", metadata={"Date": None}, transparent=True)
    drawing = stream.getvalue()
    drawing = drawing[drawing.index("<svg") :].replace(_INK, "currentColor")
    drawing = re.sub(r"<metadata>.*?</metadata>\s*", "", drawing, flags=re.DOTALL)
    drawing = re.sub(r"<!--.*?-->\s*", "", drawing, flags=re.DOTALL)
    drawing = _without_unused_names(drawing)
    drawing = drawing.replace("<svg ", f'<svg role="img" aria-label="{escape(alt)}" ', 1)
    drawing = re.sub(r' width="[^"]*pt"', "", drawing, count=1)
    drawing = re.sub(
        r' height="[^"]*pt"', ' style="width: 100%; min-width: 520px"', drawing, count=1
    )
    # On a phone the drawing is moved sideways, since its text would be too small otherwise.
    return (
        '<figure class="picture" style="width: 100%; margin: 1em 0">\n'
        f'<div style="overflow-x: auto">{drawing}</div>\n'
        f"<figcaption>{caption}</figcaption>\n</figure>\n"
    )


def _without_unused_names(drawing: str) -> str:
    """Two pictures on one page must not share ids; those that nothing refers to go."""
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', drawing))

    def kept(found: re.Match[str]) -> str:
        return found.group(0) if found.group(1) in used else ""

    return re.sub(r' id="([^"]*)"', kept, drawing)

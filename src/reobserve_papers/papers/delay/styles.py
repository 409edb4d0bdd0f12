"""Colours and dash patterns, one for each observer in all figures, m = 1 blue as in the paper."""

from __future__ import annotations

from reobserve_papers.papers.delay import keys
from reobserve_papers.plotting.figures import STYLES, Style

_BLACK, _ORANGE, _BLUE, _PURPLE, _GREEN = STYLES
_RED = Style("#b3265e", (0, (3, 1, 1, 1, 1, 1)), 1.2, "p")


def style_of(observer: keys.Observer) -> Style:
    """The style of an observer, by its type, not by its place in a figure."""
    match observer:
        case keys.Extended(order=1):
            return _BLUE
        case keys.Extended():
            return _BLACK
        case keys.Standard():
            return _ORANGE
        case keys.LeastSquares():
            return _PURPLE
        case keys.AdaptiveIdentification():
            return _GREEN
    return _RED

"""The style of this package's figures, for a process in which somebody else draws, too."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from reobserve.core.extras import package


@contextmanager
def own_style() -> Iterator[None]:
    """Draw in the default style, then restore the parameters and fonts of matplotlib."""
    matplotlib = package("matplotlib", "draw a figure")
    manager = package("matplotlib.font_manager", "draw a figure").fontManager
    fonts = manager.ttflist
    with matplotlib.rc_context():
        from reobserve_papers.plotting.style_sheet import use_sheet

        use_sheet(None)
        try:
            yield
        finally:
            manager.ttflist = fonts

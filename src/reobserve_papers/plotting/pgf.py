"""A figure as a PGF picture for LaTeX, which sets its text in the font of the document."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pgf import RendererPgf
from matplotlib.figure import Figure

from reobserve.core.errors import InputError
from reobserve_papers.plotting.latex_text import latex

_HEAD = r"""% \usepackage{pgf} in the preamble, then \input{this file}.
\begingroup%
\makeatletter%
\begin{pgfpicture}%
"""
_TAIL = r"""\end{pgfpicture}%
\makeatother%
\endgroup%
"""


def pgf(figure: Figure, path: str) -> str:
    """The picture, as large as the figure."""
    stream = io.StringIO()
    figure.draw(_Renderer(figure, stream, path))
    wide, high = figure.get_size_inches()
    size = rf"\pgfqpoint{{{wide:f}in}}{{{high:f}in}}"
    frame = rf"\pgfpathrectangle{{\pgfpointorigin}}{{{size}}}%"
    return "\n".join([f"{_HEAD}{frame}", r"\pgfusepath{use as bounding box, clip}%",
                      f"{stream.getvalue()}{_TAIL}"])  # fmt: skip


_Base: Any = RendererPgf  # whose methods matplotlib does not annotate


class _Renderer(_Base):  # type: ignore[misc]
    """Measures text as the other formats do: nobody needs LaTeX to make the file."""

    def __init__(self, figure: Figure, stream: io.StringIO, path: str) -> None:
        super().__init__(figure, stream)
        self._path = path
        canvas: Any = FigureCanvasAgg(figure)
        self._measure = canvas.get_renderer()

    def get_text_width_height_descent(self, s: str, prop: Any, ismath: Any) -> Any:
        return self._measure.get_text_width_height_descent(s, prop, ismath)

    def draw_text(
        self, gc: Any, x: float, y: float, s: str, prop: Any, angle: float,
        ismath: Any = False, mtext: Any = None,
    ) -> None:  # fmt: skip
        words = s.replace(r"\mathdefault", r"\mathrm") if ismath else latex(s)
        super().draw_text(gc, x, y, words, prop, angle, ismath, mtext)

    def draw_image(self, *_: Any, **__: Any) -> None:
        raise InputError(self._path, "cannot hold an image, must end in another format than .pgf")

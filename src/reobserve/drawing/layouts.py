"""The drawing of a figure: the one of its paper for the layout that the ledger names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from reobserve.errors import InputError
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import StudyFigure

# It returns matplotlib's Figure, which is for those who draw to import.
Drawing = Callable[[FigureData], Any]


def draw(layouts: Mapping[str, Drawing], data: FigureData) -> Any:
    """The figure in its layout, one of a paper's ``layouts``.

    Raises
    ------
    InputError
        If it draws a study of another method than its layout.
    """
    job = data.job
    layout = job.figure.layout
    if isinstance(job.figure, StudyFigure) and getattr(job.study, "method", layout) != layout:
        raise InputError("study", f"must be one of the method {layout}, as the layout is")
    return layouts[layout](data)

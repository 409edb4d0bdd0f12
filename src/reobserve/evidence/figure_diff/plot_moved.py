"""The series that moved, new over golden, and by how much against what is allowed."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from reobserve.drawing.figures import STYLES, TRUTH, new_figure
from reobserve.drawing.fitting import fix_layout
from reobserve.drawing.formats import save
from reobserve.evidence.figure_diff.model import MovedSeries


def draw_moved(series: Sequence[MovedSeries]) -> bytes:
    """An SVG with two panels a series: both, and the difference with the tolerance as a band.

    Where golden and new have not the same length, there is no difference to draw.
    """
    figure, panels = new_figure((1.5, 0.9) * len(series), share_time=False)
    for one, both, difference in zip(series, panels[::2], panels[1::2], strict=True):
        golden_time, time = (np.arange(len(v)) * one.period for v in (one.golden, one.new))
        both.plot(golden_time, one.golden, **TRUTH.line(), label="golden")
        both.fill_between(
            golden_time, one.golden - one.tolerance, one.golden + one.tolerance,
            color=STYLES[2].color, alpha=0.25, linewidth=0, label="tolerance",
        )  # fmt: skip
        both.plot(time, one.new, **STYLES[1].line(), label="new")
        both.set_title(f"{one.name} [{one.unit}]")
        both.legend(loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.2, ncols=3)
        difference.set_xlabel("time [s]")
        difference.set_ylabel(f"new − golden\n[{one.unit}]")
        if len(time) != len(golden_time):
            note = f"{len(time)} rows instead of {len(golden_time)}"
            difference.text(0.5, 0.5, note, transform=difference.transAxes, ha="center")
            continue
        difference.axhspan(-one.tolerance, one.tolerance, color=STYLES[2].color, alpha=0.25)
        difference.plot(time, one.new - one.golden, **STYLES[0].line())
    fix_layout(figure)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "moved.svg"
        save(figure, path)
        return path.read_bytes()

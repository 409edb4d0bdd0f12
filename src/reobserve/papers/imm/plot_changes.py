"""The calibrated banks with one thing changed: mean probabilities beside those quoted."""

from __future__ import annotations

from matplotlib.figure import Figure

from reobserve.papers.imm.styles import style_of
from reobserve.plotting.figures import add_note, blank
from reobserve.plotting.look import mark, thick
from reobserve.replication.parameters.figure_data import FigureData

_NAMES = {
    "as_stated": "as calibrated",
    "unmixed": "no mixing",
    "prbs": "pseudo-random input",
    "square": "square wave, 1 s",
    "sweep": "sine sweep, 1 to 45 Hz",
    "friction": "friction instead of leak",
    "states": "states go on through the leak",
    "outputs": "outputs switched at the leak",
    "certain": "normal mode certain at t = 0",
    "weighted": "H⁺ weighted by covariance",
    "start": "P(0) = {level:g} y²",
    "period": "samples every {ms:g} ms",
    "share": "{share:.0%} of the leak",
    "layer": "boundary layers × {level:g}",
    "noise": "noise of one per cent",
}


def draw(data: FigureData) -> Figure:
    """All modes, one row a change."""
    study, observers = data.study, data.job.observers
    changes = [change for change, _ in study.groups("sweep", "level")]
    figure = blank(0.9 + 0.24 * len(changes))
    panels = figure.subplots(1, 3, sharey=True)
    for axes, mode, letter in zip(panels, ("normal", "leakage", "friction"), "abc", strict=True):
        for order, (name, body) in enumerate(observers.items()):
            style = style_of(body)
            mine = study.where(observer=name, quantity=f"{mode}_after")
            told = [change for change, _ in mine.groups("sweep", "level")]
            axes.plot(
                mine["value"], [changes.index(change) + 0.2 * (order - 1) for change in told],
                linestyle="", marker=style.marker, color=style.color, markersize=mark(4.5),
                label=body.label,
            )  # fmt: skip
            if mode != "friction":  # the paper quotes none for it
                quoted = body.quoted[("normal", "leakage").index(mode)]
                axes.axvline(quoted, color=style.color, linestyle=":", linewidth=thick(1.4))
        axes.set_xlim(-0.05, 1.05)
        axes.set_title(f"({letter}) {mode} mode")
    start, end = data.job.metrics.after
    panels[1].set_xlabel(f"mean probability, {start:g} to {end:g} s")
    panels[0].set_yticks(range(len(changes)), [_name(*change) for change in changes])
    panels[0].invert_yaxis()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3)
    add_note(
        figure,
        "Dotted: the values that the paper quotes. Each row differs from the first in one thing; "
        "the noise enters the record only, not R.",
    )
    return figure


def _name(sweep: str, level: float) -> str:
    return _NAMES[sweep].format(level=level, ms=1000 * level, share=level)

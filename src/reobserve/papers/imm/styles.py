"""One colour and dash for each bank, in all figures: by what it is, in whichever setting."""

from __future__ import annotations

from reobserve.papers.imm import keys
from reobserve.plotting.figures import STYLES, Style

KALMAN, SVSF, THIN, UNMIXED = STYLES[:4]
INPUT, VELOCITY = Style("0.8", "-", 0.6), Style("0.35", "-", 1.0)


def style_of(observer: keys.Observer) -> Style:
    """The style of a bank: Kalman filters, SVSFs, or SVSFs with thinner layers."""
    if isinstance(observer, keys.Kalman):
        return KALMAN if observer.mixing else UNMIXED
    return THIN if observer.layer_factor < 1 else SVSF

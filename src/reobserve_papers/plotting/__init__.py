"""Figures and their captions."""

from reobserve.core.extras import require

require("matplotlib", "replicate papers", "papers")

"""The bench: observers and filters on the same tasks, tuned by one rule."""

from reobserve.core.extras import require

require("matplotlib", "replicate papers", "papers")

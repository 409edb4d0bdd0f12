"""The assumptions of a paper: read, overridden, checked, and as types."""

from reobserve.core.extras import require

require("pydantic", "replicate papers", "papers")

"""Units of the components of the motion."""

from __future__ import annotations

# y is the unit of the velocity, which the paper does not state.
UNITS = {"position": "y s", "velocity": "y", "acceleration": "y/s", "jerk": "y/s^2"}

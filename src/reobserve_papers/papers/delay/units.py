"""Units of the channels of records and estimates."""

from __future__ import annotations

# The units of state, output, input and its first two derivatives, by model.
UNITS = {
    "pendulum": ("rad, rad/s", "rad", "N m", "N m/s, N m/s^2"),
    "lag": ("1", "1", "1", "1/s, 1/s^2"),
}

"""Detection of changes and faults: tests of innovations, and thresholds by false alarms.

Names are imported when they are asked for: an observer needs none of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reobserve.detection.detectors import (
        Detection,
        chi_square_window,
        cusum_of_mean,
        glr_of_mean,
        glr_of_size,
    )
    from reobserve.detection.false_alarms import false_alarm_threshold
    from reobserve.detection.normalised_squares import Consistency, consistency, nees, normalised

_MODULES = {
    "normalised_squares": ("Consistency", "consistency", "nees", "normalised"),
    "detectors": (
        "Detection", "chi_square_window", "cusum_of_mean", "glr_of_mean", "glr_of_size",
    ),
    "false_alarms": ("false_alarm_threshold",),
}  # fmt: skip

__all__ = [
    "Consistency",
    "Detection",
    "chi_square_window",
    "consistency",
    "cusum_of_mean",
    "false_alarm_threshold",
    "glr_of_mean",
    "glr_of_size",
    "nees",
    "normalised",
]


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

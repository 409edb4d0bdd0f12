"""Stage metrics: what is left of the error at the end."""

import numpy as np

from reobserve.metrics import Metric


def late_error(settings, plant, estimate):
    late = plant.time > plant.time[-1] - settings["metrics"]["late_window"]
    return float(np.sqrt(np.mean((plant["d"] - estimate["d"])[late] ** 2)))


def measure(settings, plant, estimates, study):
    found = [
        Metric(name, "late_rms_error", late_error(settings, plant, estimate), "1/s")
        for name, estimate in estimates.items()
    ]
    best = min(float(row["late_rms_error"]) for row in study)
    return [*found, Metric("placed", "best_late_rms_error", best, "1/s")]

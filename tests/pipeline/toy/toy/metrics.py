"""Stage metrics: what is left of the error at the end."""

import numpy as np
from reobserve.papers.toy import keys

from reobserve.ledger.types import read_job
from reobserve.scoring.metrics import Metric


def late_error(job, plant, estimate):
    late = plant.time > plant.time[-1] - job.metrics.late_window
    return float(np.sqrt(np.mean((plant["d"] - estimate["d"])[late] ** 2)))


def measure(settings, plant, estimates, study):
    job = read_job(keys.Ledger, settings)
    found = [
        Metric(name, "late_rms_error", late_error(job, plant, estimate), "1/s")
        for name, estimate in estimates.items()
    ]
    best = min(float(row["late_rms_error"]) for row in study)
    return [*found, Metric("placed", "best_late_rms_error", best, "1/s")]

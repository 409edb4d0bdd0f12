"""Stage metrics: the remaining error at the end."""

from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square

MEANINGS = {
    "late_rms_error": "root mean square error of d in the last second",
    "late_rms_error factor=<factor>": "the same with the gains of the design times a factor",
    "discriminant": "of the characteristic polynomial; zero of a double pole",
}
SUBJECTS = {"theory": "gains"}


def late_error(job, plant, estimate):
    late = plant.time > plant.time[-1] - job.metrics.late_window
    return float(root_mean_square((plant["d"] - estimate["d"])[late]))


def measure(data):
    for name, estimate in data.estimates.items():
        yield Metric(name, "late_rms_error", late_error(data.job, data.plant, estimate), "1/s")
    for factor, error in zip(data.study["factor"], data.study["late_rms_error"], strict=True):
        yield Metric.at("placed", ("late_rms_error", float(error), "1/s"), factor=factor)

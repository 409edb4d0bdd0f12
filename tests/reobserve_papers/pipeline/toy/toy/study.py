"""Stage study: the gains of the design, multiplied."""

from toy_paper.metrics import late_error
from toy_paper.observe import run as observed


def run(job, plant, design):
    rows = []
    for factor in job.study.factors:
        estimate = observed(job, plant, [factor * gain for gain in design["gains"]])
        rows.append({"factor": factor, "late_rms_error": late_error(job, plant, estimate)})
    return rows

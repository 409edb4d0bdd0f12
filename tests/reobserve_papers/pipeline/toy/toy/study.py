"""Stage study: the gains of the design, multiplied."""

from toy_paper import keys
from toy_paper.metrics import late_error
from toy_paper.observe import run as observed

from reobserve_papers.parameters.job import read_job


def run(settings, plant, design):
    job, rows = read_job(keys.Parameters, settings), []
    for factor in job.study.factors:
        estimate = observed(job, plant, [factor * gain for gain in design["gains"]])
        rows.append({"factor": factor, "late_rms_error": late_error(job, plant, estimate)})
    return rows

"""Stage study: the gains of the design, multiplied."""

from reobserve.papers.toy.metrics import late_error
from reobserve.papers.toy.observe import run as observed

from reobserve.files import NUMBER, SCORE

HEADER = ("factor", "late_rms_error")
KINDS = {"factor": NUMBER, "late_rms_error": SCORE}


def run(settings, plant, design):
    rows = []
    for factor in settings["study"]["factors"]:
        estimate = observed(settings, plant, [factor * gain for gain in design["gains"]])
        rows.append({"factor": factor, "late_rms_error": late_error(settings, plant, estimate)})
    return rows

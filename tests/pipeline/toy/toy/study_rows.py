"""The columns of the table of a study, and what their cells must be."""

from reobserve.core.files import NUMBER, SCORE

HEADER = ("factor", "late_rms_error")
KINDS = {"factor": NUMBER, "late_rms_error": SCORE}

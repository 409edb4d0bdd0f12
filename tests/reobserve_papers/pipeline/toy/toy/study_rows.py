"""The columns of the study table, and the types of their cells."""

from reobserve.core.files import NUMBER, SCORE

HEADER = ("factor", "late_rms_error")
KINDS = {"factor": NUMBER, "late_rms_error": SCORE}

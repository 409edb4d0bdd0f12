"""Stage table: the gains as printed and as computed."""

from reobserve.core.files import NAME, NUMBER

HEADER = ("gain", "printed", "computed")
KINDS = {"gain": NAME, "printed": NUMBER, "computed": NUMBER}


def rows(job, design):
    printed = job.table.printed
    return [
        dict(zip(HEADER, cells, strict=True))
        for cells in zip(design["names"], printed, design["gains"], strict=True)
    ]

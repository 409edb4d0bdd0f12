"""Stage table: the gains as printed and as computed."""

from toy_paper import keys

from reobserve.core.files import NAME, NUMBER
from reobserve_papers.parameters.job import read_job

HEADER = ("gain", "printed", "computed")
KINDS = {"gain": NAME, "printed": NUMBER, "computed": NUMBER}


def rows(settings, design):
    printed = read_job(keys.Parameters, settings).table.printed
    return [
        dict(zip(HEADER, cells, strict=True))
        for cells in zip(design["names"], printed, design["gains"], strict=True)
    ]

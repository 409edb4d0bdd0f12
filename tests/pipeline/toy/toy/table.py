"""Stage table: the gains as printed and as computed."""

from reobserve.ledger.job import read_job
from reobserve.papers.toy import keys
from reobserve.plain_data.files import NAME, NUMBER

HEADER = ("gain", "printed", "computed")
KINDS = {"gain": NAME, "printed": NUMBER, "computed": NUMBER}


def rows(settings, design):
    printed = read_job(keys.Ledger, settings).table.printed
    return [
        dict(zip(HEADER, cells, strict=True))
        for cells in zip(design["names"], printed, design["gains"], strict=True)
    ]

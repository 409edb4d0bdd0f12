"""Stage table: the gains as printed and as computed."""

from reobserve.papers.toy import keys

from reobserve.ledger_types import read_job

HEADER = ("gain", "printed", "computed")


def rows(settings, design):
    printed = read_job(keys.Ledger, settings).table.printed
    return [
        dict(zip(HEADER, cells, strict=True))
        for cells in zip(design["names"], printed, design["gains"], strict=True)
    ]

"""Stage table: the gains as printed and as computed."""

HEADER = ("gain", "printed", "computed")


def rows(settings, design):
    printed = settings["table"]["printed"]
    return [
        dict(zip(HEADER, cells, strict=True))
        for cells in zip(design["names"], printed, design["gains"], strict=True)
    ]

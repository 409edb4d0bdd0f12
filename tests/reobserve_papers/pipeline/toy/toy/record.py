"""The columns of records and estimates."""

from reobserve_papers.signals.series import ChannelShape


def plant(job):
    return {"x": ChannelShape("1"), "d": ChannelShape("1/s")}


estimates = plant

"""The columns of records and estimates."""

from reobserve_papers.signals.series import Shape


def plant(job):
    return {"x": Shape("1"), "d": Shape("1/s")}


estimates = plant

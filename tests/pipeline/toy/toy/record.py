"""What a record of the plant and estimates hold."""

from reobserve.signals.series import Shape


def plant(job):
    return {"x": Shape("1"), "d": Shape("1/s")}


estimates = plant

"""What a record of the plant and estimates hold."""

from reobserve.timeseries.series import Shape

EVENTS = ()


def axis(job):
    return job.plant.horizon, job.plant.step


def plant(job):
    return {"x": Shape("1"), "d": Shape("1/s")}


def estimates(job):
    return {"x": Shape("1"), "d": Shape("1/s")}

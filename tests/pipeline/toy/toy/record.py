"""What a record of the plant and estimates hold."""

from reobserve.series import Shape

EVENTS = ()


def axis(settings):
    return settings["plant"]["horizon"], settings["plant"]["step"]


def plant(settings):
    return {"x": Shape("1"), "d": Shape("1/s")}


def estimates(settings):
    return {"x": Shape("1"), "d": Shape("1/s")}

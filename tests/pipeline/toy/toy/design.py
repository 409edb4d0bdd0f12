"""Stage design: s^2 + (a + l1) s + l2 = (s + pole)^2."""

from reobserve.errors import InputError


def compute(settings):
    rate, pole = settings["plant"]["rate"], settings["design"]["pole"]
    if pole <= 0:
        raise InputError("pole", f"{pole:g} must be greater than zero")
    return {"gains": (2 * pole - rate, pole * pole), "names": ["l1", "l2"]}

"""Stage theory: how far the poles of the design are from one place, as a discriminant."""

from reobserve.metrics import Metric


def measure(settings, designs):
    first, second = designs["gains"]["gains"]
    defect = (settings["plant"]["rate"] + first) ** 2 - 4 * second
    return [Metric("gains", "discriminant", defect, "1/s^2")]

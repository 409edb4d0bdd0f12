"""Stage theory: the distance of the poles of the design from a double pole, as a discriminant."""

from reobserve_papers.metrics.metrics import Metric


def measure(job, designs):
    first, second = designs["gains"]["gains"]
    defect = (job.plant.rate + first) ** 2 - 4 * second
    return [Metric("gains", "discriminant", defect, "1/s^2")]

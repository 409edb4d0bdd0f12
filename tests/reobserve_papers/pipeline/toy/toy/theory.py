"""Stage theory: the distance of the poles of the design from a double pole, as a discriminant."""

from toy_paper import keys

from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.job import read_job


def measure(settings, designs):
    job = read_job(keys.Parameters, settings)
    first, second = designs["gains"]["gains"]
    defect = (job.plant.rate + first) ** 2 - 4 * second
    return [Metric("gains", "discriminant", defect, "1/s^2")]

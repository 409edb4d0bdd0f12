"""Stage design: s^2 + (a + l1) s + l2 = (s + pole)^2."""

from toy_paper import keys

from reobserve_papers.parameters.job import read_job


def compute(settings):
    job = read_job(keys.Parameters, settings)
    rate, pole = job.plant.rate, job.design.pole
    return {"gains": (2 * pole - rate, pole * pole), "names": ["l1", "l2"]}

"""Stage design: s^2 + (a + l1) s + l2 = (s + pole)^2."""


def compute(job):
    rate, pole = job.plant.rate, job.design.pole
    return {"gains": (2 * pole - rate, pole * pole), "names": ["l1", "l2"]}

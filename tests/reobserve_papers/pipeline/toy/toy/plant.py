"""Stage plant: the lag from rest under a constant disturbance, in closed form."""

import numpy as np

from reobserve_papers.signals.series import Channel, Series


def simulate(job):
    plant, push = job.plant, job.scenario.disturbance
    time = np.arange(round(plant.horizon / plant.step) + 1) * plant.step
    state = push / plant.rate * -np.expm1(-plant.rate * time)
    disturbance = np.full_like(time, push)
    return Series(time, {"x": Channel(state, "1"), "d": Channel(disturbance, "1/s")})

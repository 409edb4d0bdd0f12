"""Stage observe: a linear observer of x and d, by Euler steps."""

import numpy as np

from reobserve_papers.signals.series import Channel, Series


def estimate(job, plant, design=None):
    return run(job, plant, design["gains"] if design else job.observer.gains)


def run(job, plant, gains):
    rate, step = job.plant.rate, plant.step
    found = np.zeros((len(plant.time), 2))
    for k, x in enumerate(plant["x"][:-1]):
        state, disturbance = found[k]
        error = x - state
        slope = (-rate * state + disturbance + gains[0] * error, gains[1] * error)
        found[k + 1] = found[k] + step * np.array(slope)
    return Series(plant.time, {"x": Channel(found[:, 0], "1"), "d": Channel(found[:, 1], "1/s")})

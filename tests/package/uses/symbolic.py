"""A normal form of right-hand sides as text, against what is known of it."""

from __future__ import annotations

import numpy as np

from reobserve import normal_form_observer

# Both states of a pendulum from its angle, from a start that is wrong.
period, rate = 0.01, 0.2
observer = normal_form_observer(
    ["w", "-sin(a)"], ["a"], ["a", "w"], poles=[-1.5, -2], order=3, sampling_period=period
)
time = np.arange(0, 15, period)
frequency = 1 - rate**2 / 16  # of small swings, to the second order in the amplitude
run = observer.run(rate * np.cos(frequency * time), time=time)
error = run["state"][-1] + [0, rate * frequency * np.sin(frequency * time[-1])]
error -= [rate * np.cos(frequency * time[-1]), 0]
assert np.abs(error).max() < 2e-3, error

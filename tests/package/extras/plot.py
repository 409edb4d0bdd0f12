"""With the extra `plot`: a plot of a run."""

import numpy as np

from reobserve import LinearModel, steady_kalman

walk = LinearModel([[1.0]], [[0.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
kalman = steady_kalman(walk)
run = kalman.run(np.ones((9, 1)), np.zeros((9, 1)), start=kalman.init([0.0]))
run.plot().savefig("run.png")

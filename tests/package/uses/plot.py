"""A picture of a run."""

from __future__ import annotations

import io

import numpy as np

from reobserve import LinearModel, steady_kalman

walk = LinearModel([[1.0]], [[0.0]], H=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
observer = steady_kalman(walk)
run = observer.run(np.ones((20, 1)), np.zeros((20, 1)), state=observer.init([0.0]))
figure = run.plot()
stream = io.BytesIO()
figure.savefig(stream, format="png")
assert stream.getvalue().startswith(b"\x89PNG")
(line, *_) = figure.axes[0].lines
assert np.array_equal(line.get_ydata(), run["state"][:, 0])

"""The observers with numpy, scipy and numba alone, and commands that say what they lack."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from told import lacks, told

import reobserve
from reobserve import InputError, LinearModel, RigidBody, SampledILO, steady_kalman

for name in reobserve.__all__:
    getattr(reobserve, name)

# A torque of 2 N m that nobody commanded, about an axis of inertia 4 kg m^2, found from rates.
period = 0.01
time = np.arange(0, 10, period)
rate = np.column_stack([0.5 * time, 0 * time, 0 * time])
body = RigidBody(inertia=np.diag([4.0, 5.0, 6.0]))
observer = SampledILO(
    body, sampling_period=period, K1=1.0, K2=500.0, damping=500.0, update_interval=period
)
run = observer.run(rate, np.zeros_like(rate))
assert np.allclose(run["fault"][-1], [2, 0, 0], atol=1e-6), run["fault"][-1]

# The variance p of a walk, of unit steps seen with unit noise: p = 1 + p / (1 + p), golden.
walk = LinearModel([[1.0]], [[0.0]], H=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
golden = (1 + 5**0.5) / 2
assert np.isclose(steady_kalman(walk).gain[0][0], golden / (1 + golden))

for call, extra in [
    (run.plot, "plot"),
    (run.to_pandas, "data"),
    (lambda: reobserve.normal_form_observer(
        ["w", "-sin(a) - w/10"], ["a"], ["a", "w"], poles=[-1.5, -2], order=2,
        sampling_period=period,
    ), "symbolic"),
]:  # fmt: skip
    said = ""
    try:
        call()
    except InputError as error:
        said = str(error)
    assert said.endswith(f'`pip install "reobserve[{extra}]"` brings it'), said

assert "estimate" in told("--help")
told("estimate", "--example", "kalman", "--out", "log.yaml", "--data", "log.csv")
lacks("data", "estimate", "log.yaml", "log.csv", "--out", "estimates.csv")
told("design", "eso", "--example", "motor.yaml")
lacks("design", "design", "eso", "motor.yaml", "--out", "motor.json")
assert "name a checkout of reobserve" in told("list", code=1)
assert sorted(path.name for path in Path().iterdir()) == ["log.csv", "log.yaml", "motor.yaml"]

"""With the extra `data`: observers on recorded data, tuned and as specified, and data frames."""

import contextlib
import io
import shutil
from pathlib import Path

import numpy as np

from reobserve import LinearModel, steady_kalman
from reobserve.cli.main import main

with contextlib.redirect_stdout(io.StringIO()) as listed:
    assert main(["estimate", "--example", "list"]) == 0
for name in listed.getvalue().split():
    assert main(["estimate", "--example", name, "--out", f"{name}.yaml", "--data", "log.csv"]) == 0
    assert main(["estimate", f"{name}.yaml", "log.csv", "--out", f"{name}.parquet"]) == 0
    Path("log.csv").unlink()
shutil.copytree(Path(__file__).parents[3] / "examples/measured", "measured")
with Path("measured/tune.yaml").open("a", encoding="utf-8") as stream:
    stream.write("budget: 2\n")
assert main(["tune", "measured/tune.yaml", "--output", "tuned"]) == 0
walk = LinearModel([[1.0]], [[0.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
kalman = steady_kalman(walk)
run = kalman.run(np.ones((9, 1)), np.zeros((9, 1)), start=kalman.init([0.0]))
assert len(run.to_pandas()) == 9

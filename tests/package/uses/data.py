"""A record of one's own, read, estimated and written; the same numbers in both formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from told import lacks, told

told("estimate", "--example", "kalman", "--out", "log.yaml", "--data", "log.csv")
told("estimate", "log.yaml", "log.csv", "--out", "estimates.csv")
told("estimate", "log.yaml", "log.csv", "--out", "estimates.parquet")
text, columns = pd.read_csv("estimates.csv"), pd.read_parquet("estimates.parquet")
assert len(text) == len(pd.read_csv("log.csv")) > 0
assert list(text) == list(columns)
for name in text.columns[:-1]:
    assert np.array_equal(text[name], columns[name], equal_nan=True), name
before = sorted(Path().iterdir())
lacks("plot", "estimate", "log.yaml", "log.csv", "--out", "again.csv", "--plot", "log.png")
assert sorted(Path().iterdir()) == before

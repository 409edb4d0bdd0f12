"""Tuning on recorded data: `tune` and `fit`."""

from __future__ import annotations

import argparse
from pathlib import Path

_RECORDS = """\
The file names records, split into segments for training and held-out ones; candidates, each a
specification of `reobserve estimate` with ranges of its numbers; and columns of the records that
the estimates are compared with. For example, with what is written into FOLDER:

  reobserve tune examples/measured/tune.yaml --output FOLDER
      table.md, table.csv         errors on held-out segments, with intervals of 95 %
      NAME.yaml                   tuned specifications, for `reobserve estimate`
      scores.csv                  the error in each segment
"""


def tune(command: argparse.ArgumentParser) -> None:
    """Add the options of `tune`."""
    command.epilog = _RECORDS
    command.add_argument(
        "tune_file", type=Path, metavar="FILE", help="YAML: records, candidates, reference"
    )
    command.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="a folder for the results"
    )


_FIT = """\
Each range is searched for the number under which the log is most likely. For example, with what is
written into fitted.yaml:

  reobserve fit kalman.yaml log.csv --range observer.R 1e-4 1 --range observer.Q.1 1e-6 1 \\
      --output fitted.yaml
"""


def fit(command: argparse.ArgumentParser) -> None:
    """Add the options of `fit`."""
    command.epilog = _FIT
    command.add_argument(
        "specification", type=Path, metavar="SPEC", help="YAML of a filter, as for estimate"
    )
    command.add_argument("data", type=Path, metavar="LOG", help="the record")
    command.add_argument(
        "--range", nargs=3, action="append", required=True, dest="ranges",
        metavar=("KEY", "LOW", "HIGH"), help="a number of the observer, on a logarithmic scale",
    )  # fmt: skip
    command.add_argument(
        "--linear", action="append", default=[], metavar="KEY", help="on a linear scale instead"
    )
    command.add_argument("--output", type=Path, metavar="FILE", help="the fitted specification")
    command.add_argument(
        "--budget", type=int, default=5000, metavar="N", help="runs at most (default: 5000)"
    )

"""Tuning on recorded data: `tune`."""

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

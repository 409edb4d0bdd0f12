"""Data of one's own: `estimate`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from reobserve.command_line.parts import add_command
from reobserve.errors import shown

_MORE = """\
examples, each a specification and a record to run it on:
  ilo-sampled, ilo-continuous, ilo-forgetting, adaptive, pi,
  normal-form-constant, normal-form-identity, normal-form-transformed,
  high-gain, extended-high-gain, levant,
  delay-adaptive, delay-least-squares, delay-variable-structure,
  kalman, augmented-kalman, svsf, imm-kalman, imm-svsf,
  fixed-gain, luenberger, steady-kalman, eso

  reobserve estimate --example kalman --out kalman.yaml --data kalman.csv
  reobserve estimate kalman.yaml kalman.csv --out estimates.csv --plot estimates.png
  reobserve estimate kalman.yaml --stream < kalman.csv

Stamps may be numbers (unit: s, ms, min, ...) or dates as 2026-03-29T01:59:58.250Z (unit: iso8601);
times of results are then seconds after an origin that is told and stands in the report.
"""


def add_own_data(commands: Any) -> None:
    """`estimate`."""
    estimate = add_command(
        commands, "estimate", "own_data.commands:run",
        "run an observer on a record of your own, or on lines as they come",
    )  # fmt: skip
    estimate.formatter_class = argparse.RawDescriptionHelpFormatter
    estimate.epilog = _MORE
    estimate.add_argument(
        "specification", nargs="?", type=Path, metavar="SPEC",
        help="YAML: observer, columns with units, sampling, policies, alarms",
    )  # fmt: skip
    estimate.add_argument(
        "data", nargs="?", type=Path, metavar="DATA", help=".csv, .csv.gz or .parquet"
    )
    estimate.add_argument(
        "--out", type=Path, metavar="FILE",
        help="estimates: .csv, .csv.gz or .parquet; with --example the specification: .yaml. "
        "Folders are made",
    )  # fmt: skip
    estimate.add_argument("--plot", type=Path, metavar="FILE", help="a picture: .png, .pdf or .svg")
    estimate.add_argument(
        "--report", type=Path, metavar="FILE", help="what became of the record, as JSON"
    )
    estimate.add_argument(
        "--stream", action="store_true",
        help="read standard input, write one line a sample to standard output",
    )  # fmt: skip
    estimate.add_argument(
        "--follow", action="store_true", help="the same with DATA, as it grows, until interrupted"
    )
    estimate.add_argument(
        "--idle", type=_seconds, default=math.inf, metavar="S",
        help="end --follow after so many seconds without a line",
    )  # fmt: skip
    estimate.add_argument(
        "--state", type=Path, metavar="FILE",
        help="of a stream: go on from there, if there is one, and leave one at the end",
    )  # fmt: skip
    estimate.add_argument(
        "--warm", action="store_true", help="compile first, and say when a stream may begin"
    )
    estimate.add_argument("--example", metavar="NAME", help="write a specification, see below")
    estimate.add_argument(
        "--data", dest="record", type=Path, metavar="FILE", help="with --example: a record, too"
    )


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be a number of seconds, 0 or more")
    return value

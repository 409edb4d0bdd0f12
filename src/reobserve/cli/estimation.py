"""Observers on recorded data: `estimate`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from reobserve.core.errors import shown

_MORE = """\
examples, each a specification and a record to run it on:

  reobserve estimate --example list                    print their names
  reobserve estimate --example kalman --out kalman.yaml --data kalman.csv
  reobserve estimate kalman.yaml kalman.csv --out estimates.csv --plot estimates.png
  reobserve estimate kalman.yaml --stream < kalman.csv

Timestamps may be numbers (unit: s, ms, min, ...) or dates such as 2026-03-29T01:59:58.250Z
(unit: iso8601, or a format); the results then have dates, too.

a record that nobody has seen yet:

  reobserve estimate --suggest log.csv                 a specification for it, and what is unsure
  reobserve estimate --check spec.yaml log.csv         run, write nothing; list all that refuses it
"""


def estimate(command: argparse.ArgumentParser) -> None:
    """Add the options of `estimate`."""
    command.epilog = _MORE
    command.add_argument(
        "specification", nargs="?", type=Path, metavar="SPEC",
        help="YAML: observer, columns with units, file, sampling, policies, alarms",
    )  # fmt: skip
    command.add_argument(
        "data", nargs="?", type=Path, metavar="DATA", help="text, also gzipped (.gz), or .parquet"
    )
    command.add_argument(
        "--out", type=Path, metavar="FILE",
        help="estimates: .csv, .csv.gz or .parquet; with --example the specification: .yaml. "
        "Missing folders are created",
    )  # fmt: skip
    command.add_argument("--plot", type=Path, metavar="FILE", help="a plot: .png, .pdf or .svg")
    command.add_argument(
        "--report",
        type=Path,
        metavar="FILE",
        help="what was done to the record, and what the alarms found, as JSON",
    )
    command.add_argument(
        "--check", action="store_true",
        help="run and write nothing; list all that refuses the record, as any run does",
    )  # fmt: skip
    command.add_argument(
        "--suggest",
        type=Path,
        metavar="DATA",
        help="print a specification for a record, without its observer, and what is unsure of it",
    )
    command.add_argument(
        "--stream", action="store_true",
        help="read standard input, write one line per sample to standard output",
    )  # fmt: skip
    command.add_argument(
        "--follow",
        action="store_true",
        help="the same with the file DATA while it grows, until interrupted",
    )
    command.add_argument(
        "--idle", type=_seconds, default=math.inf, metavar="S",
        help="end --follow after this many seconds without a new line",
    )  # fmt: skip
    command.add_argument(
        "--state", type=Path, metavar="FILE",
        help="for a stream: resume from this file if it exists, and write it at the end",
    )  # fmt: skip
    command.add_argument(
        "--warm", action="store_true", help="compile first, and report when a stream can begin"
    )
    command.add_argument(
        "--digits", type=int, metavar="N",
        help="significant digits of the numbers in text, 1 to 17; times keep theirs; the default "
        "is the shortest form that reads back to the same numbers",
    )  # fmt: skip
    command.add_argument(
        "--example",
        metavar="NAME",
        help="write an example of a specification, see below; no file is replaced",
    )
    command.add_argument(
        "--data",
        dest="record",
        type=Path,
        metavar="FILE",
        help="with --example: also write a record to run it on",
    )


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)} must be a number of seconds, 0 or more")
    return value

"""Observers for a model: designed from its file, and written as C."""

from __future__ import annotations

import argparse
from pathlib import Path

from reobserve.estimation.families import FAMILIES

_MORE = """\
a model to start from, its design, and its code:
  reobserve design kalman --example motor.yaml
  reobserve design kalman motor.yaml --out motor.json
  reobserve design kalman motor.yaml --set gain=steady --out steady.json
  reobserve export motor.json --out motor

the same from a specification of `reobserve estimate`, whose columns name the signals:
  reobserve design log.yaml --out log.json
  reobserve export log.yaml --out log

Gains that the model does not state are computed, if the kind can do that; the example of a kind
shows its keys.
"""


def design(command: argparse.ArgumentParser) -> None:
    """Add the options of `design`."""
    command.epilog = _MORE
    command.add_argument(
        "kind",
        metavar="KIND",
        help=f"one of {', '.join(FAMILIES)}; left out for a specification, which has one",
    )
    command.add_argument(
        "model", nargs="?", type=Path, metavar="MODEL.yaml", help="the model, or a specification"
    )
    command.add_argument("--out", type=Path, metavar="FILE", help="the design, JSON")
    command.add_argument(
        "--example",
        type=Path,
        metavar="FILE",
        help="only write an example model, which runs unchanged",
    )
    command.add_argument(
        "--set", dest="changed", action="extend", nargs="+", default=[], metavar="KEY=VALUE",
        help='keys of the model to replace or add, such as "poles=[-1+2j, -1-2j]"',
    )  # fmt: skip


def export(command: argparse.ArgumentParser) -> None:
    """Add the options of `export`."""
    command.add_argument(
        "design", type=Path, help="a file made by `reobserve design`, or a specification (.yaml)"
    )
    command.add_argument(
        "--to", choices=("c",), default="c",
        help="c: a step function without memory allocation, and its test (default: c)",
    )  # fmt: skip
    command.add_argument(
        "--out", type=Path, default=Path(), metavar="FOLDER",
        help="the folder to write to (default: the current one)",
    )  # fmt: skip

"""Observers for a model: designed from its file, and written as C."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from reobserve.cli.parts import add_command
from reobserve.estimation.families import FAMILIES

_MORE = """\
a model to start from, its design, and its code:
  reobserve design kalman --example pendulum.yaml
  reobserve design kalman pendulum.yaml --out pendulum.json
  reobserve design kalman pendulum.yaml --set gain=varying --out varying.json
  reobserve export pendulum.json --out pendulum

Gains that the model does not state are computed, if the kind can do that; the example of a kind
shows its keys.
"""


def add_designs(commands: Any) -> None:
    """`design` and `export`."""
    design = add_command(
        commands, "design", "estimation.families.design_command:run",
        "compute gains of an observer for a model, or check given ones, and certify them",
    )  # fmt: skip
    design.epilog = _MORE
    design.formatter_class = argparse.RawDescriptionHelpFormatter
    design.add_argument("kind", metavar="KIND", help=f"one of {', '.join(FAMILIES)}")
    design.add_argument("model", nargs="?", type=Path, metavar="MODEL.yaml", help="the model")
    design.add_argument("--out", type=Path, metavar="FILE", help="the design, JSON")
    design.add_argument(
        "--example",
        type=Path,
        metavar="FILE",
        help="only write an example model, which runs unchanged",
    )
    design.add_argument(
        "--set", dest="changed", action="extend", nargs="+", default=[], metavar="KEY=VALUE",
        help='keys of the model to replace or add, such as "poles=[-1+2j, -1-2j]"',
    )  # fmt: skip
    export = add_command(
        commands, "export", "estimation.families.export_command:run", "write a design as C code"
    )
    export.add_argument("design", type=Path, help="a file made by `reobserve design`")
    export.add_argument(
        "--to", choices=("c",), default="c",
        help="c: a step function without memory allocation, and its test (default: c)",
    )  # fmt: skip
    export.add_argument(
        "--out", type=Path, default=Path(), metavar="FOLDER",
        help="the folder to write to (default: the current one)",
    )  # fmt: skip

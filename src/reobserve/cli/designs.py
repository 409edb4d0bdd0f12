"""Observers of one's own: designed from a model's file, and written as code."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from reobserve.cli.parts import add_command
from reobserve.cli.types import number, whole

_KINDS = """\
a model to start from, its design, and its code:
  reobserve design kalman --example pendulum.yaml
  reobserve design kalman pendulum.yaml --out pendulum.json
  reobserve export pendulum.json --to c --out pendulum
"""


def add_designs(commands: Any) -> None:
    """`design` and `export`."""
    design = commands.add_parser(
        "design", help="find gains of an observer for a model of your own, and certify them",
        description="Find gains, or check given ones, and store them with a certificate.",
        epilog=_KINDS, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    kinds = design.add_subparsers(title="kinds", metavar="KIND", required=True)
    kalman = _add_kind(kinds, "kalman", "a Kalman filter, by the Riccati equation")
    kalman.add_argument(
        "--varying", action="store_true",
        help="let the gain follow the covariance in time (default: the steady-state gain)",
    )  # fmt: skip
    luenberger = _add_kind(kinds, "luenberger", "an observer, by the poles of its error")
    _poles(luenberger)
    _add_eso(kinds)
    normal = _add_kind(
        kinds, "normal-form", "a normal-form observer, from right-hand sides as text"
    )
    _poles(normal)
    normal.add_argument(
        "--order", type=whole(0, 20), help="order of the gain (default: the model's)"
    )
    normal.add_argument(
        "--form",
        choices=("identity", "transformed"),
        help="form of the observer (default: the model's)",
    )
    for name, text in _CHOSEN.items():
        _add_kind(kinds, name, text)
    _add_export(commands)


def _add_export(commands: Any) -> None:
    export = add_command(
        commands,
        "export",
        "estimation.designs.export_command:run",
        "write a design as code",
    )
    export.add_argument("design", type=Path, help="a file made by `reobserve design`")
    export.add_argument(
        "--to", choices=("c", "python", "latex", "json"), required=True,
        help="c: a step function without allocation, and its test",
    )  # fmt: skip
    export.add_argument(
        "--out",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help="where to write it (default: this folder)",
    )


# Kinds whose gains stand in the model's file.
_CHOSEN = {
    "ilo": "an iterative learning observer: stability, and error for a fault",
    "adaptive": "an adaptive observer of a rigid body: poles",
    "levant": "a robust exact differentiator: accuracy",
    "svsf": "a smooth variable structure filter",
    "imm": "a bank of filters, one for each mode of a plant",
    "high-gain": "a high-gain observer, from right-hand sides as text: poles, decay",
    "extended-high-gain": "the same, which also estimates the delay of its input",
    "delay-least-squares": "a delay estimator by recursive least squares: poles for a ramp",
    "delay-adaptive": "a delay estimator by filtered regressors: poles, decay for a ramp",
    "delay-variable-structure": "a delay estimator by a relay: speed, chatter",
}


def _add_kind(kinds: Any, name: str, text: str) -> argparse.ArgumentParser:
    command = add_command(kinds, name, "estimation.designs.command:run", text)
    command.set_defaults(design=name)
    command.add_argument("model", nargs="?", type=Path, metavar="MODEL.yaml", help="the model")
    command.add_argument("--out", type=Path, metavar="FILE", help="the design, JSON")
    command.add_argument(
        "--example", type=Path, metavar="FILE", help="only write a model, which runs as it is"
    )
    return command


def _add_eso(kinds: Any) -> None:
    eso = _add_kind(kinds, "eso", "an extended state observer, by matrix inequalities")
    eso.add_argument(
        "--kind", choices=("pd_pi", "pi"), default="pd_pi",
        help="with the derivative of the output error, or without it (default: pd_pi)",
    )  # fmt: skip
    eso.add_argument(
        "--factor", type=number, metavar="F",
        help="ratio of gamma to its floor, above 1; with the smallest matrices (default: 1.05)",
    )  # fmt: skip
    eso.add_argument(
        "--decay", type=number, metavar="RATE",
        help="instead, for kind pi: any gains with all poles left of -RATE [1/s]",
    )  # fmt: skip
    eso.add_argument(
        "--bound", type=number, metavar="RATE",
        help="instead: the least gamma with all poles right of -RATE [1/s]",
    )  # fmt: skip
    eso.add_argument(
        "--radius",
        type=number,
        metavar="R",
        help="with --bound: the largest norm of the matrices (default: 3000)",
    )
    eso.add_argument(
        "--solver",
        choices=("CLARABEL", "SCS"),
        help="for the matrix inequalities (default: CLARABEL)",
    )


def _poles(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--poles", metavar='"P, P"',
        help='of the error [1/s], such as "-1+2j, -1-2j", in quotes (default: the model\'s)',
    )  # fmt: skip

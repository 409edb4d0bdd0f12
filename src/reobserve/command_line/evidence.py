"""What is asked of the evidence: its report, more draws, golden numbers, the figure diff."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.command_line.parts import FORMATS, add_command, add_output, add_project
from reobserve.command_line.types import whole


def add_evidence(commands: Any) -> None:
    """The report, the draws of claims, golden numbers and the figure diff."""
    draws = add_command(
        commands, "draws", "evidence.claims.draws_command:draws_command",
        "make more draws where claims are undecided, and keep them in config/draws",
    )  # fmt: skip
    draws.add_argument("paper", nargs="*", help="only these papers (default: all)")
    draws.add_argument(
        "--most", type=whole(1, 1_000_000), default=40, help="at most, per claim (default: 40)"
    )
    draws.add_argument(
        "--check", action="store_true", help="keep nothing: repeat the kept draws and compare"
    )
    add_project(draws)

    report = add_command(
        commands, "report", "evidence.report:report_command",
        "write the replication report of what is built, with its gaps",
    )  # fmt: skip
    default = "(default: those of the config)"
    report.add_argument("--papers", nargs="+", help=f"papers that are built {default}")
    report.add_argument(
        "--formats",
        nargs="+",
        choices=FORMATS,
        metavar="FORMAT",
        help=f"formats of figures {default}",
    )
    add_output(report, "the page, HTML")
    add_project(report)
    _add_golden(commands)
    _add_figure_diff(commands)


def _add_golden(commands: Any) -> None:
    golden = commands.add_parser(
        "golden", help="check or renew the golden numbers", description="Golden numbers."
    )
    actions = golden.add_subparsers(metavar="ACTION", required=True)
    check = add_command(
        actions,
        "check",
        "evidence.golden.commands:check_command",
        "compare all figures and tables with their golden numbers",
    )
    add_project(check)
    elsewhere = add_command(
        actions, "elsewhere", "evidence.golden.commands:elsewhere_command",
        "compare them as on other processors, as far as this one can stand in for them",
    )  # fmt: skip
    elsewhere.add_argument(
        "--papers", nargs="+", default=[], metavar="PAPER", help="only these (default: as built)"
    )
    elsewhere.add_argument(
        "--part", choices=("all", "gate"), default="all",
        help="gate: what depends on designs and a figure per paper, on the most telling processors",
    )  # fmt: skip
    update = add_command(
        actions, "update", "evidence.golden.commands:update_command",
        "renew the golden numbers; prints old and new ones, refuses in CI and on a dirty tree",
    )  # fmt: skip
    update.add_argument("--reason", required=True, help="why they moved; kept beside them")
    update.add_argument(
        "--anew", action="store_true",
        help="also renew digits and tolerances of what has not moved beyond rounding",
    )  # fmt: skip
    update.add_argument("paper", nargs="*", help="only these papers (default: all)")
    for command in (elsewhere, update):
        command.add_argument(
            "--cores", type=whole(1), default=2, help="number of processes (default: 2)"
        )
        add_project(command)


def _add_figure_diff(commands: Any) -> None:
    diff = add_command(
        commands, "figdiff", "evidence.figure_diff.commands:figdiff_command",
        "compare figures, and the numbers behind them, with the accepted ones; writes a page",
    )  # fmt: skip
    for name, default, text in (
        ("reference", "tests/reference", "the accepted figures"),
        ("results", "results", "what is built"),
        ("output", "figdiff", "where the page and its summaries go"),
    ):
        diff.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    diff.add_argument(
        "--build", action="store_true",
        help="build everything from scratch in a temporary folder, and compare that",
    )  # fmt: skip
    accept = add_command(
        commands, "accept", "evidence.figure_diff.commands:accept_command",
        "build, and accept figures and golden numbers; refuses in CI and on a dirty tree",
    )  # fmt: skip
    accept.add_argument("--reason", required=True, help="why they moved; kept beside them")
    accept.add_argument("paper", nargs="*", help="only these papers (default: all)")
    for command in (diff, accept):
        command.add_argument("--cores", type=whole(1), default=2, help="for building (default: 2)")
        add_project(command)

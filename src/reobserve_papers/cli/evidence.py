"""Commands on the evidence: report, Monte Carlo samples, figure comparison."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.cli.parts import FORMATS, add_command, add_output, add_project
from reobserve.cli.types import whole


def add_evidence(commands: Any) -> None:
    """The report, the samples of claims, the figure comparison and the acceptance."""
    samples = add_command(
        commands, "samples", "replication.claims.sample_command:sample_command",
        "compute more samples where claims are undecided, and cache them in config/samples",
    )  # fmt: skip
    samples.add_argument("paper", nargs="*", help="only these papers (default: all)")
    samples.add_argument(
        "--max-samples",
        type=whole(1, 1_000_000),
        default=40,
        help="maximum number of samples per claim (default: 40)",
    )
    samples.add_argument(
        "--check", action="store_true", help="repeat the cached samples and compare; write nothing"
    )
    add_project(samples)

    report = add_command(
        commands, "report", "replication.report:report_command",
        "write the replication report of the results; what is missing is marked",
    )  # fmt: skip
    default = "(default: those of the config)"
    report.add_argument("--papers", nargs="+", help=f"papers to report {default}")
    report.add_argument(
        "--formats",
        nargs="+",
        choices=FORMATS,
        metavar="FORMAT",
        help=f"formats of the figures {default}",
    )
    report.add_argument("--bench", nargs="*", help=f"tasks of the bench to report {default}")
    add_output(report, "the page, HTML")
    add_project(report)
    _add_figure_diff(commands)


def _add_figure_diff(commands: Any) -> None:
    diff = add_command(
        commands, "figdiff", "replication.figure_diff.commands:figdiff_command",
        "compare figures, golden numbers and verdicts with the accepted ones; writes an HTML page",
    )  # fmt: skip
    for name, default, text in (
        ("reference", "tests/reference", "the accepted figures"),
        ("results", "results", "the folder of results"),
        ("output", "figdiff", "the folder for the page and its summary"),
    ):
        diff.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    add_project(diff)
    accept = add_command(
        commands, "accept", "replication.figure_diff.commands:accept_command",
        "build, and accept figures, numbers and verdicts; fails in CI and with uncommitted changes",
    )  # fmt: skip
    accept.add_argument(
        "--reason", required=True, help="why they changed; written into tests/golden/REASONS.md"
    )
    accept.add_argument("paper", nargs="*", help="only these papers (default: all)")
    accept.add_argument(
        "--cores", type=whole(1), default=2, help="processor cores for the build (default: 2)"
    )
    add_project(accept)

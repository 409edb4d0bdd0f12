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
        "make more samples where claims are undecided, and keep them in config/samples",
    )  # fmt: skip
    samples.add_argument("paper", nargs="*", help="only these papers (default: all)")
    samples.add_argument(
        "--most", type=whole(1, 1_000_000), default=40, help="at most, per claim (default: 40)"
    )
    samples.add_argument(
        "--check", action="store_true", help="keep nothing: repeat the cached samples and compare"
    )
    add_project(samples)

    report = add_command(
        commands, "report", "replication.report:report_command",
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
    _add_figure_diff(commands)


def _add_figure_diff(commands: Any) -> None:
    diff = add_command(
        commands, "figdiff", "replication.figure_diff.commands:figdiff_command",
        "compare figures, golden numbers and verdicts with the accepted ones; writes a page",
    )  # fmt: skip
    for name, default, text in (
        ("reference", "tests/reference", "the accepted figures"),
        ("results", "results", "what is built"),
        ("output", "figdiff", "where the page and its summary go"),
    ):
        diff.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    add_project(diff)
    accept = add_command(
        commands, "accept", "replication.figure_diff.commands:accept_command",
        "build, and accept figures, numbers and verdicts; refuses in CI and on a dirty tree",
    )  # fmt: skip
    accept.add_argument(
        "--reason", required=True, help="why they moved; kept in tests/golden/REASONS.md"
    )
    accept.add_argument("paper", nargs="*", help="only these papers (default: all)")
    accept.add_argument("--cores", type=whole(1), default=2, help="for building (default: 2)")
    add_project(accept)

"""The command `reobserve report`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.evidence.report.gather import gather
from reobserve.evidence.report.render import render
from reobserve.plain_data.files import write_text


def report_command(
    project: Path,
    output: Path,
    papers: Sequence[str] | None = None,
    formats: Sequence[str] | None = None,
) -> None:
    """Write the page, with every gap shown in its place, and print how many there are.

    ``papers`` and ``formats`` are what was built, if other than `config/config.yaml` says.

    Raises
    ------
    InputError
        If the project has no config or no templates, or the page cannot be written.
    """
    report = gather(project, output, papers, formats)
    write_text(output, render(report, project / "workflow" / "report" / "replication"))
    count = len(report.gaps)
    print(f"{output}: {'no gaps' if not count else '1 gap' if count == 1 else f'{count} gaps'}")
    for gap in report.gaps:
        print(f"  {gap.sentence}")

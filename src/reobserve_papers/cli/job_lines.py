"""The output of a build: one line for each job. Snakemake's own log has the rest."""

from __future__ import annotations

import logging
from typing import Any

_HIDDEN_EVENTS = {"job_started", "job_finished", "progress", "resources_info", "run_info"}
_HIDDEN = (
    "Building DAG", "Using shell", "Conda environments: ignored", "Select jobs", "Complete log",
    "Elapsed time",
)  # fmt: skip


def print_job_lines(workflow: Any, logger: logging.Logger) -> None:
    """Format Snakemake's output, unless a dry run, ``--quiet host`` or the like asks for all."""
    output = workflow.output_settings
    quiet = {element.name for element in output.quiet or ()}
    if output.dryrun or output.verbose or "REASON" not in quiet:
        return
    for handler in logger.handlers:
        if handler.name == "DefaultStreamHandler" and handler.formatter:
            handler.addFilter(_shown)
            handler.setFormatter(JobLines(handler.formatter, workflow))


def _shown(record: logging.LogRecord) -> bool:
    hidden = record.getMessage().startswith(_HIDDEN)
    return not hidden and getattr(record, "event", None) not in _HIDDEN_EVENTS


class JobLines(logging.Formatter):
    """The message of each job as it starts, with its number, and all else as usual."""

    def __init__(self, usual: logging.Formatter, workflow: Any) -> None:
        super().__init__()
        self.usual, self.workflow = usual, workflow
        self.started: set[int] = set()

    def format(self, record: logging.LogRecord) -> str:
        """Format a record of Snakemake."""
        if getattr(record, "event", None) != "job_info":
            return self.usual.format(record)
        job: Any = record
        self.started.add(job.jobid)
        total = str(len(self.workflow.dag))
        number = f"{len(self.started):{len(total)}}"
        return f"[{number} of {total}] {job.rule_msg or job.rule_name}"

"""What a build prints: a line for each job that is done, and whatever goes wrong.

Snakemake finds loggers by the name of their package. ``profiles/default`` asks for this one; with
``--verbose``, and for a dry run, Snakemake tells everything itself, as it does in its own log.
"""

from __future__ import annotations

import logging
import sys
import time

from snakemake.logging import ColorizingTextHandler, DefaultFormatter
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

_FAILURES = (LogEvent.JOB_ERROR, LogEvent.GROUP_ERROR, LogEvent.ERROR)


class LogHandler(LogHandlerBase):
    """Prints how many jobs are done, for how long it runs, and about how long it still will."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        """Start the clock."""
        settings = self.common_settings
        stream = sys.stdout if settings.stdout else sys.stderr
        told = DefaultFormatter(settings.quiet, settings.show_failed_logs)
        self._usual = ColorizingTextHandler(settings.nocolor, stream, formatter=told)
        self._all = settings.dryrun or settings.verbose
        self._stream = stream
        self._start = time.monotonic()
        self._what: dict[int, str] = {}  # running jobs do
        self._done: list[str] = []  # since the last line
        self._runs = False

    def emit(self, record: logging.LogRecord) -> None:
        """Take one thing that Snakemake says."""
        event = getattr(record, "event", None)
        if self._all or event in _FAILURES or record.levelno >= logging.WARNING:
            self._usual.emit(record)
        elif event == LogEvent.WORKFLOW_STARTED:
            self._runs = True
        elif event == LogEvent.JOB_INFO:
            self._what[record.jobid] = record.rule_msg or record.rule_name  # type: ignore[attr-defined]
        elif event == LogEvent.JOB_FINISHED:
            self._done.append(self._what.pop(record.job_id, ""))  # type: ignore[attr-defined]
        elif event == LogEvent.PROGRESS:
            self._tell(record.done, record.total)  # type: ignore[attr-defined]
        elif event is None and (not self._runs or "othing to be done" in record.getMessage()):
            self._usual.emit(record)

    def _tell(self, done: int, total: int) -> None:
        """Print what is done, and how long the rest takes at the pace of the jobs so far."""
        elapsed = time.monotonic() - self._start
        left = elapsed / done * (total - done)
        clock = f"{_clock(elapsed)}, about {_clock(left)} left" if total > done else _clock(elapsed)
        for what in self._done:
            print(f"{done:{len(str(total))}d} of {total}  {clock}  {what}", file=self._stream)
        self._done.clear()
        self._stream.flush()


def _clock(seconds: float) -> str:
    """Minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"

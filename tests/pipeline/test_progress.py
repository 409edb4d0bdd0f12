"""What a build prints: a line for each job, and what goes wrong."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import snakemake_logger_plugin_reobserve as plugin
from snakemake_interface_logger_plugins.common import LogEvent

from .conftest import Project

Emit = Callable[..., None]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What time it is."""
    now = [100.0]
    monkeypatch.setattr(plugin.time, "monotonic", lambda: now[0])
    return now


def handler(**settings: Any) -> Emit:
    """A handler, as Snakemake sets it up, that takes records by their parts."""
    usual = {
        "printshellcmds": True, "nocolor": True, "quiet": None, "debug_dag": False,
        "verbose": False, "show_failed_logs": False, "stdout": True, "dryrun": False,
    }  # fmt: skip
    made = plugin.LogHandler(SimpleNamespace(**{**usual, **settings}), None)

    def emit(message: str | None = None, level: int = logging.INFO, **parts: Any) -> None:
        record = logging.makeLogRecord({"msg": message, "levelno": level, **parts})
        made.emit(record)

    return emit


def test_each_job_is_a_line_with_count_and_times(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    emit = handler()
    emit(event=LogEvent.WORKFLOW_STARTED)
    emit("Select jobs to execute...")
    for job, what in ((3, "draw"), (7, "")):
        emit(event=LogEvent.JOB_INFO, jobid=job, rule_msg=what, rule_name="plot", reason="so")
    clock[0] = 110.0
    emit("Finished jobid: 7", event=LogEvent.JOB_FINISHED, job_id=7)
    emit(event=LogEvent.PROGRESS, done=1, total=12)
    clock[0] = 220.0
    emit("Finished jobid: 3", event=LogEvent.JOB_FINISHED, job_id=3)
    emit(event=LogEvent.PROGRESS, done=12, total=12)
    assert capsys.readouterr().out.splitlines() == [
        " 1 of 12  0:10, about 1:50 left  plot",
        "12 of 12  2:00  draw",
    ]


def test_what_goes_wrong_is_told_in_full(capsys: pytest.CaptureFixture[str]) -> None:
    emit = handler()
    emit(event=LogEvent.WORKFLOW_STARTED)
    emit("the disk is full", logging.ERROR)
    emit("Nothing to be done (all requested files are present and up to date).")
    assert capsys.readouterr().out.splitlines() == [
        "the disk is full",
        "Nothing to be done (all requested files are present and up to date).",
    ]


@pytest.mark.parametrize("setting", ["verbose", "dryrun"])
def test_everything_is_told_where_it_is_asked_for(
    setting: str, capsys: pytest.CaptureFixture[str]
) -> None:
    emit = handler(**{setting: True})
    emit("Select jobs to execute...")
    assert capsys.readouterr().out == "Select jobs to execute...\n"


def test_a_build_prints_its_jobs_and_the_sentence_of_what_fails(fresh: Project) -> None:
    target = "results/ilo/constant/plant.parquet"
    assert re.search(
        r"^1 of 1  \d+:\d\d  ilo: simulate the plant, scenario constant$",
        fresh.snakemake(target).stderr,
        re.MULTILINE,
    )
    (fresh.folder / target).write_bytes(b"no record")
    failed = fresh.snakemake("results/ilo/constant/sampled.parquet", check=False)
    assert failed.returncode != 0
    assert re.search(r"reobserve: results/ilo/constant/plant\.parquet: .+", failed.stderr)
    assert "Select jobs" not in failed.stderr

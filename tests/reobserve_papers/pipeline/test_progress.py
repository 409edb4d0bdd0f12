"""The output of a build: each job with its progress, and errors."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import pytest

from reobserve_papers.cli.job_lines import JobLines

from .conftest import Project


@pytest.mark.nightly
def test_build_prints_a_line_for_each_job_and_the_failure(fresh: Project) -> None:
    target = "results/ilo/constant/plant.parquet"
    said = fresh.snakemake(target).stderr
    assert said.endswith("\n\n[1 of 1] ilo: simulate the plant, scenario constant\n")
    assert len(said.splitlines()) <= 4, said
    (log,) = (fresh.folder / ".snakemake/log").iterdir()
    assert "1 of 1 steps (100%) done" in log.read_text()
    assert fresh.snakemake(target).stderr.splitlines()[-1].startswith("Nothing to be done")
    assert "Job stats:" in fresh.snakemake(target, "--forcerun", "plant", "--dry-run").stdout
    more = fresh.snakemake(target, "--forcerun", "plant", "--quiet", "host").stderr
    assert "Job stats:" in more
    assert "Reason: Forced execution" in more
    (fresh.folder / target).write_bytes(b"no record")
    failed = fresh.snakemake("results/ilo/constant/sampled.parquet", check=False)
    assert failed.returncode != 0
    assert "Error in rule observe:" in failed.stderr
    assert "log: logs/ilo/constant/sampled.log" in failed.stderr
    assert "reobserve-papers: results/ilo/constant/plant.parquet: " in failed.stderr


def test_numbers_of_jobs_are_aligned_and_those_of_a_retry_kept() -> None:
    formatter = JobLines(logging.Formatter(), SimpleNamespace(dag=range(10)))
    jobs = [
        logging.makeLogRecord(
            {"event": "job_info", "jobid": jobid, "rule_msg": None, "rule_name": "a"}
        )
        for jobid in (7, 3, 3)
    ]
    assert [formatter.format(job) for job in jobs] == [
        "[ 1 of 10] a",
        "[ 2 of 10] a",
        "[ 2 of 10] a",
    ]


@pytest.mark.nightly
def test_memory_and_time_are_measured_per_job(fresh: Project) -> None:
    """A process that has imported numpy, numba and pyarrow takes more than 60 MB."""
    fresh.snakemake("results/ilo/constant/plant.parquet")
    header, row = (fresh.folder / "logs/ilo/constant/plant.tsv").read_text().splitlines()
    measured = dict(zip(header.split("\t"), row.split("\t"), strict=True))
    assert float(measured["s"]) > 0.2
    assert float(measured["max_rss"]) > 60
    assert float(measured["cpu_time"]) > 0.2

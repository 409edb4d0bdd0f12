"""The output of a build: each job with its progress, and errors."""

from __future__ import annotations

import pytest

from tests import ROOT
from tests.project_copy import copy_environment

from .conftest import Project


def test_build_prints_its_jobs_and_the_failure(fresh: Project) -> None:
    target = "results/ilo/constant/plant.parquet"
    # The package of this checkout, whose kernels are compiled.
    said = fresh.snakemake(target, environment=copy_environment(ROOT)).stderr
    assert "ilo: simulate the plant, scenario constant\n" in said
    assert "\n1 of 1 steps (100%) done\n" in said
    assert "reobserve-papers stage plant" not in said, "commands stand in the logs"
    (fresh.folder / target).write_bytes(b"no record")
    failed = fresh.snakemake("results/ilo/constant/sampled.parquet", check=False)
    assert failed.returncode != 0
    assert "reobserve-papers: results/ilo/constant/plant.parquet: " in failed.stderr


@pytest.mark.nightly
def test_memory_and_time_are_measured_per_job(fresh: Project) -> None:
    """A process that has imported numpy, numba and pyarrow takes more than 60 MB."""
    fresh.snakemake("results/ilo/constant/plant.parquet", environment=copy_environment(ROOT))
    header, row = (fresh.folder / "logs/ilo/constant/plant.tsv").read_text().splitlines()
    measured = dict(zip(header.split("\t"), row.split("\t"), strict=True))
    assert float(measured["s"]) > 0.2
    assert float(measured["max_rss"]) > 60
    assert float(measured["cpu_time"]) > 0.2

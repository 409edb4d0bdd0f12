"""The graph of jobs: each file is made once, by a command that there is, after what it needs."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import replace

import pytest

from reobserve.cli import command_parser
from reobserve.ledger.ledger import Ledger
from reobserve.ledger.names import STAGES
from reobserve.pipeline.jobs import Graph

from .conftest import LEDGERS, PAPERS, ROOT

GRAPH = Graph(LEDGERS, PAPERS, ["pdf", "svg"], draws=3, flips=False, project=ROOT)
JOBS = GRAPH.behind(GRAPH.job("archive"))
IN_CHUNKS = replace(GRAPH, draws=10, chunks=4)
SCATTERED = IN_CHUNKS.behind(IN_CHUNKS.job("archive"))


def test_every_file_is_made_once_and_each_job_has_its_own_log() -> None:
    for jobs in (JOBS, SCATTERED):
        made = Counter(path for job in jobs for path in job.outputs)
        assert set(made.values()) == {1}
        assert len({job.log for job in jobs}) == len(jobs)
    assert {job.stage for job in JOBS} == set(STAGES) - {"search", "draw"}
    assert {job.stage for job in SCATTERED} == set(STAGES) - {"search"}


def test_what_a_job_needs_is_made_before_it_or_is_there() -> None:
    there: set[str] = set()
    for job in SCATTERED:
        read = {path for paths in job.inputs.values() for path in paths}
        assert all(path in there or (ROOT / path).is_file() for path in read), job.name
        there |= set(job.outputs)


@pytest.mark.parametrize("stage", STAGES)
def test_commands_are_what_the_command_line_takes(stage: str) -> None:
    jobs = [job for job in SCATTERED if job.stage == stage] or GRAPH.all_of("search", "imm")
    assert jobs
    for job in jobs:
        options = vars(command_parser().parse_args(shlex.split(job.command)))
        written = [options.get("output"), options.get("caption"), *options.get("outputs", ())]
        assert sorted(str(path) for path in written if path) == sorted(job.outputs)


def test_a_job_says_what_it_reads_and_how_it_is_run() -> None:
    job = GRAPH.job("observe", paper="lie", scenario="figure", observer="order4")
    assert job.name == "observe figure order4"
    assert job.inputs == {
        "plant": ["results/lie/figure/plant.parquet"],
        "design": ["results/lie/linear.design.json"],
    }
    assert job.command == (
        "stage observe results/lie/ledger.json results/lie/figure/plant.parquet order4 "
        "--design-file results/lie/linear.design.json --output results/lie/figure/order4.parquet"
    )
    assert set(job.settings) == {"plant", "observer", "design"}
    without = GRAPH.job("observe", paper="ilo", scenario="constant", observer="sampled")
    assert "--design-file" not in without.command
    drawn = GRAPH.job("plot", paper="ilo", figure="fig1")
    assert drawn.outputs == [f"results/ilo/fig1.{kind}" for kind in ("svg", "pdf", "caption.rst")]
    assert "workflow/report/ilo/_settings.rst" in drawn.inputs["partials"]
    assert GRAPH.job("robustness", paper="ilo").command.endswith(
        "--draws 3 --no-flips --kept config/draws/ilo.json "
        "--study-files results/ilo/matching.study.csv --output results/ilo/robustness.json"
    )
    gathering = IN_CHUNKS.job("robustness", paper="ilo").inputs
    names = ("0-2", "3-5", "6-8", "9-11")
    assert gathering["chunks"] == [f"results/ilo/draws/{name}.json" for name in names]
    anew = replace(GRAPH, kept=False).job("robustness", paper="ilo")
    assert anew.command.startswith(
        "stage robustness results/ilo/ledger.json --draws 3 --no-flips --study-files "
    )


def test_names_are_quoted_for_the_shell() -> None:
    tree = LEDGERS["ilo"].tree
    mine = {"a b; c": tree["scenarios"]["constant"]}
    graph = Graph({"ilo": Ledger("ilo", {**tree, "scenarios": mine}, 0)})
    words = shlex.split(graph.job("plant", paper="ilo", scenario="a b; c").command)
    assert words[3] == "a b; c"


def test_a_user_s_paper_without_claims_has_none_decided() -> None:
    graph = Graph(LEDGERS, ["ilo"], project=ROOT / "tests")
    assert graph.claimed == []
    assert graph.job("claims").inputs == {"numbers": [], "robustness": []}


def test_snakemake_has_the_limit_that_builds_lift() -> None:
    """By the name in `start_jobs_at_any_rate`; to set another would lift nothing."""
    from snakemake.scheduling.job_scheduler import JobScheduler

    for method in (JobScheduler.__init__, JobScheduler.schedule, JobScheduler.job_selector):
        assert "job_rate_limiter" in method.__code__.co_names

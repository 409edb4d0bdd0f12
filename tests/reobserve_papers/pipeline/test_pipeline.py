"""The files of a build: complete, in the documented place, and equal to the library's results."""

from __future__ import annotations

import csv
import os
import re
import shlex
from html import escape
from pathlib import Path

import numpy as np
import pytest

from reobserve_papers.golden import golden_claims
from reobserve_papers.metrics.metrics import read_metrics
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.signals.series import Series
from tests import FIVE

from .conftest import FIGURES, PAPERS, PARAMETER_FILES, ROOT, TABLES, Project


def test_provenance_records_how_a_series_was_made(built: Project) -> None:
    series = Series.read(built.folder / "results/ilo/constant/forgetting.parquet")
    about = series.provenance
    assert (about["paper"], about["stage"], about["job"]) == ("ilo", "observe", "forgetting")
    gain = PARAMETER_FILES["ilo"].section("observers", "forgetting")["K1"]
    assert about["settings"]["observer"]["K1"] == gain
    assert about["packages"]["numpy"] == np.__version__
    assert series.channels["fault"].unit == "N m"
    assert series.events["onsets"] == (5.0,)


@pytest.mark.nightly
def test_building_one_figure_builds_only_its_inputs(fresh: Project) -> None:
    fresh.snakemake("results/ilo/fig3.pdf")
    chain = {
        *(f"{paper}/parameters.json" for paper in known_papers(ROOT)),
        "ilo/aperiodic/plant.parquet",
        *(f"ilo/aperiodic/{name}.parquet" for name in ("sampled", "continuous", "forgetting")),
        "ilo/fig3.metrics.csv",
        "ilo/fig3.caption.rst",
        *(f"ilo/fig3.{suffix}" for suffix in ("pdf", "svg", "png")),
    }
    assert set(fresh.results()) == chain
    assert (fresh.folder / "logs/ilo/aperiodic/plant.log").exists()
    assert (fresh.folder / "logs/ilo/fig3.plot.tsv").exists()


def test_printed_command_can_be_run_manually(built: Project) -> None:
    output = built.snakemake(
        "--dry-run", "--force", "--printshellcmds", "results/ilo/fig2.metrics.csv"
    ).stdout
    command = re.search(r"Shell command: (\(set -x; reobserve-papers stage metrics .*)", output)
    assert command
    path = built.folder / "results/ilo/fig2.metrics.csv"
    before, status = path.read_bytes(), path.stat()
    built.run("bash", "-c", command[1])
    assert path.read_bytes() == before
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def test_metrics_and_plots_do_not_load_numba(built: Project) -> None:
    slow = r"\| +(numba|cvxpy|pandas|sympy|scipy\.signal)$"
    for paper in PAPERS:
        figures = PARAMETER_FILES[paper].tree["figures"]
        studied = next(name for name in figures if "study" in figures[name])
        log = (built.folder / f"logs/{paper}/{studied}.metrics.log").read_text()
        _, *words = shlex.split(log.partition("\n")[0].removeprefix("+ "))
        path = built.folder / f"results/{paper}/{studied}.metrics.csv"
        status = path.stat()
        loaded = built.run("python", "-X", "importtime", "-m", "reobserve_papers", *words).stderr
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
        assert "reobserve_papers.papers" in loaded
        assert not re.search(slow, loaded, re.MULTILINE), paper
        assert not re.search(r"\| +matplotlib$", loaded, re.MULTILINE), paper
    packages = [PARAMETER_FILES[paper].package for paper in PAPERS]
    plots = f"import {', '.join(paper_part(package, 'plot') for package in packages)}"
    loaded = built.run("python", "-X", "importtime", "-c", plots).stderr
    assert not re.search(slow, loaded, re.MULTILINE)


@pytest.mark.nightly
def test_user_defined_scenario_with_recorded_fault_builds(fresh: Project) -> None:
    """A scenario, an observer and a figure added by a file, with samples from a CSV."""
    time = np.arange(0, 10.01, 0.01)
    torque = np.where(time > 3, 0.2 * np.sin(2 * time), 0.0)
    with (fresh.folder / "torque.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows([("time", "torque"), *zip(time, torque, strict=True)])
    (fresh.folder / "mine.yaml").write_text(
        """
        ilo:
          plant: {horizon: 10, step: 1.25e-4}
          scenarios:
            mine:
              like: constant
              title: a recorded torque and a drift
              fault:
                - {kind: samples, axis: 1, file: torque.csv, column: torque}
                - {kind: ramp, axis: 2, from: 4, slope: 0.01}
          observers:
            quick: {like: sampled, label: mine, K2: 3000}
          figures:
            fig9: {like: fig1, title: Mine, source: none, scenario: mine, observers: [quick]}
        """
    )
    fresh.snakemake("results/ilo/fig9.svg", "--configfile", "mine.yaml")
    plant = Series.read(fresh.folder / "results/ilo/mine/plant.parquet")
    assert np.max(np.abs(plant["fault"][::80, 0] - torque)) < 1e-15
    assert plant["fault"][-1, 1] == pytest.approx(0.06, abs=1e-12)
    quick = Series.read(fresh.folder / "results/ilo/mine/quick.parquet")
    assert quick.provenance["settings"]["observer"]["K2"] == 3000
    # The record is an input: a new one makes the figure stale.
    (fresh.folder / "torque.csv").write_text("time,torque\n0,0\n10,0.1\n")
    stale = fresh.stale("results/ilo/fig9.svg", "--configfile", "mine.yaml")
    assert stale == {"plant": 1, "observe": 1, "metrics": 1, "plot": 1}


@pytest.mark.nightly
def test_noise_of_the_parameter_file_is_in_the_record(fresh: Project) -> None:
    """A deviation in the parameter file gives a measured rate with held noise of that deviation."""
    target = "results/ilo/constant/plant.parquet"
    fresh.snakemake(
        target,
        "--config",
        "ilo={plant: {noise: 1e-5, noise_period: 1e-3, horizon: 10, step: 1.25e-4}}",
    )
    series = Series.read(fresh.folder / target)
    noise = series["measured"] - series["rate"]
    held = noise.reshape(-1)[: 8 * 3 * 10000].reshape(10000, 8, 3)  # 8 samples of 0.125 ms
    assert np.max(np.ptp(held, axis=1)) < 1e-16
    assert np.std(held[:, 0]) == pytest.approx(1e-5, rel=0.02)


@pytest.mark.nightly
def test_snakemake_report_is_complete(built: Project) -> None:
    built.snakemake("--report", "report.html")
    html = (built.folder / "report.html").read_text()
    for paper, figure in FIGURES:
        assert f"results/{paper}/{figure}.svg" in html
        assert f"results/{paper}/{figure}.metrics.csv" in html
        caption = (built.folder / f"results/{paper}/{figure}.caption.rst").read_text()
        title = re.match(r"\*\*(.*?)\*\*", caption)
        assert title
        assert escape(title[1], quote=False) in html, "the caption stands in the report"
    for paper, table in TABLES:
        assert f"results/{paper}/{table}.csv" in html
    for paper, parameters in PARAMETER_FILES.items():
        assert (f"results/{paper}/theory.metrics.csv" in html) == ("theory" in parameters.tree)
    for file in ("claims.csv", "report.html"):
        assert f"results/{file}" in html
    (built.folder / "report.html").unlink()


def test_captions_list_assumptions_and_choices(built: Project) -> None:
    for paper, figure in FIGURES:
        if paper not in FIVE:
            continue
        caption = (built.folder / f"results/{paper}/{figure}.caption.rst").read_text()
        assert "Left open by the paper" in caption
        assert "Chosen" in caption
    fig4 = (built.folder / "results/ilo/fig4.caption.rst").read_text()
    metrics = {
        (m.observer, m.metric): m.value
        for m in read_metrics(built.folder / "results/ilo/fig4.metrics.csv")
    }
    share = metrics["matched", "relative_rms_error"]
    assert f"has an error of {100 * share:.2g} %" in fig4


@pytest.mark.nightly
def test_listing_commands_print_parameters_and_results(built: Project) -> None:
    listing = built.run("reobserve-papers", "list").stdout
    for word in ("ilo", "constant", "combined", "sampled", "matching", "built: pdf"):
        assert word in listing
    for paper, parameters in PARAMETER_FILES.items():
        listing = built.run("reobserve-papers", "list", paper).stdout
        assert listing.startswith(f"{paper}  ")
        for section in ("figures", "tables", "scenarios", "designs", "observers", "studies"):
            for name in parameters.tree.get(section, {}):
                assert re.search(rf"^    {name}  ", listing, re.MULTILINE), name
        params = built.run("reobserve-papers", "params", paper).stdout
        keys = [path for path, _ in parameters.entries()]
        squeezed = re.sub(r"\s+", "", params)
        assert len(keys) > (40 if paper == "ilo" else 0)
        for key in keys:
            assert key[:30] in squeezed
    why = built.run("reobserve-papers", "params", "ilo", "adaptive.observer_gain", "--why").stdout
    assert "The observer of the comparison and its gains are only cited." in re.sub(
        r"\s+", " ", why
    )
    usage = built.run("reobserve-papers", "--help").stdout
    for command in ("list", "params", "report", "stage"):
        assert f"    {command} " in usage
    usage = built.run("reobserve-papers", "stage", "--help").stdout
    for stage in ("parameters", "plant", "design", "observe", "metrics", "plot", "archive"):
        assert f"    {stage}" in usage
    helped = built.run("make", "help").stdout
    for target in (
        "figures", "test", "check", "bench", "benchmarks", "figdiff", "accept", "lock", "clean",
    ):  # fmt: skip
        assert target in helped


def test_verdicts_agree_with_the_accepted_ones(as_built: Project) -> None:
    found = golden_claims.read_built(as_built.folder / "results")
    golden = golden_claims.read_golden(ROOT)
    assert set(found) >= set(FIVE)
    moved = [one for paper in found for one in golden_claims.compare(golden, found, paper)]
    assert list(map(str, moved)) == []


def test_readme_shows_the_table_of_verdicts(as_built: Project) -> None:
    text = (as_built.folder / "results/verdicts.md").read_text(encoding="utf-8")
    assert text.partition("\n\n")[0] in (ROOT / "README.md").read_text(encoding="utf-8")


def test_report_has_no_gaps(built: Project) -> None:
    page = (built.folder / "results/report.html").read_text()
    for paper, figure in FIGURES:
        assert f'id="{paper}-{figure}"' in page
    assert (built.folder / "logs/report.log").read_text().endswith("results/report.html: no gaps\n")


def test_benchmarks_and_logs_are_written(built: Project) -> None:
    logs = {path.name for path in (built.folder / "logs").rglob("*.tsv")}
    assert {"plant.tsv", "sampled.tsv", "fig1.metrics.tsv", "fig1.plot.tsv"} <= logs
    assert all(Path(log).suffix == ".tsv" for log in logs)

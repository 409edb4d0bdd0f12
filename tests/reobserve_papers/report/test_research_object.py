"""A build as an RO-Crate: read back by rocrate, with commands, versions and digests."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import pytest
from rocrate.rocrate import ROCrate

from reobserve.core.errors import InputError
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.environment import package_versions
from reobserve_papers.report.logs import read_log
from reobserve_papers.report.research_object import write_archive
from tests import ROOT

CITATION = """title: A made-up build
version: 1.2.3
license: MIT
authors: [{name: Some people}]
keywords: [one, two]
"""
PLANT = "stage plant results/ilo/parameters.json constant"
OBSERVE = "stage observe results/ilo/parameters.json constant sampled"
CAPTION = "latex config/fig1.rst --output results/ilo/fig1.caption.tex"
PLOT = "stage plot results/ilo/parameters.json fig1 --formats svg png --no-notes"
FILES = {
    "CITATION.cff": CITATION,
    "workflow/Snakefile": "rule all:\n",
    "config/fig1.rst": "A caption.\n",
    "results/ilo/parameters.json": Parameters.load(ROOT, "ilo").text(),
    "results/ilo/constant/plant.parquet": "PAR1",
    "results/ilo/constant/sampled.parquet": "PAR1",
    "results/ilo/fig1.caption.tex": "A caption.\n",
    "logs/ilo/constant/plant.log": f"+ reobserve-papers {PLANT}\n",
    "logs/ilo/constant/plant.tsv": "s\th:m:s\n1.5\t0:00:01\n",
    "logs/ilo/constant/sampled.log": f"+ reobserve-papers {OBSERVE}\nWarnings.\n",
    "logs/ilo/fig1.latex.log": f"+ reobserve-papers {CAPTION}\n",
}
SAMPLED = "results/ilo/constant/sampled.parquet"
PRODUCTS = [SAMPLED, "results/ilo/fig1.caption.tex"]


@pytest.fixture
def build(tmp_path: Path) -> Path:
    """A plant and a figure, as left by a build."""
    for path, content in FILES.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(content)
    return tmp_path


def test_crate_records_how_each_file_was_made(build: Path) -> None:
    assert write_archive(build, build / "a.zip", PRODUCTS) == len(FILES)
    crate = ROCrate(build / "a.zip")
    assert (crate.name, crate.license.id) == ("A made-up build", "https://spdx.org/licenses/MIT")
    assert crate.mainEntity.id == "workflow/Snakefile"
    profiles = {one.id for one in crate.root_dataset["conformsTo"]}
    assert profiles >= {f"https://w3id.org/ro/wfrun/{name}/0.5" for name in ("process", "workflow")}
    actions = {one.id: one for one in crate.get_by_type("CreateAction")}
    names = ("#ilo-constant-plant", "#ilo-constant-sampled", "#ilo-fig1.latex", "#build")
    assert set(actions) == {*names}
    plant, observe, caption, whole = (actions[name] for name in names)
    assert observe["description"] == f"reobserve-papers {OBSERVE}"
    assert [one.id for one in observe["object"]] == [
        "results/ilo/parameters.json", "results/ilo/constant/plant.parquet",
    ]  # fmt: skip
    assert [one.id for one in observe["result"]] == [SAMPLED]
    assert [one.id for one in caption["object"]] == ["config/fig1.rst"]
    assert plant["startTime"] < plant["endTime"] <= whole["endTime"]
    assert "startTime" not in observe, "its duration was not measured"
    assert [one.id for one in whole["object"]] == ["config/fig1.rst", "results/ilo/parameters.json"]
    assert [one.id for one in whole["result"]] == PRODUCTS


def test_crate_has_the_versions_of_all_packages(build: Path) -> None:
    write_archive(build, build / "a.zip", PRODUCTS)
    for action in ROCrate(build / "a.zip").get_by_type("CreateAction"):
        if action.id != "#build":
            needed = action["instrument"]["softwareRequirements"]
            assert {one["name"]: one["softwareVersion"] for one in needed} == package_versions()
    assert {"reobserve", "numpy", "scipy", "matplotlib", "snakemake"} <= set(package_versions())


def test_archive_holds_unchanged_files_and_is_reproducible(build: Path) -> None:
    for name in ("a.zip", "b.zip"):
        write_archive(build, build / name, PRODUCTS)
    assert (build / "a.zip").read_bytes() == (build / "b.zip").read_bytes()
    with zipfile.ZipFile(build / "a.zip") as archive:
        archive.extractall(build / "out")
    for path, content in FILES.items():
        assert (build / "out" / path).read_text() == content
    checked = ("sha256sum", "--check", "--strict", "--quiet", "manifest-sha256.txt")
    assert subprocess.run(checked, cwd=build / "out", check=False).returncode == 0


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        (SAMPLED, "is missing, so the build is not whole; build again"),
        ("logs/ilo/constant/sampled.log", "no log in logs/ names the command that made it"),
    ],
)
def test_incomplete_build_is_not_archived(build: Path, gone: str, said: str) -> None:
    (build / gone).unlink()
    with pytest.raises(InputError, match=f"{SAMPLED}: {said}"):
        write_archive(build, build / "a.zip", PRODUCTS)
    assert not (build / "a.zip").exists()


@pytest.mark.parametrize("workflow", ["workflow/Snakefile", "Snakefile"])
@pytest.mark.parametrize(
    ("citation", "name", "authors"),
    [
        (None, "A build of mine", []),
        ("title: Mine\n", "Mine", []),
        ("title: Mine\nauthors: [{name: We}, {given-names: Ada, family-names: L}]\n", "Mine",
         ["We", "Ada L"]),
    ],
)  # fmt: skip
def test_project_of_ones_own_is_archived(
    build: Path, workflow: str, citation: str | None, name: str, authors: list[str]
) -> None:
    """Its captions and style sheets are those of the installation, beside the project."""
    mine = build / "mine"
    for part in [*build.iterdir()]:
        mine.mkdir(exist_ok=True)
        part.rename(mine / part.name)
    (mine / "CITATION.cff").unlink()
    if citation:
        (mine / "CITATION.cff").write_text(citation)
    (mine / "workflow/Snakefile").rename(mine / workflow)
    figure = [f"results/ilo/fig1.{kind}" for kind in ("svg", "png", "caption.rst", "metrics.csv")]
    lines = {"fig1.plot": f"{PLOT} --style slides", "fig1.metrics": PLOT.replace("plot", "metrics")}
    for observer in ("continuous", "forgetting"):
        figure.append(f"results/ilo/constant/{observer}.parquet")
        lines[f"constant/{observer}"] = OBSERVE.replace("sampled", observer)
    for path in figure:
        (mine / path).touch()
    for log, line in lines.items():
        (mine / f"logs/ilo/{log}.log").write_text(f"+ reobserve-papers {line}\n")
    shared = [one for one in read_log(mine, "logs/ilo/fig1.plot.log").inputs if one[0] == "/"]
    assert [Path(one).name for one in shared] == ["slides.mplstyle", "figure.rst"]
    write_archive(mine, mine / "a.zip", figure)
    crate = ROCrate(mine / "a.zip")
    assert (crate.name, crate.mainEntity.id) == (name, workflow)
    listed = crate.root_dataset.get("author") or []
    listed = listed if isinstance(listed, list) else [listed]
    assert [one["name"] for one in listed] == authors
    packed = {one.id for one in crate.get_entities()}
    assert {*figure} < packed
    assert not any("figure.rst" in one for one in packed)


def test_plot_reads_and_writes_what_its_rule_says(build: Path) -> None:
    (build / "logs/plot.log").write_text(f"+ reobserve-papers {PLOT}\n")
    job = read_log(build, "logs/plot.log")
    assert job.step == "plot"
    assert job.inputs[0] == "results/ilo/parameters.json"
    assert {"results/ilo/fig1.metrics.csv", SAMPLED} <= {*job.inputs}
    assert job.outputs == tuple(
        f"results/ilo/fig1.{kind}" for kind in ("svg", "png", "caption.rst")
    )

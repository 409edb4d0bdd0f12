"""A build as an RO-Crate: read back by rocrate, with commands, versions and digests."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import pytest
from rocrate.rocrate import ROCrate

from reobserve.core.errors import InputError
from reobserve_papers.report.archive import write_archive
from reobserve_papers.report.environment import package_versions

CITATION = """title: A made-up build
version: 1.2.3
license: MIT
authors: [{name: Some people}]
keywords: [one, two]
"""
PLANT = "stage plant results/toy/parameters.json push --output results/toy/push/plant.parquet"
PLOT = (
    "stage plot results/toy/parameters.json fig1 --plant-file results/toy/push/plant.parquet"
    " --template config/fig1.rst --outputs results/toy/fig1.svg --caption results/toy/fig1.rst"
)
FILES = {
    "CITATION.cff": CITATION,
    "workflow/Snakefile": "rule all:\n",
    "config/fig1.rst": "A caption.\n",
    "results/toy/parameters.json": "{}\n",
    "results/toy/push/plant.parquet": "PAR1",
    "results/toy/fig1.svg": "<svg/>",
    "results/toy/fig1.rst": "A caption.\n",
    "logs/toy/push/plant.log": f"+ reobserve-papers {PLANT}\n",
    "logs/toy/push/plant.tsv": "s\th:m:s\n1.5\t0:00:01\n",
    "logs/toy/fig1.plot.log": f"+ reobserve-papers {PLOT}\nWarnings.\n",
}
PRODUCTS = ["results/toy/fig1.svg", "results/toy/fig1.rst"]


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
    assert set(actions) == {"#toy-push-plant", "#toy-fig1.plot", "#build"}
    plant, plot, whole = (actions[name] for name in ("#toy-push-plant", "#toy-fig1.plot", "#build"))
    assert plot["description"] == f"reobserve-papers {PLOT}"
    assert [one.id for one in plot["object"]] == [
        "results/toy/parameters.json", "results/toy/push/plant.parquet", "config/fig1.rst",
    ]  # fmt: skip
    assert [one.id for one in plot["result"]] == PRODUCTS
    assert plant["startTime"] < plant["endTime"] <= whole["endTime"]
    assert "startTime" not in plot, "its duration was not measured"
    assert [one.id for one in whole["object"]] == ["config/fig1.rst", "results/toy/parameters.json"]
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
        ("results/toy/fig1.svg", "is missing, so the build is not whole; build again"),
        ("logs/toy/fig1.plot.log", "no log in logs/ names the command that made it"),
    ],
)
def test_incomplete_build_is_not_archived(build: Path, gone: str, said: str) -> None:
    (build / gone).unlink()
    with pytest.raises(InputError, match=f"results/toy/fig1.svg: {said}"):
        write_archive(build, build / "a.zip", PRODUCTS)
    assert not (build / "a.zip").exists()

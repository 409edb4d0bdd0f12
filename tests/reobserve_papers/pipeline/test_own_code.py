"""Edited code is seen by every command, whatever runs, and whatever was done to the records."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.files import write_text
from reobserve_papers.cli.main import main
from reobserve_papers.steps.freshness import UNRECORDED, mark_unrecorded, record_of
from tests import ROOT

from .conftest import DRY_RUN, Project, built_by, shared_folder, snakemakes

PLANT = "results/ilo/constant/plant.parquet"


@pytest.mark.parametrize("package", ["reobserve", "reobserve_papers"])
@pytest.mark.parametrize(
    "command",
    [
        ("figdiff",),
        ("accept", "--reason", "a new choice of gains"),
        ("report", "--output", "a.html"),
        ("report", "--fresh", "--output", "a.html"),
    ],
)
def test_code_of_another_folder_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: tuple[str, ...],
    package: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("config/papers", "results", "tests/reference"):
        Path(folder).mkdir(parents=True)
    write_text(f"src/{package}/__init__.py", "")
    assert main(command) == 1
    (line,) = capsys.readouterr().err.splitlines()
    place = ROOT / "src" / package
    said = f"reobserve-papers: the code of {place} would run in place of src/{package}: type `make`"
    assert line.startswith(said)
    assert not Path("a.html").exists()


def profile_by_time(folder: Path) -> dict[str, str]:
    """The variable of a user's profile by which only times of files count."""
    folder.mkdir()
    (folder / "config.yaml").write_text("rerun-triggers: [mtime]\n")
    return {"SNAKEMAKE_PROFILE": str(folder)}


def test_build_makes_results_without_a_record_again(fresh: Project) -> None:
    write_text(fresh.folder / PLANT, "")
    assert fresh.stale(PLANT) == {"plant": 1}


@pytest.mark.parametrize("way", ["variable", pytest.param("option", marks=pytest.mark.nightly)])
def test_build_sees_other_code_whatever_the_profile_of_a_user(fresh: Project, way: str) -> None:
    write_text(fresh.folder / PLANT, "")
    record = {"record_format_version": 6, "params": ["'other'"]}
    write_text(record_of(fresh.folder, PLANT), json.dumps(record))
    (fresh.folder / ".snakemake/incomplete").mkdir()
    profile = profile_by_time(fresh.folder / "mine")
    if way == "variable":
        done = fresh.snakemake("--dry-run", PLANT, environment=fresh.environment | profile)
    else:
        done = fresh.snakemake("--dry-run", "--profile", *profile.values(), "--", PLANT)
    assert re.search(r"^plant +1$", done.stdout, re.MULTILINE)


def test_build_with_code_of_another_folder_is_refused(fresh: Project) -> None:
    program = DRY_RUN.format(words=["snakemake", "--dry-run", PLANT], source=str(ROOT / "src"))
    done = snakemakes().run(fresh.folder, program, **fresh.environment)
    assert done.returncode
    said = done.stderr.splitlines()[-1]
    assert said.startswith(f"reobserve-papers: the code of {ROOT / 'src/reobserve'} would run")


NAMES = st.text(st.characters(exclude_categories=["C"], exclude_characters="/"), max_size=60)


@given(
    names=st.sets(NAMES, max_size=4),
    linked=st.sampled_from(["", "results", "results/ilo"]),
    damaged=st.sampled_from(["", "{", "[1]", "3", "{}"]),
)
def test_results_without_a_record_get_one_that_fits_no_job(
    tmp_path_factory: pytest.TempPathFactory, names: set[str], linked: str, damaged: str
) -> None:
    project = tmp_path_factory.mktemp("project")
    folder = project / "results/ilo"
    paths = [f"results/ilo/a{name * 3}"[:70] for name in (*names, "fig1.png")]
    if linked:
        (project / linked).parent.mkdir(parents=True, exist_ok=True)
        (project / "disk/ilo").mkdir(parents=True)
        (project / linked).symlink_to(project / "disk")
    folder.mkdir(parents=True, exist_ok=True)
    for path in paths:
        (project / path).touch()
    known = record_of(project, paths[-1])
    known.parent.mkdir(parents=True)
    known.write_text('{"rule": "plot"}')
    (known.parent / "damaged").write_text(damaged)
    mark_unrecorded(project)
    assert known.read_text() == '{"rule": "plot"}'
    for path in {*paths} - {paths[-1]}:
        assert json.loads(record_of(project, path).read_text())["params"] == [UNRECORDED]
    found = [path for path in (project / ".snakemake/metadata").rglob("*") if path.is_file()]
    assert len(found) == len({*paths})


def test_odd_files_and_a_running_build_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "results/a").mkdir(parents=True)
    for name in ("results/a/x", "results/y"):
        (tmp_path / name).symlink_to(tmp_path / "results")
    (tmp_path / "results/a/fig1.png").touch()
    with suppress(OSError):  # of a file system that has text alone
        (tmp_path / os.fsdecode(b"results/a/\xff.png")).touch()
    locks, records = tmp_path / ".snakemake/locks", tmp_path / ".snakemake/metadata"
    locks.mkdir(parents=True)
    (locks / "0.output.lock").touch()
    mark_unrecorded(tmp_path)
    assert not records.exists()
    (locks / "0.output.lock").unlink()
    mark_unrecorded(tmp_path)
    assert [path.name for path in records.iterdir()] == [
        record_of(tmp_path, "results/a/fig1.png").name
    ]


@pytest.mark.parametrize("letters", [5, 150, 190, 240, 400])
def test_records_are_where_snakemake_keeps_them(tmp_path: Path, letters: int) -> None:
    from snakemake.persistence.file import FilePersistence

    name = f"results/{'ü>' * letters}"[:letters]
    store = FilePersistence(path=tmp_path / ".snakemake")
    expected = store._record_path(str(tmp_path / ".snakemake/metadata"), name)
    assert str(record_of(tmp_path, name)) == expected


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy of the project with one figure."""
    return shared_folder(tmp_path_factory, "small", built_by("results/ilo/fig1.png"))


def by_environment(project: Project) -> dict[str, str]:
    return {"PYTHONPATH": str(ROOT / "src")}


def by_profile(project: Project) -> dict[str, str]:
    return profile_by_time(project.folder.parent / "profile")


def without_records(project: Project) -> dict[str, str]:
    shutil.rmtree(project.folder / ".snakemake")
    return {}


def with_a_link(project: Project) -> dict[str, str]:
    results, disk = project.folder / "results", project.folder.parent / "disk"
    results.rename(disk)
    results.symlink_to(disk)
    return without_records(project)


def cleaned(project: Project) -> dict[str, str]:
    with_a_link(project)
    project.run("make", "clean")
    return {}


WAYS = (by_environment, by_profile, without_records, with_a_link, cleaned)
BUILD = (
    "from pathlib import Path; from reobserve_papers.figure_diff.figdiff_commands import _build; "
    "_build(Path(), (), 2, (('ilo', 'fig1'),))"
)


@pytest.mark.nightly
@pytest.mark.parametrize("way", WAYS)
def test_edit_is_seen_by_each_command(
    small: Project, tmp_path: Path, way: Callable[[Project], dict[str, str]]
) -> None:
    shutil.copytree(small.folder, tmp_path / "copy", symlinks=True)
    project = Project(tmp_path / "copy")
    metrics = project.folder / "results/ilo/fig1.metrics.csv"
    before = metrics.read_bytes()
    environment = project.environment | way(project)
    code = project.folder / "src/reobserve/observers/ilo.py"
    text = code.read_text()
    code.write_text(text.replace("product(c.K1, v[0], v[1]", "product(c.K1, 0.9 * v[0], v[1]"))
    assert code.read_text() != text
    commands = {
        "report": "report --papers ilo --formats png --bench --output page.html",
        "figdiff": "figdiff ilo/fig1",
    }
    for name, words in commands.items():
        done = project.run("reobserve-papers", *words.split(), check=False, environment=environment)
        assert done.returncode == (1 if name == "figdiff" or way is by_environment else 0)
        if way is not by_environment:
            assert "fig1.png: not " in done.stdout or "ilo fig1: not " in done.stdout
    done = project.run("python", "-c", BUILD, check=False, environment=environment)
    if way is by_environment:
        assert "would run in place of" in done.stderr
        assert metrics.read_bytes() == before
    else:
        assert done.returncode == 0
        assert metrics.read_bytes() != before

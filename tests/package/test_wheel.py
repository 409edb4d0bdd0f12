"""The wheel and the source archive: the same bytes each time, and what they hold."""

from __future__ import annotations

import email.parser
import re
import subprocess
import tarfile
import zipfile
from email.message import Message
from pathlib import Path

import pytest

from .environments import ROOT, build

# Beside the package: what `reobserve.replicate` reads where there is no checkout.
DATA = ("config/config.yaml", "config/papers", "config/searches")


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source archive."""
    (built,) = build(ROOT, tmp_path_factory.mktemp("sdist"), "sdist")
    return built


@pytest.fixture(scope="module")
def about(wheel: Path) -> Message:
    """The metadata of the wheel."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return email.parser.BytesParser().parsebytes(archive.read(name))


def tracked(*folders: str) -> set[str]:
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *folders]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {name for name in listed.splitlines() if (ROOT / name).is_file()}


def test_the_wheel_of_the_source_archive_is_that_of_the_checkout(
    sources: Path, wheel: Path, tmp_path: Path
) -> None:
    """To the last byte, from another folder, with other times and modes of files."""
    with tarfile.open(sources) as archive:
        # Some builds of Python 3.11 have no filters; the archive is our own.
        safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
        archive.extractall(tmp_path, **safely)  # type: ignore[arg-type]
    (folder,) = tmp_path.iterdir()
    (folder / "PKG-INFO").unlink()  # all else is what git tracks
    for path in folder.rglob("*.py"):
        path.touch()
        path.chmod(0o640)
    wheel_again, sources_again = build(folder, tmp_path / "dist", "wheel", "sdist")
    assert wheel_again.suffix == ".whl"
    assert wheel_again.read_bytes() == wheel.read_bytes()
    assert sources_again.read_bytes() == sources.read_bytes()


def test_the_wheel_holds_the_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    mine = {name for name in found if ".dist-info/" not in name}
    data = {name for name in mine if name.startswith("reobserve/project/")}
    assert {name.removeprefix("reobserve/project/") for name in data} == tracked(*DATA)
    assert {f"src/{name}" for name in mine - data} == tracked("src/reobserve")
    for name in mine:
        source = (
            ROOT / name.removeprefix("reobserve/project/") if name in data else ROOT / "src" / name
        )
        assert found[name] == source.read_bytes(), name
    assert "reobserve/py.typed" in mine
    (licence,) = (text for name, text in found.items() if name.endswith("/licenses/LICENSE"))
    assert licence == (ROOT / "LICENSE").read_bytes()
    (entries,) = (text for name, text in found.items() if name.endswith("/entry_points.txt"))
    assert entries.decode() == "[console_scripts]\nreobserve = reobserve.__main__:run\n"


def test_the_source_archive_holds_what_git_tracks(sources: Path) -> None:
    with tarfile.open(sources) as archive:
        members = [member for member in archive.getmembers() if member.isfile()]
    found = {member.name.partition("/")[2] for member in members}
    assert found - {"PKG-INFO"} == tracked(".")


def test_an_index_shows_no_picture_and_no_link_that_it_lacks(about: Message) -> None:
    assert about["Description-Content-Type"] == "text/markdown"
    text = about.get_payload(decode=True).decode()  # type: ignore[union-attr]
    for pointed in re.findall(r"\]\(([^)]*)\)", text):
        assert pointed.startswith(("https://", "#")), pointed
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = [line for line in readme.splitlines() if line.startswith("| ") and "](" not in line]
    assert rows
    assert set(rows) <= set(text.splitlines())

"""Odd places and streams as a shell hands them in, to processes of their own."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from .material import ROOT

RUN = [sys.executable, "-c", "import sys; from reobserve.cli import main; sys.exit(main())"]
ENDS = 60  # seconds; a fifo that is waited for would never end


def reobserve(
    folder: Path, *arguments: str | bytes, locale: str = "C.UTF-8", output: int = subprocess.PIPE
) -> subprocess.CompletedProcess[bytes]:
    """Run the command in a folder."""
    environment = {**os.environ, "LC_ALL": locale}
    return subprocess.run(
        [*RUN, *arguments], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
        stdout=output, stderr=subprocess.PIPE, timeout=ENDS, check=False,
    )  # fmt: skip


def refused(done: subprocess.CompletedProcess[bytes]) -> str:
    """The one line that a refusal is."""
    told = done.stderr.decode()
    assert done.returncode in (1, 2), told
    assert "Traceback" not in told
    last = told.rstrip("\n").rpartition("\n")[2]
    assert last.startswith("reobserve")
    assert done.returncode == 2 or told == f"{last}\n"
    return last


@pytest.fixture
def places(tmp_path: Path) -> Path:
    """A folder with a thing of each kind in it."""
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "folder").mkdir()
    (folder / "file").write_bytes(b"x\n")
    (folder / "kept").write_bytes(b"x\n")
    (folder / "kept").chmod(0o444)
    (folder / "link").symlink_to("file")
    (folder / "nowhere").symlink_to("missing")
    os.mkfifo(folder / "fifo")
    with socket.socket(socket.AF_UNIX) as bound:
        before = Path.cwd()
        os.chdir(folder)  # its name may be too long for a socket's
        bound.bind("socket")
        os.chdir(before)
    return folder


@pytest.mark.parametrize(
    "place",
    [
        *("folder/", "fifo", "socket", "link", "nowhere", "kept", "file/inside"),
        *("/dev/full", "/proc/self/mem"),
    ],
)
def test_a_result_goes_to_no_other_kind_of_thing(places: Path, place: str) -> None:
    before = sorted(os.listdir(places))
    done = reobserve(
        places, "stage", "parameters", "ilo", "--output", place, "--project", os.fspath(ROOT)
    )
    assert refused(done)
    assert sorted(os.listdir(places)) == before
    assert (places / "file").read_bytes() == b"x\n"


@pytest.mark.parametrize(
    "name", ["ü\u202ename".encode(), b"\xff\xfe", b"a\nb; touch $HOME", b"\xf0\x9f\x98\x80"]
)
def test_a_result_may_have_any_name(places: Path, name: bytes) -> None:
    line = ("stage", "parameters", "ilo", "--project", os.fspath(ROOT), "--output", name)
    done = reobserve(places, *line, locale="C")
    assert done.returncode == 0, done.stderr.decode()
    assert name in os.listdir(os.fsencode(places))


@pytest.mark.parametrize("place", ["fifo", "/dev/zero"])
def test_nothing_else_than_a_file_is_read(places: Path, place: str) -> None:
    assert refused(reobserve(places, "stage", "plant", place, "plain", "--output", "out.parquet"))
    assert not (places / "out.parquet").exists()


@pytest.mark.parametrize("place", ["fifo", "x" * 300])
def test_no_other_thing_is_a_project(places: Path, place: str) -> None:
    assert refused(reobserve(places, "list", "ilo", "--project", place))


def test_a_full_disk_is_told(places: Path) -> None:
    with open("/dev/full", "wb") as full:
        done = reobserve(places, "list", "--project", os.fspath(ROOT), output=full.fileno())
    assert "No space left" in refused(done)


def test_a_reader_that_leaves_is_no_fault(places: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = reobserve(places, "list", "--project", os.fspath(ROOT), output=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_closed_output_is_no_fault(places: Path) -> None:
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", *RUN, "list", "--project", os.fspath(ROOT)]
    done = subprocess.run(shell, cwd=places, capture_output=True, timeout=ENDS, check=False)
    assert (done.returncode, done.stderr) == (0, b"")

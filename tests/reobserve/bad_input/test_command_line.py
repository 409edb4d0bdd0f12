"""Command lines: unknown, missing and odd arguments, paths that are devices or folders."""

from __future__ import annotations

import os
import socket
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from . import valid
from .odd import NUMBERS, words
from .outcome import command, is_accepted
from .program import Program, refusal

PATHS = [
    "", ".", "..", "/", "/dev/null", "/dev/full", "/dev/stdout", "/dev/zero", "/dev/tty", "/proc",
    "/proc/self/mem", "folder", "folder/", "missing", "missing/x", "file", "file/x", "~", "-",
    "x" * 300, "a b", "a\nb", "$HOME", "ünï", "\udcff", "out.json", "folder/out", "*", "a\x00b",
    "-5", "0", "1e9", "9" * 30,
]  # fmt: skip
OPTIONS = [
    "--output", "--project", "--help", "--set", "--to", "--example", "--data", "--report", "--plot",
    "--nope", "-x", "--", "--out",
]  # fmt: skip
SLOW = {"tune"}  # only parsed
FILES = {"file": b"x\n", "folder/inner": b"", "table.csv": b"name,value\nlag,0.123456\n"}
LINES = [
    ["design", "luenberger", "file", "--set", "poles=[-3, -4]", "--out", "out.json"],
    ["design", "normal-form", "file", "--set", "poles=[-1.5]", "order=2", "--out", "out"],
    ["estimate", "--example", "kalman", "--out", "out.yaml", "--data", "out.csv"],
    ["estimate", "file", "table.csv", "--out", "out.csv", "--report", "out.json"],
    ["export", "file", "--to", "c", "--out", "out"],
    ["tune", "file", "--output", "out"],
]


def odd_line(data: st.DataObject, lines: list[list[str]], options: list[str]) -> list[str]:
    """One of the lines with one to three changes."""
    odd = st.sampled_from(PATHS + options) | words | st.sampled_from(NUMBERS).map(str)
    line = list(data.draw(st.sampled_from(lines)))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(line)))
        line[at : at + data.draw(st.integers(0, 1))] = data.draw(st.lists(odd, max_size=1))
    return line


@given(st.data())
def test_odd_command_lines_are_accepted_or_refused(data: st.DataObject) -> None:
    line = odd_line(data, LINES, OPTIONS)
    is_accepted(lambda: command(*line, parse_only=not SLOW.isdisjoint(line)), FILES)


@pytest.fixture
def program() -> Program:
    model = os.fspath(valid.model("luenberger"))
    return Program(
        "reobserve.cli.main", command, ["estimate", "--example", "list"],
        lambda output: ["design", "luenberger", model, "--out", output],
    )  # fmt: skip


@pytest.fixture
def places(tmp_path: Path) -> Path:
    """A folder that contains a file system entry of each kind."""
    folder = tmp_path / "work"
    (folder / "folder").mkdir(parents=True)
    (folder / "file").write_bytes(b"x\n")
    (folder / "kept").write_bytes(b"x\n")
    (folder / "kept").chmod(0o444)
    (folder / "link").symlink_to("file")
    (folder / "nowhere").symlink_to("missing")
    os.mkfifo(folder / "fifo")
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(os.fspath(folder / "socket"))
    return folder


KINDS = ["folder/", "fifo", "socket", "link", "nowhere", "kept", "file/inside", "/dev/full"]


@pytest.mark.parametrize("place", [*KINDS, "/proc/self/mem", "/proc/new", "/proc/self/new/a"])
def test_output_to_anything_but_a_regular_file_is_refused(
    program: Program, places: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(places)
    before = sorted(os.listdir(places))
    line = program.writing(place)
    assert not is_accepted(lambda: (os.chdir(places), program.command(*line)))
    assert sorted(os.listdir(places)) == before
    assert (places / "file").read_bytes() == b"x\n"


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize(
    "name", ["ü\u202ename".encode(), b"\xff\xfe", b"a\nb; touch $HOME", b"\xf0\x9f\x98\x80"]
)
def test_output_file_may_have_any_name(program: Program, places: Path, name: bytes) -> None:
    done = program.run(places, program.writing(name), locale="C")
    assert done.returncode == 0, done.stderr.decode()
    assert name in os.listdir(os.fsencode(places))


@pytest.mark.parametrize(
    "line",
    [
        ["design", "luenberger", "fifo", "--out", "out.json"],
        ["design", "luenberger", "/dev/zero", "--out", "out.json"],
        ["export", "fifo", "--out", "out"],
        ["estimate", "fifo", "file", "--out", "out.csv"],
        ["tune", "/dev/zero", "--output", "out"],
    ],
)
def test_input_that_is_not_a_file_is_refused(places: Path, line: list[str]) -> None:
    before = sorted(os.listdir(places))
    assert not is_accepted(lambda: (os.chdir(places), command(*line)))
    assert sorted(os.listdir(places)) == before


def test_full_disk_is_reported_in_one_sentence(program: Program, places: Path) -> None:
    with open("/dev/full", "wb") as full:
        done = program.run(places, program.printing, output=full.fileno())
    assert "No space left" in refusal(done)


def test_closed_pipe_is_not_an_error(program: Program, places: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = program.run(places, program.printing, output=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_closed_standard_output_is_not_an_error(program: Program, places: Path) -> None:
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", *program.words, *program.printing]
    done = subprocess.run(shell, cwd=places, capture_output=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, b"")

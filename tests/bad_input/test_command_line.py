"""Command lines: unknown, missing and odd arguments, paths that are devices or folders."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve.replication.parameters.parameters import Parameters

from . import valid
from .odd import NUMBERS, as_yaml, changed, values, words
from .outcome import ROOT, command, is_accepted

PATHS = [
    "", ".", "..", "/", "/dev/null", "/dev/full", "/dev/stdout", "/dev/zero", "/dev/tty", "/proc",
    "/proc/self/mem", "folder", "folder/", "missing", "missing/x", "file", "file/x", "~", "-",
    "x" * 300, "a b", "a\nb", "$HOME", "ünï", "\udcff", "out.json", "folder/out", "*", "a\x00b",
    "-5", "0", "1e9", "9" * 30,
]  # fmt: skip
OPTIONS = [
    "--output", "--project", "--help", "--samples", "--seed", "--why",
    "--nope", "-x", "--", "--out",
    "--design-file", "--overrides", "--formats", "--papers", "--study-file", "--built", "--reason",
]  # fmt: skip
# Commands that build for minutes or change the project are only parsed.
SLOW = {
    "figdiff", "accept", "samples", "check", "readme", "report", "robustness",
    "sensitivity", "sample", "search", "theory", "study", "archive", "tune", "score", "moved",
}  # fmt: skip
FILES = {"file": b"x\n", "folder/inner": b"", "table.csv": b"name,value\nlag,0.123456\n"}


@cache
def lines() -> list[list[str]]:
    """Valid command lines."""
    out, root = ["--output", "out"], ["--project", os.fspath(ROOT)]
    imm, plant = os.fspath(valid.parameters("imm")), os.fspath(valid.record("imm"))
    lie, linear = os.fspath(valid.parameters("lie")), os.fspath(valid.design("lie", "linear"))
    inertia = '{"plant": {"inertia": 0.02}}'
    return [
        ["list", *root],
        ["list", "ilo", "eso", *root],
        ["params", "ilo", "sampled", "--why", *root],
        ["stage", "parameters", "imm", "--seed", "3", *out, *root],
        ["stage", "parameters", "eso", "--overrides", inertia, *out, *root],
        ["stage", "plant", imm, "plain", *out],
        ["stage", "observe", imm, plant, "kalman", *out],
        ["stage", "design", lie, "linear", *out],
        ["stage", "table", lie, "table_coefficients", "--design-file", linear, *out],
        ["stage", "claims", "eso", "--results", "folder", *out, *root],
        ["latex", "table.csv", "--digits", "3", *out],
        ["check", "eso", "--overrides", '{"eso": {"plant": {"inertia": 0.02}}}', *root],
        ["samples", "eso", "--max-samples", "20", "--check", *root],
        ["readme", *root],
        ["report", "--papers", "eso", "--formats", "pdf", "png", *out, *root],
        ["figdiff", "--reference", "folder", "--results", "folder", *root],
        ["accept", "eso", "--reason", "a reason of four", "--cores", "2", *root],
        ["stage", "study", imm, plant, "causes", *out],
        ["stage", "search", imm, plant, "calibrated", *out],
        ["stage", "theory", lie, "--design-files", linear, *out],
        ["stage", "robustness", lie, "--samples", "8", "--no-reversals", *out, *root],
        ["stage", "sensitivity", lie, "file", "--outputs", "out.pdf", "out.png", *root],
        ["stage", "archive", "results/lie/fig1.pdf", *out, *root],
        ["design", "luenberger", "file", "--set", "poles=[-3, -4]", "--out", "out.json"],
        ["design", "normal-form", "file", "--set", "poles=[-1.5]", "order=2", *out],
        ["estimate", "--example", "kalman", "--out", "out.yaml", "--data", "out.csv"],
    ]


def accepts(line: list[str]) -> bool:
    slow = not SLOW.isdisjoint(line)
    return is_accepted(lambda: command(*line, parse_only=slow), FILES)


odd_words = st.sampled_from(PATHS + OPTIONS) | words | st.sampled_from(NUMBERS).map(str)


@given(st.data())
def test_odd_command_lines_are_accepted_or_refused(data: st.DataObject) -> None:
    line = list(data.draw(st.sampled_from(lines())))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(line)))
        line[at : at + data.draw(st.integers(0, 1))] = data.draw(st.lists(odd_words, max_size=1))
    accepts(line)


@given(st.sampled_from(valid.PAPERS), st.data())
def test_odd_overrides_are_accepted_or_refused(paper: str, data: st.DataObject) -> None:
    tree = valid.paper(paper)
    section = data.draw(st.sampled_from([key for key in tree if isinstance(tree[key], dict)]))
    name = data.draw(st.sampled_from(list(tree[section])))
    if data.draw(st.booleans()):
        over = {section: {name: data.draw(values | changed(tree[section][name]))}}
    else:  # a user-defined entry that starts from another
        added = {"like": name, **data.draw(st.dictionaries(words, values, max_size=1))}
        over = {section: {data.draw(st.just("mine") | words): added}}
    text = as_yaml(over).decode(errors="replace")
    line = ["stage", "parameters", paper, "--overrides", text]
    is_accepted(lambda: command(*line, "--project", ROOT, "--output", "out.json"))


def test_empty_override_is_refused() -> None:
    with pytest.raises(InputError, match=r"^eso\.plant\.inertia: \{\} must be a value"):
        Parameters.load(ROOT, "eso", {"plant": {"inertia": {}}})


RUN = [sys.executable, "-c", "import sys; from reobserve.cli.main import main; sys.exit(main())"]


def reobserve(
    folder: Path, *arguments: str | bytes, locale: str = "C.UTF-8", output: int = subprocess.PIPE
) -> subprocess.CompletedProcess[bytes]:
    """Run the command in a process of its own."""
    return subprocess.run(
        [*RUN, *arguments], cwd=folder, env={**os.environ, "LC_ALL": locale},
        stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.PIPE, timeout=60, check=False,
    )  # fmt: skip


def refusal(done: subprocess.CompletedProcess[bytes]) -> str:
    """The one line that a process printed when it refused."""
    message = done.stderr.decode()
    last = message.rstrip("\n").rpartition("\n")[2]
    assert done.returncode in (1, 2)
    assert "Traceback" not in message
    assert last.startswith("reobserve")
    assert done.returncode == 2 or message == f"{last}\n"
    return last


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


@pytest.mark.parametrize("place", [*KINDS, "/proc/self/mem"])
def test_output_to_anything_but_a_regular_file_is_refused(
    places: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(places)
    before = sorted(os.listdir(places))
    line = ("stage", "parameters", "ilo", "--output", place, "--project", ROOT)
    assert not is_accepted(lambda: (os.chdir(places), command(*line)))
    assert sorted(os.listdir(places)) == before
    assert (places / "file").read_bytes() == b"x\n"


@pytest.mark.parametrize(
    "name", ["ü\u202ename".encode(), b"\xff\xfe", b"a\nb; touch $HOME", b"\xf0\x9f\x98\x80"]
)
def test_output_file_may_have_any_name(places: Path, name: bytes) -> None:
    line = ("stage", "parameters", "ilo", "--project", os.fspath(ROOT), "--output", name)
    done = reobserve(places, *line, locale="C")
    assert done.returncode == 0, done.stderr.decode()
    assert name in os.listdir(os.fsencode(places))


@pytest.mark.parametrize(
    "line",
    [
        ["stage", "plant", "fifo", "plain", "--output", "out.parquet"],
        ["stage", "plant", "/dev/zero", "plain", "--output", "out.parquet"],
        ["list", "ilo", "--project", "fifo"],
        ["list", "ilo", "--project", "x" * 300],
    ],
)
def test_input_that_is_not_a_file_is_refused(places: Path, line: list[str]) -> None:
    assert not is_accepted(lambda: (os.chdir(places), command(*line)))
    assert not (places / "out.parquet").exists()


def test_full_disk_is_reported_in_one_sentence(places: Path) -> None:
    with open("/dev/full", "wb") as full:
        done = reobserve(places, "list", "--project", os.fspath(ROOT), output=full.fileno())
    assert "No space left" in refusal(done)


def test_closed_pipe_is_not_an_error(places: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = reobserve(places, "list", "--project", os.fspath(ROOT), output=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_closed_standard_output_is_not_an_error(places: Path) -> None:
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", *RUN, "list", "--project", os.fspath(ROOT)]
    done = subprocess.run(shell, cwd=places, capture_output=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, b"")

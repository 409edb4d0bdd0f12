"""Outputs replace only regular files; tables are checked completely."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from reobserve.cli.main import main
from reobserve.core.errors import InputError
from reobserve.core.files import (
    COUNT,
    GAP,
    NAME,
    NUMBER,
    SCORE,
    WHOLE,
    YES_NO,
    Kind,
    check_replaceable,
    read_table,
    write_table,
    write_text,
    write_whole,
)
from reobserve.estimation.families.examples import model_text

Capture = pytest.CaptureFixture[str]


# --- Outputs ------------------------------------------------------------------------------------


def test_outputs_replace_only_regular_files(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_text("kept")
    (tmp_path / "link").symlink_to(target)
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "folder").mkdir()
    read_only = tmp_path / "read_only"
    read_only.write_text("kept")
    read_only.chmod(0o444)  # also enforced for root
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(tmp_path / "socket"))
    before = sorted(os.listdir(tmp_path))
    for name, said in (
        ("link", "is a symbolic link, only regular files are replaced"),
        ("dangling", "is a symbolic link, only regular files are replaced"),
        ("fifo", "is a device, fifo or socket, only regular files are replaced"),
        ("socket", "is a device, fifo or socket, only regular files are replaced"),
        ("folder", "is a folder, only regular files are replaced"),
        ("read_only", "is read-only, and so it is not replaced"),
    ):
        with pytest.raises(InputError) as caught:
            write_text(tmp_path / name, "new")
        assert str(caught.value) == f"{tmp_path / name}: {said}"
    listener.close()
    for path in ("/dev/null", "/dev/full"):
        with pytest.raises(InputError, match="is a device, fifo or socket, only regular files"):
            write_text(path, "new")
    assert sorted(os.listdir(tmp_path)) == before
    assert target.read_text() == read_only.read_text() == "kept"


@pytest.mark.parametrize("folder", ["", "later/on"])
def test_output_that_no_folder_takes_is_refused_before_work(tmp_path: Path, folder: str) -> None:
    for letters in (240, 250, 300):  # what is written first has a longer name than the file
        path = tmp_path / folder / f"{'x' * (letters - 5)}.yaml"
        if letters == 240:
            check_replaceable(path)
            write_text(path, "a")
            continue
        with pytest.raises(InputError, match=r"cannot be written \(File name too long\)"):
            check_replaceable(path)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cannot be written \(Not a directory\)"):
        check_replaceable(tmp_path / "file" / "folder" / "a.yaml")


def test_temporary_file_does_not_follow_a_link(tmp_path: Path) -> None:
    """An entry under the name of the temporary file is replaced, not written through."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("kept")
    (tmp_path / ".a.txt.partial").symlink_to(elsewhere)
    write_text(tmp_path / "a.txt", "new")
    assert elsewhere.read_text() == "kept"
    assert (tmp_path / "a.txt").read_text() == "new"
    assert sorted(os.listdir(tmp_path)) == ["a.txt", "elsewhere"]
    (tmp_path / ".a.txt.partial").mkdir()
    with pytest.raises(InputError, match=r"a.txt: cannot be written"):
        write_text(tmp_path / "a.txt", "newer")
    assert (tmp_path / "a.txt").read_text() == "new"


def test_concurrent_writers_of_one_file_take_turns(tmp_path: Path) -> None:
    """One used to end with "No such file", because the other had moved its temporary file."""
    path, begun, go_on = tmp_path / "a.txt", Event(), Event()

    def slowly(partial: Path) -> None:
        partial.write_text("first", encoding="utf-8")
        begun.set()
        assert go_on.wait(10)

    with ThreadPoolExecutor(2) as both:
        first = both.submit(write_whole, path, slowly)
        assert begun.wait(10)
        second = both.submit(write_text, path, "second")
        ended = wait([second], 0.2).done
        go_on.set()
        first.result()
        second.result()
    assert ended == set()
    assert path.read_text() == "second"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("error", [RuntimeError("stop"), KeyboardInterrupt(), OSError(28, "full")])
@pytest.mark.parametrize("exists", [True, False])
def test_failed_write_keeps_the_old_file(
    tmp_path: Path, error: BaseException, exists: bool
) -> None:
    path = tmp_path / "table.csv"
    if exists:
        path.write_text("old")

    def write(partial: Path) -> None:
        partial.write_text("half of the n", encoding="utf-8")
        assert partial.parent == tmp_path  # the move into place stays on one file system
        assert not exists or path.read_text() == "old"
        raise error

    # Errors of the disk become a message, everything else passes through.
    with pytest.raises(InputError if isinstance(error, OSError) else type(error)):
        write_whole(path, write)
    assert os.listdir(tmp_path) == (["table.csv"] if exists else [])
    assert not exists or path.read_text() == "old"


def test_write_replaces_the_old_file_and_leftovers(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    partials: list[Path] = []

    def write(partial: Path) -> None:
        partials.append(partial)
        partial.write_text("old", encoding="utf-8")

    write_whole(path, write)
    partials[0].write_text("left behind by a killed process, longer than what follows")
    write_text(path, "née")
    assert path.read_bytes() == "née".encode()
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("output", ["", ".", "/", "..", "a\0b", "x" * 300])
def test_output_that_is_not_a_file_is_refused(
    output: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(model_text("luenberger"))
    assert main(["design", "luenberger", "model.yaml", "--out", output]) == 1
    said = capsys.readouterr().err
    assert said.startswith("reobserve: ")
    assert said.count("\n") == 1
    assert os.listdir(tmp_path) == ["model.yaml"]


# --- Tables -------------------------------------------------------------------------------------

HEADER = ("name", "run", "level", "value")
KINDS = {"run": WHOLE, "level": GAP, "value": SCORE}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,1,0.5,nan\na,2,,inf\n", ""),
        ("a,1.5,1,1\n", r"line 2, run: '1.5' must be a whole number$"),
        ("a,1,x,1\n", r"line 2, level: 'x' must be a finite number or empty$"),
        ("a,1,nan,1\n", r"line 2, level: 'nan' must be a finite number or empty$"),
        ("a,1,1,\n", r"line 2, value: '' must be a number, nan or inf$"),
        ("a,1,1,1e999\n", r"line 2, value: '1e999' must be"),
        ("a,1,1,1_0\n", r"line 2, value: '1_0' must be"),
        ("a,1,1,٣\n", r"line 2, value: '٣' must be"),
        ("a,1,1," + "9" * 20_000 + "\n", r"line 2, value: '9+...9+' must be"),
        ("a,1,1,1\nb,2,1,1\na,1,2,2\n", r"line 4 repeats 'a, 1'$"),
        ("a,1,1\n", r"line 2 has not 4 cells$"),
        ("a,1,1,1,1\n", r"line 2 has not 4 cells$"),
        ("\n", r"line 2 has not 4 cells$"),
        ('"a,1,1,1\n', r"cannot be read \(unexpected end of data\)$"),
        ("a" * 200_000 + ",1,1,1\n", r"cannot be read \(field larger than field limit"),
    ],
)
def test_table_is_checked_completely(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(",".join(HEADER) + "\n" + text)
    if not said:
        assert len(read_table(path, HEADER, KINDS, ("name", "run"))) == 2
        return
    with pytest.raises(InputError, match=said) as caught:
        read_table(path, HEADER, KINDS, ("name", "run"))
    assert len(str(caught.value)) < 1000


def test_tables_keep_every_digit(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    values = [0.1, 1 / 3, 1e-300, np.float64(2) ** 0.5, float("nan"), -0.0]
    write_table(
        path, ({"name": f"row, {i}", "value": v} for i, v in enumerate(values)), ["name", "value"]
    )
    rows = read_table(path, ["name", "value"])
    assert [row["name"] for row in rows] == [f"row, {i}" for i in range(6)]
    assert np.array([float(row["value"]) for row in rows]).tobytes() == np.array(values).tobytes()
    with pytest.raises(InputError, match=r"table.csv: has the columns \['name', 'value'\], must "):
        read_table(path, ["name", "unit"])
    path.write_text("name,value\nfirst,1\nsecond\n")
    with pytest.raises(InputError, match=r"table.csv: line 3 has not 2 cells$"):
        read_table(path, ["name", "value"])
    with pytest.raises(InputError, match=r"none.csv: cannot be read \(No such file"):
        read_table(tmp_path / "none.csv", ["name"])


CELLS = (
    "",
    "3",
    "-3",
    "2.5",
    "1e3",
    "nan",
    "-inf",
    "m/s",
    "word",
    "yes",
    " ",
    "1" * 16,
    "1_0",
    "³",
)
ALLOWED: dict[str, tuple[Kind, set[str]]] = {
    "number": (NUMBER, {"3", "-3", "2.5", "1e3", "1" * 16}),
    "score": (SCORE, {"3", "-3", "2.5", "1e3", "1" * 16, "nan", "-inf"}),
    "gap": (GAP, {"", "3", "-3", "2.5", "1e3", "1" * 16}),
    "whole": (WHOLE, {"3", "-3"}),
    "count": (COUNT, {"", "3", "-3"}),
    "name": (NAME, set(CELLS) - {"", " "}),
    "yes or no": (YES_NO, {"yes"}),
}


@pytest.mark.parametrize("kind", ALLOWED)
def test_cell_values_are_checked_by_kind(kind: str) -> None:
    found, allowed = ALLOWED[kind]
    assert {cell for cell in CELLS if found.allows(cell)} == allowed


def test_table_that_is_empty_or_not_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    for content, said in (
        (b"name\nn\xe9e\n", r"cannot be read \(byte 7 is not UTF-8\)$"),
        (b"", r"has the columns \[\], must have \['name'\]$"),
        (b"x" * 30_000, r"has the columns \['x+...x+'\], must have"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=said):
            read_table(path, ["name"])


# --- The command line -----------------------------------------------------------------------------


def test_standard_output_on_a_full_device_is_reported() -> None:
    command = [sys.executable, "-m", "reobserve", "estimate", "--example", "list"]
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "reobserve: standard output: cannot be written (No space left on device)\n"
    )

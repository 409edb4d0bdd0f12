"""Logs that are rotated while they are followed: renamed, or copied and truncated."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.estimate_command import estimate_file, estimate_stream
from reobserve.estimation.families.examples import simulated, specification_text
from tests.reobserve.estimation.records import specification, write_record

ROWS = 60
Write = Callable[[Path, str], None]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], str]:
    """The lines of a record, and the results of them all in one file."""
    folder = tmp_path_factory.mktemp("whole")
    columns = {name: values[:ROWS] for name, values in simulated("levant").record().items()}
    text = write_record(folder / "r.csv", columns)
    estimate_file(specification("levant"), text, folder / "e.csv")
    lines = text.read_text(encoding="utf-8").splitlines(keepends=True)
    return lines, (folder / "e.csv").read_text(encoding="utf-8")


def renamed(log: Path, text: str) -> None:
    log.rename(log.with_suffix(".1"))
    time.sleep(0.1)  # in which there is no file of the name
    log.write_text(text, encoding="utf-8")


def truncated(log: Path, text: str) -> None:
    shutil.copy(log, log.with_suffix(".1"))
    os.truncate(log, 0)
    time.sleep(0.1)
    append(log, text)


def append(log: Path, text: str) -> None:
    with log.open("a", encoding="utf-8") as stream:
        stream.write(text)


def followed(log: Path, *acts: Callable[[], None], **changes: object) -> None:
    """Follow a log, on which something is done after 0.3 s each."""

    def act() -> None:
        for one in acts:
            time.sleep(0.3)
            one()

    thread = threading.Thread(target=act)
    thread.start()
    try:
        estimate_stream(specification("levant", **changes), log, idle=0.8)  # type: ignore[arg-type]
    finally:
        thread.join()


@pytest.mark.parametrize("rotate", [renamed, truncated])
@pytest.mark.parametrize("header", [True, False])
def test_rotated_log_gives_the_results_of_one_file(
    rotate: Write,
    header: bool,
    whole: tuple[list[str], str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines, expected = whole
    log = tmp_path / "log.csv"
    log.write_text("".join(lines[:31]), encoding="utf-8")
    titles = lines[0] if header else ""
    acts = (
        lambda: rotate(log, titles + "".join(lines[31:40])),
        lambda: append(log, "".join(lines[40:50])),
        lambda: rotate(log, titles + "".join(lines[50:])),
    )
    followed(log, *acts)
    out, reported = capsys.readouterr()
    assert out == expected
    how = "replaced" if rotate is renamed else "truncated"
    assert reported.count(f"reobserve: {log} was {how}\n") == 2


def test_line_that_is_written_while_the_log_is_renamed_is_read(
    whole: tuple[list[str], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its second half comes after the new file is there."""
    lines, expected = whole
    log, old = tmp_path / "log.csv", tmp_path / "log.1"
    log.write_text("".join(lines[:31]) + lines[31][:4], encoding="utf-8")
    rest = lines[31][4:] + lines[32]
    followed(log, lambda: renamed(log, "".join(lines[33:])), lambda: append(old, rest))
    assert capsys.readouterr().out == expected


@pytest.mark.parametrize("rotate", [renamed, truncated])
def test_line_that_is_cut_by_the_rotation_is_refused_or_left_out(
    rotate: Write,
    whole: tuple[list[str], str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines, expected = whole
    log = tmp_path / "log.csv"
    begun = "".join(lines[:31]) + lines[31][:-3]  # with all its cells, the last one cut
    log.write_text(begun, encoding="utf-8")
    with pytest.raises(InputError, match=r"after line 31, and the next one has no end; with file"):
        followed(log, lambda: rotate(log, "".join(lines[31:])))
    capsys.readouterr()
    log.write_text(begun, encoding="utf-8")
    followed(log, lambda: rotate(log, "".join(lines[31:])), file={"tail": "drop"})
    out, reported = capsys.readouterr()
    assert out == expected
    assert "1 last line" in reported


def test_new_file_with_columns_in_another_order_is_refused(
    whole: tuple[list[str], str], tmp_path: Path
) -> None:
    lines, _ = whole
    log = tmp_path / "log.csv"
    log.write_text("".join(lines[:31]), encoding="utf-8")
    other = ",".join(reversed(lines[0].strip().split(","))) + "\n"
    with pytest.raises(InputError, match="goes on with the header 'voltage,t', must have that b"):
        followed(log, lambda: renamed(log, other + lines[31]))


def test_log_that_was_replaced_between_two_runs_is_refused(
    whole: tuple[list[str], str], tmp_path: Path
) -> None:
    lines, _ = whole
    log, state = tmp_path / "log.csv", tmp_path / "state.json"
    log.write_text("".join(lines[:20]), encoding="utf-8")
    chosen = specification("levant")
    estimate_stream(chosen, log, idle=0.1, state=state)
    append(log, lines[20])
    estimate_stream(chosen, log, idle=0.1, state=state)
    kept = state.read_bytes()
    for rest in (lines[21:], lines[1:5]):
        log.write_text(lines[0] + "".join(rest), encoding="utf-8")
        with pytest.raises(InputError, match="was replaced, as less or another line is before b"):
            estimate_stream(chosen, log, idle=0.1, state=state)
        assert state.read_bytes() == kept


@pytest.mark.parametrize("stop", [1, 2, 40])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_log_without_a_header_is_resumed_after_any_row(
    stop: int, encoding: str, whole: tuple[list[str], str], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (titles, *rows), expected = whole
    log, state = tmp_path / "log.csv", tmp_path / "state.json"
    chosen = specification("levant", file={"names": titles.strip().split(",")})
    for k in (stop, ROWS):
        log.write_bytes("".join(rows[:k]).encode(encoding))
        estimate_stream(chosen, log, idle=0.1, state=state)
    assert capsys.readouterr().out == expected
    log.write_bytes("".join([*rows, rows[0]]).encode(encoding))
    with pytest.raises(InputError, match=f"line {ROWS + 1}: the timestamp goes back"):
        estimate_stream(chosen, log, idle=0.1, state=state)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="there is no such signal")
@pytest.mark.parametrize("ignored", [False, True])
def test_closed_terminal_ends_a_stream_with_its_state_unless_it_is_ignored(
    ignored: bool, whole: tuple[list[str], str], tmp_path: Path
) -> None:
    lines, _ = whole
    (tmp_path / "s.yaml").write_text(specification_text("levant"), encoding="utf-8")
    state = tmp_path / "state.json"
    words = ["estimate", str(tmp_path / "s.yaml"), "--stream", "--state", str(state)]
    before = signal.getsignal(signal.SIGHUP)
    # A child inherits what is ignored: as of nohup, which may have started these tests, too.
    signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
    try:
        one = subprocess.Popen(
            [sys.executable, "-m", "reobserve", *words],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGHUP, before)
    with one:
        assert one.stdin is not None
        assert one.stdout is not None
        one.stdin.write("".join(lines[:11]))
        one.stdin.flush()
        for _ in range(11):
            one.stdout.readline()
        one.send_signal(signal.SIGHUP)
        if ignored:
            one.stdin.write(lines[11])
            one.stdin.flush()
            assert one.stdout.readline()
            one.send_signal(signal.SIGTERM)
        assert one.wait(20) == 0
    assert state.exists()

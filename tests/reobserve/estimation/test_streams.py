"""Streamed lines: bitwise the results of a whole record, also after a stop, and without delay."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.cli.main import main
from reobserve.core.errors import InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import examples, simulated, specification_text
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.state_file import load_state, save_state
from reobserve.estimation.writing import header
from tests.reobserve.estimation.records import specification, streamed, write_record


def record(path: Path, name: str, rows: int = 240) -> Path:
    """The record of an example with a lost row, an empty cell and a gap."""
    columns = {title: values[:rows].copy() for title, values in simulated(name).record().items()}
    kept = np.ones(rows, dtype=bool)
    kept[30] = False
    if rows > 130:
        columns[list(columns)[1]][60] = np.nan
        kept[100:130] = False
    return write_record(path, {title: values[kept] for title, values in columns.items()})


@pytest.mark.nightly_after(18)
@pytest.mark.parametrize("name", examples())
def test_streams_and_files_give_identical_bits_also_after_a_stop(name: str, tmp_path: Path) -> None:
    chosen = specification(name)
    text = record(tmp_path / "r.csv", name)
    whole = estimate_file(chosen, text, tmp_path / "e.csv")
    titles, *lines = text.read_text().splitlines(keepends=True)
    columns = titles.strip().split(",")
    estimation = Estimation(chosen, columns, str(text))
    rows = RowByRow(estimation, columns)
    out = header(estimation.titles)
    for k, line in enumerate(lines):
        if k in (29, 60, 99):  # before a lost row, at an empty cell, before a gap
            rows.settle()
            save_state(tmp_path / "s.json", estimation, name, None)
            estimation = Estimation(chosen, columns, str(text))
            load_state(tmp_path / "s.json", estimation, name)
            rows = RowByRow(estimation, columns)
        out += rows.read(line)
    out += rows.finish()
    assert out.encode() == (tmp_path / "e.csv").read_bytes()
    # A stream is not read twice, and cannot wait.
    kept = ("warnings", "innovations", "refusals")
    counted = {name: value for name, value in vars(whole.report).items() if name not in kept}
    assert {n: v for n, v in vars(estimation.report).items() if n not in kept} == counted


def test_stream_converts_units_with_offset_like_a_file(tmp_path: Path) -> None:
    columns = {
        "time": {"column": "t", "unit": "s"},
        "measurements": [{"column": "warm", "unit": "degC", "model_unit": "kelvin"}],
    }
    chosen = specification("levant", columns=columns)
    times = np.arange(30) * 0.01
    text = write_record(tmp_path / "r.csv", {"t": times, "warm": 20.0 + times})
    estimate_file(chosen, text, tmp_path / "e.csv")
    out = streamed(chosen, text)
    assert out == (tmp_path / "e.csv").read_text()
    first = dict(zip(out.splitlines()[0].split(","), out.splitlines()[1].split(","), strict=True))
    assert float(first["derivatives_1 [kelvin]"]) == pytest.approx(293.15), first


def test_stream_and_file_detect_the_same_saturation(tmp_path: Path) -> None:
    columns = {
        "time": {"column": "t", "unit": "ms"},
        "measurements": [
            {"column": "speed", "unit": "rpm", "range": [-200, 200], "saturated": "missing"},
            {"column": "current", "unit": "mA", "model_unit": "A"},
        ],
        "inputs": [{"column": "voltage", "unit": "V"}],
    }
    chosen = specification("kalman", columns=columns)
    kept = {title: values[:120] for title, values in simulated("kalman").record().items()}
    text = write_record(tmp_path / "r.csv", kept)
    whole = estimate_file(chosen, text, tmp_path / "e.csv")
    assert streamed(chosen, text) == (tmp_path / "e.csv").read_text()
    assert whole.report.statuses["partial"] > 50


def test_stream_without_timestamps_does_not_mistake_a_measurement_for_time(tmp_path: Path) -> None:
    """Not even a ramp that rises by one sampling period per row."""
    chosen = specification("levant", columns={"time": {}, "measurements": [{"column": "ramp"}]})
    text = write_record(tmp_path / "r.csv", {"ramp": 0.01 * np.arange(60)})
    estimate_file(chosen, text, tmp_path / "e.csv")
    assert streamed(chosen, text) == (tmp_path / "e.csv").read_text()


class Bytes:
    """Standard input."""

    def __init__(self, content: bytes) -> None:
        self.buffer = io.BytesIO(content)


def run(
    arguments: list[Any], capsys: Any, monkeypatch: Any, given: bytes = b""
) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "stdin", Bytes(given))
    code = main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_command_streams_stops_and_resumes(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = tmp_path / "s.yaml"
    spec.write_text(specification_text("kalman"))
    text = record(tmp_path / "r.csv", "kalman")
    assert run(["estimate", spec, text, "--out", tmp_path / "e.csv"], capsys, monkeypatch)[0] == 0
    whole = (tmp_path / "e.csv").read_text()
    content = text.read_bytes()
    code, out, reported = run(
        ["estimate", spec, "--stream", "--warm"], capsys, monkeypatch, content
    )
    assert (code, out) == (0, whole)
    assert reported.startswith("reobserve: ready\n")
    assert "gap" in reported
    lines = content.splitlines(keepends=True)
    state = ["--stream", "--state", tmp_path / "state.json"]
    first = run(["estimate", spec, *state], capsys, monkeypatch, b"".join(lines[:110]))
    rest = run(["estimate", spec, *state], capsys, monkeypatch, b"".join([lines[0], *lines[110:]]))
    assert first[1] + rest[1] == whole
    spec.write_text(specification_text("kalman").replace("gap: 0.1", "gap: 0.2"))
    code, _, reported = run(["estimate", spec, *state], capsys, monkeypatch, content)
    assert code == 1
    assert (
        "state.json: specification: is another one than that of this stream, a file that it"
        in reported
    )


def test_everything_is_compiled_before_the_first_row(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = tmp_path / "s.yaml"
    spec.write_text(specification_text("kalman"))
    assert run(["estimate", spec, "--warm"], capsys, monkeypatch) == (0, "", "reobserve: ready\n")


def test_pending_lines_are_reported_at_the_end_of_a_stream(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If a sensor is silent at the end, the values between its rows are never known."""
    columns = {title: values[:60].copy() for title, values in simulated("kalman").record().items()}
    columns["current"][57:] = np.nan
    text = write_record(tmp_path / "r.csv", columns)
    spec = tmp_path / "s.yaml"
    spec.write_text(specification_text("kalman").replace("missing: skip", "missing: interpolate"))
    assert run(["estimate", spec, text, "--out", tmp_path / "e.csv"], capsys, monkeypatch)[0] == 0
    whole = (tmp_path / "e.csv").read_text()
    assert len(whole.splitlines()) == 61
    _, out, reported = run(["estimate", spec, "--stream"], capsys, monkeypatch, text.read_bytes())
    assert out == whole
    assert "60: 57 measured, 3 partial" in reported


def test_stream_state_resumes_with_a_file_and_vice_versa(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe has no position in a file, so the whole file then follows."""
    spec, part = tmp_path / "s.yaml", tmp_path / "part.csv"
    spec.write_text(specification_text("kalman"))
    titles, *lines = record(tmp_path / "r.csv", "kalman", 50).read_bytes().splitlines(True)
    estimate_file(specification("kalman"), tmp_path / "r.csv", tmp_path / "e.csv")
    state = ["--state", tmp_path / "state.json"]
    piped, followed = ["estimate", spec, "--stream"], ["estimate", spec, part, "--follow"]
    out = run([*piped, *state], capsys, monkeypatch, titles + b"".join(lines[:20]))[1]
    part.write_bytes(titles + b"".join(lines[20:30]))
    out += run([*followed, "--idle", "0.05", *state], capsys, monkeypatch)[1]
    out += run([*piped, *state], capsys, monkeypatch, titles + b"".join(lines[30:]))[1]
    assert out == (tmp_path / "e.csv").read_text()


def test_growing_file_is_followed(tmp_path: Path) -> None:
    """Each line is processed before the next is written; a signal stops it, and it resumes."""
    spec, log = tmp_path / "s.yaml", tmp_path / "log.csv"
    spec.write_text(specification_text("levant"))
    text = record(tmp_path / "r.csv", "levant", 50).read_text().splitlines(keepends=True)
    whole = estimate_file(specification("levant"), tmp_path / "r.csv", tmp_path / "e.csv")
    assert whole.report.estimates == 50  # including the lost row
    expected = (tmp_path / "e.csv").read_text().splitlines(keepends=True)
    log.write_text("".join(text[:3]))
    command = [
        sys.executable, "-m", "reobserve", "estimate", str(spec), str(log), "--follow",
        "--state", str(tmp_path / "state.json"),
    ]  # fmt: skip
    found: list[str] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ)) as one:
        assert one.stdout is not None
        found += [one.stdout.readline() for _ in range(3)]
        for line in text[3:20]:
            with log.open("a") as stream:
                stream.write(line[:5])
                stream.flush()
                stream.write(line[5:])
            found.append(one.stdout.readline())
        one.send_signal(signal.SIGTERM)
        assert one.wait(20) == 0
    with log.open("a") as stream:
        stream.write("".join(text[20:]))
    again = subprocess.run(
        [*command, "--idle", "0.3"], capture_output=True, text=True, check=True
    )  # fmt: skip
    assert found + again.stdout.splitlines(keepends=True) == expected


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("250,1,2", "r: line 27 has 3 cells, the header has 4"),
        ("250,x,2,3", "r: line 27 of column 'speed' is 'x', must be a number"),
        ("250,1_0,2,3", "r: line 27 of column 'speed' is '1_0', must be a number"),
        ("250,inf,2,3", "speed: line 27 is inf, must be a number"),
        (
            "254,1,2,3",
            "sampling.jitter: 0.01 is exceeded in line 27 of r: its timestamp, 0.254 s, is 0.4 ",
        ),
        ("230,1,2,3", "the timestamp goes back"),
    ],
)
def test_invalid_line_is_refused(line: str, said: str) -> None:
    columns = ["t", "speed", "current", "voltage"]
    rows = RowByRow(Estimation(specification("kalman"), columns, "r"), columns)
    for k in range(25):
        rows.read(f"{10 * k},{k},100,3")
    with pytest.raises(InputError, match=said):
        rows.read(line)


def test_step_takes_less_than_a_sampling_period() -> None:
    """A loose bound for busy machines; the benchmark measures the time."""
    name = "imm-kalman"
    columns = list(simulated(name).record())
    rows = RowByRow(Estimation(specification(name), columns, "r"), columns)
    lines = [f"{10 * k},300.5,2000.25,3\n" for k in range(600)]
    taken = []
    for line in lines:
        begin = time.perf_counter()
        assert rows.read(line)
        taken.append(time.perf_counter() - begin)
    assert np.median(taken[100:]) < 2e-3


def test_stream_does_not_resume_if_the_design_behind_its_name_is_another(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["design", "kalman", "--example", "model.yaml"], capsys, monkeypatch)[0] == 0
    design = ["design", "kalman", "model.yaml", "--out", "design.json"]
    assert run(design, capsys, monkeypatch)[0] == 0
    made = json.loads((tmp_path / "design.json").read_text())
    columns = {"time": {"column": "t", "unit": "s"}}
    columns |= {"measurements": [{"column": "y"}, {"column": "i"}], "inputs": [{"column": "u"}]}
    period = made["system"]["sampling_period"] if "system" in made else made["sampling_period"]
    observer = {"kind": "design", "file": "design.json"}
    spec = {"observer": observer, "columns": columns, "sampling": {"period": period}}
    (tmp_path / "spec.yaml").write_text(json.dumps(spec))
    lines = [b"t,y,i,u\n", *(f"{k * period:.9g},0.1,0,0\n".encode() for k in range(20))]
    stream = ["estimate", "spec.yaml", "--stream", "--state", "state.json"]
    assert run(stream, capsys, monkeypatch, b"".join(lines[:10]))[0] == 0
    kept, rest = (tmp_path / "state.json").read_bytes(), b"".join([lines[0], *lines[10:]])
    assert run(stream, capsys, monkeypatch, rest)[0] == 0
    (tmp_path / "state.json").write_bytes(kept)
    assert run([*design, "--set", "R=1.0e+3"], capsys, monkeypatch)[0] == 0
    code, out, said = run(stream, capsys, monkeypatch, rest)
    assert (code, out) == (1, "")
    assert "a file that it names has changed" in said

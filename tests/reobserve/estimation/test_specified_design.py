"""`design` and `export` of specifications: the numbers of `estimate`, names, and refusals."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.cli.main import main
from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.examples import examples, simulated, specification_text
from reobserve.estimation.families.file import load_design
from reobserve.estimation.output_columns import RESIDUAL
from reobserve.estimation.specification import as_specification, read_specification
from reobserve.estimation.specified_design import specified_design
from tests.reobserve.bad_input.odd import as_yaml


@pytest.fixture(autouse=True)
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def tree_of(name: str, **changes: Any) -> dict[str, Any]:
    """The tree of an example with some keys of its sections replaced."""
    tree: dict[str, Any] = parse_yaml(specification_text(name), name)
    for section, keys in changes.items():
        tree[section] = {**tree[section], **keys} if section in tree else keys
    return tree


def compiled(header: Path, y: Any, u: Any) -> dict[str, Any]:
    """What exported code estimates of rows, by estimate, shape (rows, numbers)."""
    name, text = header.stem, header.read_text(encoding="utf-8")
    library = header.with_suffix(".so").absolute()
    command = ["cc", "-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    code = header.with_suffix(".c")
    subprocess.run([*command, str(code), "-o", str(library), "-lm"], check=True)
    body = text.partition("/* What it estimates at a row. */")[2].partition("}")[0]
    sizes = {
        part: int(np.prod([int(size) for size in re.findall(r"\[(\d+)\]", shape)] or [1]))
        for part, shape in re.findall(r"double (\w+)((?:\[\d+\])*);", body)
    }
    loaded = ctypes.CDLL(str(library))
    memory, found = ctypes.create_string_buffer(2**20), np.empty((len(y), sum(sizes.values())))
    loaded[f"{name}_start"](memory)
    pointer = ctypes.POINTER(ctypes.c_double)
    for k, row in enumerate(found):
        given = [np.ascontiguousarray(each[k]).ctypes.data_as(pointer) for each in (y, u)]
        given = given if u.shape[1] else given[:1]
        assert loaded[f"{name}_step"](memory, *given, row.ctypes.data_as(pointer)) == 0
    parts = np.split(found, np.cumsum(list(sizes.values()))[:-1], axis=1)
    return dict(zip(sizes, parts, strict=True))


@pytest.mark.nightly_after(7)
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("name", examples())
def test_exported_specification_gives_the_numbers_of_estimate(name: str, empty: Path) -> None:
    Path("log.yaml").write_text(specification_text(name), encoding="utf-8")
    assert main(["export", "log.yaml", "--out", "direct"]) == 0
    assert main(["design", "log.yaml", "--out", "log.json"]) == 0
    assert main(["export", "log.json", "--out", "designed"]) == 0
    record = simulated(name).record()
    estimation = Estimation(read_specification("log.yaml"), list(record), "the record")
    cells = np.column_stack([record[title] for title in estimation.layout.titles])[:300]
    _, values = estimation.layout.values(cells, DataReport())
    expected = np.concatenate([estimation.feed(cells).numbers, estimation.finish().numbers])
    y, u = np.split(values, [estimation.layout.measurements], axis=1)
    for folder in ("direct", "designed"):
        found = compiled(Path(folder, "log.h"), y, u)
        compared = 0
        for c, column in enumerate(estimation.outputs.columns):
            if column.estimate == RESIDUAL or column.deviation:
                continue
            off = np.abs(found[column.estimate][:, column.place] - expected[:, c])
            assert off.max() <= 1e-9 * np.abs(expected[:, c]).max(), column
            compared += 1
        assert compared


def test_columns_name_what_the_observer_does_not(
    empty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = tree_of("kalman")
    for key in ("states", "inputs", "measurements"):
        del tree["observer"][key]
    tree["columns"] = {
        "measurements": [
            {"column": "Motor speed [rpm]", "unit": "rpm", "model_unit": "rad/s", "offset": 100.0},
            {"column": "i", "unit": "A", "wrap": 3.0},
        ],
        "inputs": [{"column": "Spannung", "unit": "V"}],
    }
    tree["estimates"] = {"state": {"omega": "rad/s", "current": "A"}}
    Path("log.yaml").write_bytes(as_yaml(tree))
    assert main(["export", "log.yaml"]) == 0
    reported = capsys.readouterr().out
    assert (
        "Motor_speed is the deviation from the operating point, Motor_speed - 100 rpm" in reported
    )
    assert "left out, as only records have them: columns, estimates, alarms, sampling." in reported
    header = " ".join(Path("log.h").read_text(encoding="utf-8").replace(" * ", "").split())
    assert "y: Motor_speed [rad/s], i [A]; u: Spannung [V]" in header
    assert "state: omega [rad/s], current [A]" in header
    assert "i is an angle that goes on beyond a turn" in header.replace("I is", "i is")
    assert main(["design", "log.yaml", "--out", "log.json"]) == 0
    system = load_design("log.json").system
    assert system.measurements == {"Motor_speed": "rad/s", "i": "A"}
    assert system.inputs == {"Spannung": "V"}
    assert system.states == {"omega": "rad/s", "current": "A"}


def test_names_in_columns_rename_no_estimate() -> None:
    """So that alarms of the specification hold for the design, too."""
    made = specified_design(tree_of("ilo-sampled"))
    assert [part.name for part in made.design.estimates["fault"]] == [
        "fault_1", "fault_2", "fault_3",
    ]  # fmt: skip
    assert [tuple(one) for one in made.signals[1]] == [("Tx", "N m"), ("Ty", "N m"), ("Tz", "N m")]


def test_model_file_is_a_specification_once_it_has_columns(empty: Path) -> None:
    """The keys may stand at the top; the filter follows a constant speed to 1e-9."""
    assert main(["design", "kalman", "--example", "m.yaml"]) == 0
    assert main(["design", "m.yaml", "--out", "m.json"]) == 0
    text = Path("m.yaml").read_text(encoding="utf-8")
    columns = """columns:
  measurements: [{column: w, unit: deg/s, model_unit: rad/s}, {column: i, unit: A}]
  inputs: [{column: u, unit: V}]
"""
    Path("log.yaml").write_text(text + columns, encoding="utf-8")
    # 10 w = 40 i and 0.4 w + 20 i = 20 u at rest
    speed, volts = np.pi / 6, (0.4 + 20 / 4) / 20 * np.pi / 6
    row = f"30.0,{speed / 4!r},{volts!r}\n"
    Path("log.csv").write_text("w,i,u\n" + row * 3000, encoding="utf-8")
    assert main(["estimate", "log.yaml", "log.csv", "--out", "e.csv"]) == 0
    last = Path("e.csv").read_text(encoding="utf-8").splitlines()[-1].split(",")
    assert float(last[1]) == pytest.approx(speed, abs=1e-9)
    assert float(last[3]) == pytest.approx(speed / 4, abs=1e-9)
    assert read_specification("log.yaml").sampling.period == 0.01
    fitted = ["--range", "observer.R.0", "1e-8", "1", "--budget", "500", "--output", "f.yaml"]
    assert main(["fit", "log.yaml", "log.csv", *fitted]) == 0
    assert read_specification("f.yaml").observer.system.R[0] != 1e-3


PERIOD = "observer.sampling_period: must be left out, or 0.01, which sampling.period states"
REFUSED: list[tuple[dict[str, Any], str, str]] = [
    ({"smooth": True}, "", "smooth: true is for whole records, and a step takes no later row"),
    ({"obsrver": 1}, "", "obsrver: unknown key; did you mean 'observer'?"),
    ({"observer": {"sampling_period": 0.02}}, "", PERIOD),
    ({}, "luenberger", "observer.kind: 'kalman' must be luenberger, as it was asked for"),
    ({"columns": {"inputs": []}}, "", "columns.inputs: are 0 columns, the observer reads 1"),
    ({"estimates": {"stat": {"a": ""}}}, "", "estimates.stat: there is no such estimate; did you"),
    ({"estimates": {"state": {"a": ""}}}, "", "estimates.state: names 1 components, the observer"),
    ({"alarms": [{"name": "x"}]}, "", "alarms.0.of: is missing"),
    ({"sampling": {"period": -1}}, "", "sampling.period: -1 must be greater than zero"),
]


@pytest.mark.parametrize(("changes", "kind", "said"), REFUSED)
def test_specification_is_refused_naming_the_key(
    changes: dict[str, Any], kind: str, said: str
) -> None:
    tree = tree_of("kalman")
    for section, keys in changes.items():
        own = tree.get(section)
        tree[section] = {**own, **keys} if isinstance(own, dict) and keys else keys
    with pytest.raises(InputError) as error:
        specified_design(tree, kind)
    assert str(error.value).startswith(said)


def test_observer_without_fixed_steps_is_refused_in_one_sentence(
    empty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = tree_of("extended-high-gain")
    tree["observer"]["gains"]["initial_matrix"] = 1.0
    Path("log.yaml").write_bytes(as_yaml(tree))
    assert main(["export", "log.yaml", "--out", "code"]) == 1
    reported = capsys.readouterr().err
    assert reported.startswith("reobserve: log.yaml: observer: ")
    assert reported.count("\n") == 1
    assert not Path("code").exists()


def test_kinds_and_periods_at_the_top_are_named_without_the_section() -> None:
    tree = {"kind": "kalman", "sampling_period": 0.01, "AA": 1}
    with pytest.raises(InputError, match=r"^AA: unknown key"):
        specified_design(tree)
    with pytest.raises(InputError, match=r"^columns: is missing"):
        as_specification(tree)
    with pytest.raises(InputError, match=r"^kind: is missing"):
        specified_design({"sampling_period": 0.01})


def test_specification_is_not_overwritten(empty: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("log.yaml").write_text(specification_text("kalman"), encoding="utf-8")
    assert main(["design", "log.yaml", "--out", "./log.yaml"]) == 1
    assert "is read here, and would be overwritten" in capsys.readouterr().err

"""Inputs without a column, and inputs that are logged when they change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.cli.main import main
from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated, specification_text
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.specification import Specification, as_specification
from reobserve.estimation.state_file import load_state, save_state
from reobserve.estimation.writing import header
from tests.reobserve.bad_input.odd import as_yaml
from tests.reobserve.estimation.records import specification, streamed, write_record

ROWS = 200
VOLTAGE = {"column": "voltage", "unit": "V"}
HELD = {**VOLTAGE, "missing": "hold"}


def chosen(voltage: dict[str, Any], **changes: Any) -> Specification:
    """The example `kalman` with another input."""
    columns = parse_yaml(specification_text("kalman"), "kalman")["columns"]
    return specification("kalman", columns={**columns, "inputs": [voltage]}, **changes)


def record(path: Path, voltage: Any, gaps: bool = True) -> Path:
    """Its record with a lost row, an empty cell and a gap, and another voltage."""
    columns = {name: values[:ROWS].copy() for name, values in simulated("kalman").record().items()}
    columns["voltage"] = np.broadcast_to(voltage, ROWS)
    kept = np.ones(ROWS, dtype=bool)
    if gaps:
        kept[30] = kept[100:130] = False
        columns["speed"][60] = np.nan
    return write_record(path, {name: values[kept] for name, values in columns.items()})


@pytest.mark.parametrize(
    "constant", [{"value": 12}, {"value": 12.0, "unit": "V"}, {"value": 12e3, "unit": "mV"}]
)
@pytest.mark.parametrize("at_gap", ["coast", "restart"])
def test_constant_is_a_column_of_one_value(
    constant: dict[str, Any], at_gap: str, tmp_path: Path
) -> None:
    text, without = record(tmp_path / "r.csv", 12.0), tmp_path / "w.csv"
    lines = text.read_text(encoding="utf-8").splitlines()
    without.write_text("".join(f"{one.rpartition(',')[0]}\n" for one in lines), encoding="utf-8")
    sampling = {"at_gap": at_gap}
    one = estimate_file(chosen(VOLTAGE, sampling=sampling), text, tmp_path / "e.csv")
    expected = (tmp_path / "e.csv").read_text(encoding="utf-8")
    other = chosen(constant, sampling=sampling)
    for block in (100, 10**6):
        made = estimate_file(other, without, tmp_path / "c.csv", block=block)
        assert (tmp_path / "c.csv").read_text(encoding="utf-8") == expected
        assert made.report.statuses == one.report.statuses
        assert "voltage" not in made.report.filled
    assert streamed(other, without) == expected


def test_temperature_that_is_constant_is_converted_with_its_zero() -> None:
    """And the extended Kalman filter x' = k (u - x) settles at it."""
    tree = {
        "kind": "extended-kalman", "time": "continuous", "states": {"x": "kelvin"},
        "inputs": {"u": "kelvin"}, "measurements": {"x": "kelvin"}, "dynamics": {"x": "2*(u - x)"},
        "output": {"x": "x"}, "Q": 1e-6, "R": 1.0, "initial_state": [250.0],
        "initial_covariance": 1.0,
    }  # fmt: skip
    columns = {
        "measurements": [{"column": "x", "unit": "kelvin"}],
        "inputs": [{"value": 20, "unit": "degC"}],
    }
    changed = {**parse_yaml(specification_text("kalman"), "kalman"), "observer": tree}
    changed |= {"columns": columns, "alarms": []}
    estimation = Estimation(as_specification(changed), ["x"], "r")
    assert estimation.inputs.values == (293.15,)
    found = estimation.feed(np.full((2000, 1), 293.15)).numbers
    assert found[-1, 0] == pytest.approx(293.15, abs=1e-6)


def test_modes_that_differ_by_a_mean_have_a_constant_input(tmp_path: Path) -> None:
    """A valve is open from row 100 on, after which the level goes to 2 instead of 1."""
    tree: dict[str, Any] = parse_yaml(specification_text("imm-kalman"), "imm-kalman")
    tree["observer"] = {
        "kind": "imm", "time": "discrete", "states": {"level": "m"}, "inputs": {"one": "1"},
        "measurements": {"level": "m"}, "A": [[0.9]], "C": [[1.0]], "Q": 1e-6, "R": 1e-4,
        "B": [[0.1]], "modes": {"closed": {}, "open": {"B": [[0.2]]}},
        "initial_state": [1.0], "initial_covariance": 1e-4,
        "gains": {"filter": "kalman", "transition": [[0.99, 0.01], [0.01, 0.99]]},
    }  # fmt: skip
    tree["columns"] = {
        "measurements": [{"column": "level", "unit": "m"}], "inputs": [{"value": 1}],
    }  # fmt: skip
    tree |= {"alarms": [{"name": "open", "of": "probability_open", "above": 0.9}]}
    tree["sampling"] = {"period": 1.0}
    (tmp_path / "s.yaml").write_bytes(as_yaml(tree))
    level = [1.0] * 100 + [2.0 - 0.9**k for k in range(1, 101)]
    write_record(tmp_path / "r.csv", {"level": np.array(level)})
    words = ["estimate", str(tmp_path / "s.yaml"), str(tmp_path / "r.csv")]
    assert main([*words, "--out", str(tmp_path / "e.csv")]) == 0
    titles, *rows = (tmp_path / "e.csv").read_text(encoding="utf-8").splitlines()
    at = titles.split(",").index("alarm open")
    raised = [k for k, row in enumerate(rows) if row.split(",")[at] in ("1", "1.0", "true")]
    assert 100 <= min(raised) <= 104
    assert len(raised) >= 95


def test_fit_and_tune_take_constants(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "r.csv", 12.0, gaps=False)
    tree: dict[str, Any] = parse_yaml(specification_text("kalman"), "kalman")
    tables, scores = [], []
    for name, voltage in (("column", VOLTAGE), ("constant", {"value": 12, "unit": "V"})):
        tree["columns"]["inputs"] = [voltage]
        Path(f"{name}.yaml").write_bytes(as_yaml(tree))
        capsys.readouterr()
        ranges = ["--range", "observer.R.0", "1e-6", "10"]
        assert main(["fit", f"{name}.yaml", "r.csv", *ranges]) == 0
        tables.append(capsys.readouterr().out)
        task = {
            "title": "T", "training": [{"file": "r.csv", "until": 0.5}],
            "held_out": [{"file": "r.csv", "since": 0.5, "segments": 4}], "budget": 5,
            "candidates": {"one": {
                "specification": f"{name}.yaml",
                "ranges": {"observer.R.0": {"range": [1e-6, 10]}},
            }},
        }  # fmt: skip
        Path("tune.yaml").write_bytes(as_yaml(task))
        assert main(["tune", "tune.yaml", "--output", name]) == 0
        scores.append(Path(name, "scores.csv").read_text(encoding="utf-8"))
    assert tables[0] == tables[1]
    assert scores[0] == scores[1]


def stepped() -> tuple[Any, Any]:
    """A voltage that changes in a few rows, all of it, and only its changes."""
    whole = np.repeat([0.0, 12.0, 6.0, 9.0], [40, 50, 60, 50])
    changes = np.where(np.diff(whole, prepend=-1.0) != 0.0, whole, np.nan)
    return whole, changes


@pytest.mark.parametrize("missing", ["skip", "interpolate", "refuse"])
def test_held_input_is_a_column_in_which_each_value_is_written(
    missing: str, tmp_path: Path
) -> None:
    whole, changes = stepped()
    gaps = missing != "refuse"
    sampling = {"missing": missing} | ({} if gaps else {"at_gap": "refuse"})
    if missing == "interpolate":
        sampling["at_gap"] = "restart"
    full, text = record(tmp_path / "f.csv", whole, gaps), record(tmp_path / "r.csv", changes, gaps)
    one = estimate_file(chosen(VOLTAGE, sampling=sampling), full, tmp_path / "e.csv")
    expected = (tmp_path / "e.csv").read_text(encoding="utf-8")
    other = chosen(HELD, sampling=sampling)
    for block in (100, 10**6):
        made = estimate_file(other, text, tmp_path / "c.csv", block=block)
        assert (tmp_path / "c.csv").read_text(encoding="utf-8") == expected
        assert made.report.statuses == one.report.statuses
        assert made.report.held == {"voltage": one.report.rows - 4}
        assert "voltage" not in made.report.missing
    assert streamed(other, text) == expected


def test_rows_before_the_first_value_are_counted_and_have_no_estimate(tmp_path: Path) -> None:
    _, changes = stepped()
    changes = np.where(np.arange(ROWS) < 7, np.nan, np.where(np.arange(ROWS) == 7, 3.0, changes))
    refuse = {"missing": "refuse", "at_gap": "refuse"}
    text = record(tmp_path / "r.csv", changes, gaps=False)
    made = estimate_file(chosen(HELD, sampling=refuse), text, tmp_path / "e.csv")
    assert (made.report.before_start, made.report.estimates) == (7, ROWS - 7)
    assert made.report.first == pytest.approx(0.0)
    first = (tmp_path / "e.csv").read_text(encoding="utf-8").splitlines()[1]
    assert float(first.split(",")[0]) == pytest.approx(0.07)
    assert streamed(chosen(HELD, sampling=refuse), text) == (tmp_path / "e.csv").read_text(
        encoding="utf-8"
    )
    with pytest.raises(InputError, match="voltage missing at 0 s"):
        estimate_file(chosen(VOLTAGE, sampling=refuse), text, tmp_path / "e.csv")


def test_held_value_is_kept_in_the_state_of_a_stream(tmp_path: Path) -> None:
    _, changes = stepped()
    text = record(tmp_path / "r.csv", changes, gaps=False)
    one = chosen(HELD)
    expected = streamed(one, text)
    titles, *lines = text.read_text(encoding="utf-8").splitlines(keepends=True)
    columns = titles.strip().split(",")
    estimation = Estimation(one, columns, "r")
    out, rows = header(estimation.titles), RowByRow(estimation, columns)
    for k, line in enumerate(lines):
        if k in (30, 60, 150):
            rows.settle()
            save_state(tmp_path / "s.json", estimation, "d", None)
            estimation = Estimation(one, columns, "r")
            load_state(tmp_path / "s.json", estimation, "d")
            rows = RowByRow(estimation, columns)
        out += rows.read(line)
    assert out + rows.finish() == expected


def test_column_that_never_has_a_value_is_named(tmp_path: Path) -> None:
    text = record(tmp_path / "r.csv", np.nan)
    with pytest.raises(InputError, match=r"has no row from .* start; voltage never has a value"):
        estimate_file(chosen(HELD), text, tmp_path / "e.csv")


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"inputs": [{"value": "12 V"}]}, "columns.inputs.0.value: '12 V' is not a number"),
    ({"inputs": [{"value": 1, "column": "u"}]}, "columns.inputs.0.column: unknown key"),
    ({"inputs": [{"value": 1, "unit": "vv"}]}, "columns.inputs.0.unit: 'vv' is no unit"),
    ({"inputs": [{"value": 1, "unit": "kg"}]}, "columns.inputs.0.unit: 'kg' cannot become 'V'"),
    ({"inputs": [{"value": 1e308, "unit": "kV"}]}, "columns.inputs.0.value: "),
    ({"inputs": [{"value": 1}, {"value": 2}]}, "columns.inputs: are 2 columns, the observer re"),
    ({"inputs": [{**VOLTAGE, "missing": "keep"}]}, "columns.inputs.0.missing: 'keep' must be"),
    ({"measurements": [{"column": "speed", "missing": "hold"}]},
     "columns.measurements.0.missing: hold is for inputs; sampling.missing is for measurements"),
    ({"measurements": [{"value": 1}]}, "columns.measurements.0.value: unknown key"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "said"), REFUSED)
def test_input_is_refused_naming_the_key(columns: dict[str, Any], said: str) -> None:
    titles = ["t", "speed", "current", "voltage"]
    with pytest.raises(InputError) as error:
        Estimation(specification("kalman", columns=columns), titles, "r")
    assert str(error.value).startswith(said)


def test_constant_is_an_input_of_exported_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tree: dict[str, Any] = parse_yaml(specification_text("kalman"), "kalman")
    tree["columns"]["inputs"] = [{"value": 12000, "unit": "mV"}]
    Path("s.yaml").write_bytes(as_yaml(tree))
    assert main(["export", "s.yaml"]) == 0
    assert "voltage is constant, 12000 mV" in capsys.readouterr().out
    code = Path("s.h").read_text(encoding="utf-8")
    assert "u: voltage [V]" in code
    assert "Voltage is constant" in " ".join(code.replace(" * ", "").split())

"""Input and output files: the same numbers from any format and block size; invalid files are
refused.
"""

from __future__ import annotations

import contextlib
import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
import pyarrow.parquet as parquet
import pytest
from numpy.typing import NDArray

from reobserve.cli.main import main
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.validation import parse
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated
from reobserve.estimation.families.file import load_design
from reobserve.estimation.record_file import File
from reobserve.estimation.specification import LearnedThreshold, Specification, read_specification
from reobserve.estimation.writing import KEY
from tests.reobserve.estimation.records import read_results, specification, streamed, write_record

Array = NDArray[np.float64]

EVEN = {name: values[:300] for name, values in simulated("kalman").record().items()}


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("whole")
    record = write_record(folder / "r.csv", EVEN)
    estimate_file(specification("kalman"), record, folder / "e.csv")
    return (folder / "e.csv").read_bytes()


def as_parquet(path: Path) -> Path:
    parquet.write_table(pa.table(EVEN), path, row_group_size=70)
    return path


def test_all_input_formats_and_block_sizes_give_identical_bits(
    expected: bytes, tmp_path: Path
) -> None:
    text = write_record(tmp_path / "r.csv", EVEN)
    packed = tmp_path / "r.csv.gz"
    packed.write_bytes(gzip.compress(text.read_bytes()))
    for record in (text, packed, as_parquet(tmp_path / "r.parquet")):
        for block in (600, 2**20):
            made = estimate_file(specification("kalman"), record, tmp_path / "e.csv", block=block)
            assert (tmp_path / "e.csv").read_bytes() == expected, record.suffix
            assert made.report.rows == 300


def test_all_output_formats_hold_the_same_numbers(expected: bytes, tmp_path: Path) -> None:
    record = write_record(tmp_path / "r.csv", EVEN)
    estimate_file(specification("kalman"), record, tmp_path / "e.csv.gz")
    assert gzip.decompress((tmp_path / "e.csv.gz").read_bytes()) == expected
    again = tmp_path / "again.csv.gz"
    estimate_file(specification("kalman"), record, again)
    assert again.read_bytes() == (tmp_path / "e.csv.gz").read_bytes()
    estimate_file(specification("kalman"), record, tmp_path / "e.parquet")
    table = parquet.read_table(tmp_path / "e.parquet")
    same = arrow_csv.read_csv(pa.BufferReader(expected))
    assert table.column_names == same.column_names
    for name in table.column_names[:-2]:
        assert np.array_equal(table[name].to_numpy(), same[name].to_numpy()), name
    about = parquet.read_metadata(tmp_path / "e.parquet").metadata
    assert json.loads(about[KEY])["rows"] == 300


def test_large_file_is_never_completely_in_memory(tmp_path: Path) -> None:
    columns = {name: np.tile(values, 200) for name, values in EVEN.items()}
    record = write_record(tmp_path / "r.csv", columns)
    block = 2**14
    sizes = [rows.nbytes for rows in File(record, block=block).blocks(list(columns))]
    assert sum(sizes) == 4 * 8 * 60_000
    assert max(sizes) < 2 * block
    assert record.stat().st_size > 50 * block


@pytest.mark.parametrize("first", ["", "sep=,\n"])
def test_header_too_long_to_be_read_is_refused_as_that(tmp_path: Path, first: str) -> None:
    for columns in (2000, 20_000):
        names = ",".join(f"c{k}" for k in range(columns))
        row = ",".join("0" * columns)
        (tmp_path / "r.csv").write_text(f"{first}{names}\n{row}\n")
        file = File(tmp_path / "r.csv")
        if columns == 2000:
            assert len(file.header()) == columns
            continue
        with pytest.raises(InputError, match="its header has more than 65536 bytes"):
            file.header()


def test_header_units_are_read_and_output_can_be_input(expected: bytes, tmp_path: Path) -> None:
    titles = {"t": "t [ms]", "speed": "speed [rpm]", "current": "current[mA]"}
    columns = {titles.get(name, name): values for name, values in EVEN.items()}
    tree = {
        "time": {"column": "t"},
        "measurements": [{"column": "speed", "model_unit": "rad/s"},
                         {"column": "current", "unit": "mA", "model_unit": "A"}],
        "inputs": [{"column": "voltage", "unit": "V"}],
    }  # fmt: skip
    record = write_record(tmp_path / "r.csv", columns)
    estimate_file(specification("kalman", columns=tree), record, tmp_path / "e.csv")
    assert (tmp_path / "e.csv").read_bytes() == expected
    tree["measurements"][0]["unit"] = "rad/s"  # type: ignore[index]
    with pytest.raises(InputError, match=r"says rad/s, the header of .* says rpm"):
        estimate_file(specification("kalman", columns=tree), record, tmp_path / "e.csv")
    once_more = specification("levant", columns={
        "time": {"column": "time"}, "measurements": [{"column": "speed"}],
    })  # fmt: skip
    made = estimate_file(once_more, tmp_path / "e.csv", tmp_path / "d.csv")
    assert made.titles[1:4] == [
        "derivatives_1 [rad/s]", "derivatives_2 [rad/s^2]", "derivatives_3 [rad/s^3]"
    ]  # fmt: skip


def test_semicolons_and_decimal_commas_are_read(expected: bytes, tmp_path: Path) -> None:
    text = write_record(tmp_path / "r.csv", EVEN).read_text()
    (tmp_path / "r.csv").write_text("\ufeff" + text.replace(",", ";").replace(".", ","))
    tree: Any = {
        "time": {"column": "t", "unit": "ms"}, "delimiter": ";", "decimal": ",",
        "measurements": [{"column": "speed", "unit": "rpm", "model_unit": "rad/s"},
                         {"column": "current", "unit": "mA", "model_unit": "A"}],
        "inputs": [{"column": "voltage", "unit": "V"}],
    }  # fmt: skip
    chosen = specification("kalman", columns=tree)
    estimate_file(chosen, tmp_path / "r.csv", tmp_path / "e.csv")
    assert (tmp_path / "e.csv").read_bytes() == expected


def test_report_describes_the_processing_of_the_record(tmp_path: Path) -> None:
    columns = {name: values.copy() for name, values in EVEN.items()}
    columns["speed"][10] = np.nan
    record = write_record(tmp_path / "r.csv", columns)
    made = estimate_file(
        specification("kalman"), record, tmp_path / "e.csv", plot=tmp_path / "e.png",
        report=tmp_path / "e.json",
    )  # fmt: skip
    reported = json.loads((tmp_path / "e.json").read_text())
    assert reported["record"] == "r.csv"
    assert reported["statuses"] == {"measured": 299, "partial": 1}
    assert reported["missing"] == {"speed": 1}
    assert reported["mean_interval"] == pytest.approx(0.01)
    assert reported["warnings"] == made.report.warnings
    assert (
        reported["alarms"]["odd"]["threshold"] is None
    )  # the record ends before the learning interval does
    assert (tmp_path / "e.png").read_bytes().startswith(b"\x89PNG")


def test_alarm_uses_the_specified_or_learned_threshold(tmp_path: Path) -> None:
    record = write_record(tmp_path / "r.csv", simulated("ilo-sampled").record())
    made = estimate_file(specification("ilo-sampled"), record, tmp_path / "e.csv")
    found, _ = read_results(tmp_path / "e.csv")
    start_up = made.report.alarms["leak"].start_up
    early = found["time"] < start_up - 1e-9
    assert 1.0 < start_up < 5.0
    assert np.isnan(found["alarm leak"][early]).all()
    assert np.array_equal(found["alarm leak"][~early], (np.abs(found["fault_1"]) > 0.2)[~early])
    time, residual = found["time"], found["residual wx"]
    stretch = residual[(time >= 1.0) & (time <= 4.0)]
    limit, mean = 6 * np.std(stretch, ddof=1), np.mean(stretch)
    later = time > 4.0
    assert np.isnan(found["alarm odd"][~later]).all()
    assert np.array_equal(found["alarm odd"][later], np.abs(residual - mean)[later] > limit)
    reported = made.report.alarms["odd"]
    assert reported.threshold == pytest.approx(limit, rel=1e-9)
    assert reported.mean == pytest.approx(mean, rel=1e-6)
    assert reported.first == time[found["alarm odd"] == 1.0][0]
    for name in ("leak", "odd"):
        assert made.report.alarms[name].rows == (found[f"alarm {name}"] == 1.0).sum() > 0


def test_misleading_settings_are_reported(tmp_path: Path) -> None:
    tree = {"kind": "levant", "gains": {"L": 1e3, "order": 2}}
    columns = simulated("levant").record()
    columns["voltage"] += np.random.default_rng(1).normal(size=len(columns["t"]))
    record = write_record(tmp_path / "r.csv", columns)
    made = estimate_file(specification("levant", observer=tree), record, tmp_path / "e.csv")
    noisy = [reported for reported in made.report.warnings if "noise moves it by" in reported]
    assert [reported.partition(":")[0] for reported in noisy] == ["derivatives_3"]
    slow = {"gains": {"gain": [[0.0, 0.0], [0.0, 0.0]]}}
    short = {name: values[:60] for name, values in simulated("kalman").record().items()}
    record = write_record(tmp_path / "r.csv", short)
    chosen = specification("luenberger-gain", observer=slow)
    made = estimate_file(chosen, record, tmp_path / "e.csv")
    assert any(
        reported.startswith("speed: started again at half") for reported in made.report.warnings
    )
    body = {"inertia": 1.0, "fault_matrix": [1.0, 1.0, 0.0]}
    record = write_record(tmp_path / "r.csv", simulated("adaptive").record())
    chosen = specification("adaptive", observer=body)
    made = estimate_file(chosen, record, tmp_path / "e.csv")
    assert any("fault_matrix has rank 2 of 3" in reported for reported in made.report.warnings)


def test_unobservable_mode_is_reported() -> None:
    """Two decoupled states: the first is measured, the second keeps its initial value."""
    tree: dict[str, Any] = {
        "time": "discrete", "A": [[0.5, 0.0], [0.0, 1.0]], "B": [[0.0], [0.0]],
        "C": [[1.0, 0.0], [2.0, 0.0]], "Q": [0.1, 0.1], "R": [1.0, 1.0],
    }  # fmt: skip
    header = ["t", "speed", "current", "voltage"]
    found = Estimation(specification("kalman", observer=tree), header, "the record")
    (reported,) = found.report.warnings
    assert reported.startswith(
        "state: a mode of model with the eigenvalue 1+0j does not decay and is"
    )
    seen = {**tree, "C": [[1.0, 0.0], [0.0, 1.0]]}
    seen_too = Estimation(specification("kalman", observer=seen), header, "the record")
    assert not seen_too.report.warnings


def test_threshold_is_learned_from_the_first_estimate_by_default() -> None:
    rule = {"name": "odd", "of": "residual speed", "sigma": 5, "until": 4.0}
    (read,) = specification("kalman", alarms=[rule]).alarms
    assert isinstance(read, LearnedThreshold)
    assert read.since == 0.0


UNFORESEEN = "is wrong, or there is a fault from early on"


@pytest.mark.parametrize(
    ("name", "column", "factor", "said"),
    [
        ("kalman", "speed", 6.0, "% of the spread of what is measured in the second half of the"),
        ("kalman", "speed", 0.0, "far more than 100 % of the spread of what is measured"),
        ("augmented-kalman", "speed", 0.0, "far more than 100 % of the spread of what is"),
        ("luenberger-gain", "speed", -1.0, "% of the spread of what is measured in the second"),
        ("luenberger", "speed", 0.0, "far more than 100 % of the spread of what is measured"),
        ("eso", "speed", 0.0, "far more than 100 % of the spread of what is measured"),
    ],
)
def test_record_contradicting_the_model_is_reported(
    name: str, column: str, factor: float, said: str, tmp_path: Path
) -> None:
    """Another unit (degrees per second for rpm), or a dead or reversed sensor."""
    columns = simulated(name).record()
    good = estimate_file(specification(name), write_record(tmp_path / "r.csv", columns),
                         tmp_path / "e.csv")  # fmt: skip
    assert not any(UNFORESEEN in reported for reported in good.report.warnings)
    columns[column] = factor * columns[column]
    bad = estimate_file(specification(name), write_record(tmp_path / "r.csv", columns),
                        tmp_path / "e.csv")  # fmt: skip
    found = [reported for reported in bad.report.warnings if UNFORESEEN in reported]
    assert any(
        reported.startswith("residual speed: it is ") and said in reported for reported in found
    )


def test_decaying_residual_of_a_constant_sensor_is_not_reported(
    tmp_path: Path,
) -> None:
    columns = {name: values[:400] for name, values in simulated("luenberger").record().items()}
    rest = {name: values if name == "t" else 0.0 * values for name, values in columns.items()}
    record = write_record(tmp_path / "r.csv", rest)
    chosen = specification("luenberger", observer={"initial_state": [5.0, 1.0]})
    made = estimate_file(chosen, record, tmp_path / "e.csv")
    residual = read_results(tmp_path / "e.csv")[0]["residual speed"]
    assert abs(residual[0]) > 1.0
    assert 0.0 < np.abs(residual[200:]).max() < 1e-3
    assert not any(UNFORESEEN in reported for reported in made.report.warnings)


def test_threshold_learned_from_few_values_is_reported(tmp_path: Path) -> None:
    columns = simulated("kalman").record()
    columns["speed"][101:390] = np.nan
    alarm = [{"name": "odd", "of": "residual speed", "sigma": 5, "since": 1.0, "until": 4.0}]
    chosen = specification("kalman", alarms=alarm)
    made = estimate_file(chosen, write_record(tmp_path / "r.csv", columns), tmp_path / "e.csv")
    learned = made.report.alarms["odd"].learned
    assert learned == 12  # rows 100 and 390 to 400
    assert (
        f"alarm odd: its threshold is learned from {learned} values, fewer than 20; a longer "
        in ("".join(made.report.warnings))
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty, must name the columns"),
        (b"t,speed,current\n0,1,2\n", "columns.inputs.0.column: .* has no column 'voltage'"),
        (b"t,speed,current,voltage,speed\n", "has the column 'speed' twice"),
        (
            b"t,speed,current,voltage\n0,x,2,3\n",
            "line 2 of column 'speed' is 'x', must be a number; if",
        ),
        (b"t,speed,current,voltage\n0,1,2\n", "line 2 has 3 cells, the header has 4"),
        (
            b"t,speed,current,voltage\n0,1,\xff,3\n",
            "line 2 of column 'current' is .*, must be a number; it is not UTF-8, see",
        ),
        (b"t,speed,current,voltage\n", "has no row from which the observer could start"),
        (b"t,speed,current,voltage\n0,1e999,1,1\n", "must be a number"),
    ],
)
def test_invalid_records_are_refused_in_one_sentence(
    content: bytes, said: str, tmp_path: Path
) -> None:
    (tmp_path / "r.csv").write_bytes(content)
    with pytest.raises(InputError, match=said):
        estimate_file(specification("kalman"), tmp_path / "r.csv", tmp_path / "e.csv")
    assert not (tmp_path / "e.csv").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("kind: kalman>kind: kalmann", "observer.kind: 'kalmann' must be one of"),
        ("unit: rpm>unit: rpn", "columns.measurements.0.unit: 'rpn' is no unit that is known"),
        ("unit: rpm>unit: Hz", "'Hz' does not say whether turns or radians"),
        ("unit: mA>unit: mV", r"'mV' cannot become 'A'"),
        ("period: 0.01>period: 0", "sampling.period: 0 must be greater than zero"),
        ("missing: skip>missing: fill", "sampling.missing: 'fill' must be one of"),
        ("missing: skip>missing: refuse", "sampling.at_gap: coast has no gap to act on"),
        ("of: residual speed>of: speeds", "alarms.0.of: there is no column 'speeds'; did you"),
        ("alarms:>estimates: {state: {a: rad/s}}\nalarms:", "estimates.state: names 1 compon"),
        ("states: {speed: rad/s, current: A}>states: {speed: rad/s, time: A}", "two columns would"),
        ("alarms:>estimates: {stat: {a: 1/s}}\nalarms:", "estimates.stat: there is no such esti"),
        ("    - {column: current, unit: mA}\n>", "are 1 columns, the obs"),
        ("R: [1.0e-3>R: [-1.0e-3", "observer.R: must be positive semidefinite"),
        ("until: 4}>until: 1}", "alarms.0.until: 1 s must be after since, 1 s"),
    ],
)  # fmt: skip
def test_invalid_specifications_are_refused_naming_the_key(
    change: str, said: str, tmp_path: Path
) -> None:
    from reobserve.estimation.families.examples import specification_text

    old, _, new = change.partition(">")
    text = specification_text("kalman")
    assert old in text
    (tmp_path / "s.yaml").write_text(text.replace(old, new))
    record = write_record(tmp_path / "r.csv", EVEN)
    with pytest.raises(InputError, match=said):
        estimate_file(read_specification(tmp_path / "s.yaml"), record, tmp_path / "e.csv")


@pytest.mark.parametrize(
    "kind",
    ["luenberger", "high-gain", "extended-high-gain"],
)
def test_design_file_provides_observer_names_and_units(kind: str, tmp_path: Path) -> None:
    """The design of an example, on a record of its signals."""
    design = tmp_path / "design.json"
    for arguments in (
        ["design", kind, "--example", str(tmp_path / "model.yaml")],
        ["design", kind, str(tmp_path / "model.yaml"), "--out", str(design)],
    ):
        assert main(arguments) == 0
    made = load_design(design)
    signals = {"measurements": made.measurements, "inputs": made.inputs}
    names = [signal.name for part in signals.values() for signal in part]
    columns: dict[str, Array] = {"t": 0.01 * np.arange(100)}
    columns |= {name: np.sin(columns["t"] + k) for k, name in enumerate(names)}
    tree = {
        "observer": {"kind": "design", "file": str(design)},
        "columns": {
            "time": {"column": "t"},
            **{part: [{"column": s.name, "unit": s.unit} for s in listed]
               for part, listed in signals.items()},
        },
        "sampling": {"period": made.observer.sampling_period},
    }  # fmt: skip
    record = write_record(tmp_path / "r.csv", columns)
    estimated = estimate_file(parse(Specification, tree), record, tmp_path / "e.csv")
    found, _ = read_results(tmp_path / "e.csv")
    y, u = (
        np.column_stack([columns[s.name] for s in listed] or [np.empty((100, 0))])
        for listed in signals.values()
    )
    run = made.observer.run(y, u, start=made.start())
    first = next(iter(made.estimates))
    for k, (name, unit) in enumerate(made.estimates[first]):
        assert np.array_equal(found[name], run[first].reshape(100, -1)[:, k])
        assert f"{name} [{unit}]" in estimated.titles
    tree["sampling"] = {"period": 0.5}
    with pytest.raises(InputError, match=r"observer.file: .* is of a sampling period of"):
        estimate_file(parse(Specification, tree), record, tmp_path / "e.csv")


def test_observer_without_predicted_measurement_has_no_residual(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = {name: values[:200] for name, values in simulated("levant").record().items()}
    record = write_record(tmp_path / "r.csv", columns)
    usual = estimate_file(specification("levant"), record, tmp_path / "usual.csv")
    monkeypatch.setattr(type(usual.design), "predicts", "")
    made = estimate_file(specification("levant"), record, tmp_path / "e.csv")
    assert made.titles == [title for title in usual.titles if not title.startswith("residual")]
    assert len(made.titles) == len(usual.titles) - 1
    found, expected = (read_results(tmp_path / name)[0] for name in ("e.csv", "usual.csv"))
    assert all(np.array_equal(values, expected[name]) for name, values in found.items())
    rows = (tmp_path / "e.csv").read_text(encoding="utf-8")
    assert streamed(specification("levant"), record) == rows


def test_observers_that_cannot_predict_report_it(tmp_path: Path) -> None:
    record = write_record(tmp_path / "r.csv", simulated("levant").record())
    for sampling in ({"missing": "skip"}, {"at_gap": "coast"}):
        with pytest.raises(InputError, match="is for observers that predict without measurements"):
            estimate_file(specification("levant", sampling=sampling), record, tmp_path / "e.csv")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("reading", [1e308, -1e308, 1e200])
@pytest.mark.parametrize("name", ["kalman", "luenberger", "imm-kalman", "levant"])
def test_measurement_near_the_largest_float_gives_no_warning(
    name: str, reading: float, tmp_path: Path
) -> None:
    columns = {title: values[:200].copy() for title, values in simulated(name).record().items()}
    columns[list(columns)[1]][150] = reading
    record = write_record(tmp_path / "r.csv", columns)
    with contextlib.suppress(DivergenceError):
        estimate_file(specification(name), record, tmp_path / "e.csv")

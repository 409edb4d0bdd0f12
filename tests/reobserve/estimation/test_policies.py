"""Uneven, lost or missing samples: filled, skipped, bridged or refused as specified."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from reobserve.core.errors import DivergenceError, InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated
from tests.reobserve.estimation.by_hand import motor_model
from tests.reobserve.estimation.records import (
    read_results,
    record_at,
    signal_at,
    specification,
    streamed,
    write_record,
)

Array = NDArray[np.float64]

EVEN = simulated("kalman").record()


def kalman(columns: dict[str, Array], path: Path, **sampling: Any) -> Any:
    """Report, results and statuses of a Kalman filter on a record."""
    chosen = specification("kalman", sampling={"period": 0.01, **sampling})
    made = estimate_file(chosen, write_record(path / "r.csv", columns), path / "e.csv")
    return made.report, *read_results(path / "e.csv")


def signal(columns: dict[str, Array], path: Path, **sampling: Any) -> Any:
    """The same for a differentiator, whose input is its estimate plus the residual."""
    sampling = {"missing": "refuse", "at_gap": "refuse", **sampling}
    chosen = specification("levant", sampling=sampling)
    made = estimate_file(chosen, write_record(path / "r.csv", columns), path / "e.csv")
    found, status = read_results(path / "e.csv")
    return made.report, found["time"], found["derivatives_1"] + found["residual voltage"], status


def without(columns: dict[str, Array], rows: slice) -> dict[str, Array]:
    kept = np.ones(len(columns["t"]), dtype=bool)
    kept[rows] = False
    return {name: values[kept] for name, values in columns.items()}


def test_lost_samples_are_bridged_by_prediction(tmp_path: Path) -> None:
    import reobserve as ro

    report, found, status = kalman(without(EVEN, slice(50, 53)), tmp_path, missing="skip")
    observer = ro.KalmanFilter(motor_model())
    y = np.column_stack([EVEN["speed"] * (np.pi / 30), EVEN["current"] * 1e-3])
    y[50:53] = np.nan
    u = EVEN["voltage"].copy()
    u[50:53] = u[49]  # an unknown input is held
    run = observer.run(y, u, start=observer.init([0, 0], 1.0))
    assert found["speed"] == pytest.approx(run["state"][:, 0], rel=1e-12)
    assert found["current sigma"] == pytest.approx(np.sqrt(run["variance"][:, 1]), rel=1e-12)
    assert [k for k, word in enumerate(status) if word == "predicted"] == [50, 51, 52]
    assert (report.lost, report.gap_count) == (3, 0)
    assert found["time"][49:54] == pytest.approx([0.49, 0.5, 0.51, 0.52, 0.53], abs=1e-12)


def test_estimation_continues_with_the_remaining_sensor(tmp_path: Path) -> None:
    import reobserve as ro

    columns = {name: values.copy() for name, values in EVEN.items()}
    columns["speed"][200:400] = np.nan
    report, found, status = kalman(columns, tmp_path, missing="skip")
    observer = ro.KalmanFilter(motor_model())
    y = np.column_stack([columns["speed"] * (np.pi / 30), columns["current"] * 1e-3])
    run = observer.run(y, columns["voltage"], start=observer.init([0, 0], 1.0))
    assert found["speed"] == pytest.approx(run["state"][:, 0], rel=1e-12)
    assert status[200:400] == ["partial"] * 200
    assert (report.missing, report.gap_count) == ({"speed": 200}, 0)


@pytest.mark.parametrize("at_gap", ["restart", "coast"])
def test_gap_is_longer_than_the_specified_limit(at_gap: str, tmp_path: Path) -> None:
    columns = without(EVEN, slice(300, 360))
    report, found, status = kalman(columns, tmp_path, missing="skip", gap=0.1, at_gap=at_gap)
    assert report.gaps == [[pytest.approx(2.99), pytest.approx(3.6)]]
    assert status[300:310] == ["predicted"] * 10  # close enough to the last sample
    if at_gap == "coast":
        assert len(status) == 1001
        assert status.count("predicted") == 60
        sigma = found["speed sigma"]
        assert sigma[359] > 2.5 * sigma[299]
        assert sigma[-1] == pytest.approx(sigma[299], rel=1e-9)
    else:
        assert len(status) == 1001 - 50
        assert status[310] == "restarted"
        assert report.restarts == 1
        fresh = without(EVEN, slice(0, 360))
        _, alone, _ = kalman(fresh, tmp_path, missing="skip")
        assert np.array_equal(found["speed"][310:], alone["speed"])


def test_rows_without_sensors_are_dropped_after_the_bridging_limit(tmp_path: Path) -> None:
    columns = {name: values.copy() for name, values in EVEN.items()}
    for title in ("speed", "current"):
        columns[title][300:360] = np.nan
    report, _, status = kalman(columns, tmp_path, missing="skip", gap=0.1, at_gap="restart")
    assert (report.restarts, report.dropped) == (1, 50)
    assert (status.count("predicted"), len(status)) == (10, 1001 - 50)


def test_lost_samples_are_filled_by_linear_interpolation(tmp_path: Path) -> None:
    columns = simulated("levant").record()
    lost = without(columns, slice(100, 104))
    report, time, read, status = signal(lost, tmp_path, missing="interpolate", gap=0.1)
    volts = columns["voltage"] * 1e-3
    assert read[100:104] == pytest.approx(np.linspace(volts[99], volts[104], 6)[1:5], rel=1e-9)
    assert time[99:105] == pytest.approx(0.01 * np.arange(99, 105), abs=1e-12)
    assert status[99:105] == ["measured", *["filled"] * 4, "measured"]
    assert report.filled == {"voltage": 4}


@pytest.mark.parametrize("method", ["linear", "previous", "pchip"])
def test_uneven_timestamps_are_resampled_by_the_specified_method(
    method: str, tmp_path: Path
) -> None:
    random = np.random.default_rng(3)
    timestamps = 0.01 * np.arange(600) + random.uniform(-0.004, 0.004, 600)
    columns = record_at(simulated("levant"), np.clip(timestamps, 0.0, None))
    report, time, read, _ = signal(columns, tmp_path, uneven=method, gap=0.05)
    at, volts = columns["t"] * 1e-3, columns["voltage"] * 1e-3
    assert np.array_equal(time, at[0] + 0.01 * np.arange(len(time)))
    expected = {
        "linear": np.interp(time, at, volts),
        "previous": volts[np.searchsorted(at, time, side="right") - 1],
        "pchip": PchipInterpolator(at, volts)(time),
    }[method]
    assert read == pytest.approx(expected, abs=1e-9)
    off = at / 0.01 - np.arange(600)  # from the grid closest to all of them
    assert report.jitter == pytest.approx((off.max() - off.min()) / 2, abs=0.01)
    assert report.intervals == 599


@pytest.mark.nightly_cases("imm-svsf-sampling4", "kalman-sampling2")
@pytest.mark.parametrize(
    ("name", "sampling"),
    [
        ("kalman", {"missing": "skip", "at_gap": "coast"}),
        ("kalman", {"missing": "interpolate", "at_gap": "restart"}),
        ("kalman", {"uneven": "pchip", "missing": "skip", "at_gap": "restart"}),
        ("eso", {"uneven": "linear", "missing": "interpolate", "at_gap": "restart"}),
        ("imm-svsf", {"uneven": "pchip", "missing": "interpolate", "at_gap": "coast"}),
        ("ilo-continuous", {}),
        ("extended-high-gain", {"uneven": "previous", "missing": "interpolate"}),
    ],
)  # fmt: skip
def test_block_size_does_not_change_a_bit(name: str, sampling: dict[str, Any]) -> None:
    """Row by row, in uneven blocks, and at once; timestamps, gaps and sensors are faulty."""
    chosen = specification(name, sampling=sampling)
    random = np.random.default_rng(8)
    plant = simulated(name)
    timestamps = plant.time[::10][:700]
    if chosen.sampling.uneven != "refuse":
        timestamps = timestamps + plant.time[10] * random.uniform(-0.2, 0.2, len(timestamps))
    columns = record_at(plant, np.clip(timestamps, 0.0, None))
    table = np.column_stack(list(columns.values()))
    lost = random.random(len(table)) < 0.02
    lost[200:260] = True
    lost[0] = False
    table = table[~lost]
    for c in range(1, table.shape[1]):
        table[random.random(len(table)) < 0.02, c] = np.nan
    table[400:430, 1] = np.nan
    twice = [] if chosen.sampling.uneven == "refuse" else [300, 500]
    table = np.insert(table, twice, table[twice], axis=0)
    titles = list(columns)
    results = []
    for sizes in ([len(table)], [1], [1, 7, 50, 3, 128]):
        estimation = Estimation(chosen, titles, "the record")
        places = [titles.index(title) for title in estimation.layout.titles]
        parts, begin, turn = [], 0, 0
        while begin < len(table):
            size = sizes[turn % len(sizes)]
            parts.append(estimation.feed(table[begin : begin + size][:, places]))
            begin, turn = begin + size, turn + 1
        parts.append(estimation.finish())
        whole = [np.concatenate(column) for column in zip(*parts, strict=True)]
        results.append((whole, estimation.report))
    for whole, report in results[1:]:
        for one, other in zip(whole, results[0][0], strict=True):
            assert one.tobytes() == other.tobytes()
        assert vars(report) == vars(results[0][1])
    assert results[0][1].gap_count >= 1
    assert results[0][1].repeated == len(twice)


REFUSED = [
    ({"t": EVEN["t"] * 1.5}, {}, "sampling.period: 0.01 s disagrees with the timestamps"),
    ({"t": EVEN["t"] * 2.0}, {}, "which go on by 0.02 s (the median of the first 20 intervals)"),
    ({"t": EVEN["t"][:9] * 2.0}, {"missing": "skip"}, "by 0.02 s (the median of the first 8 int"),
    ({"t": EVEN["t"][::-1]}, {}, "r.csv: line 3: the timestamp goes back, at 9990 s"),
    ({"t": np.where(EVEN["t"] == 50, 54, EVEN["t"])}, {},
     "sampling.jitter: 0.01 is exceeded in line 7 of "),
    ({"t": np.where(EVEN["t"] == 50, np.nan, EVEN["t"])}, {}, "line 7 has no timestamp"),
    ({"t": np.zeros(1001)}, {}, "line 3: the timestamp stands still"),
    ({"speed": np.where(EVEN["t"] == 50, np.nan, EVEN["speed"])}, {},
     "speed missing at 0.05 s; sampling.missing is refuse, set it to interpolate or skip"),
    ({"voltage": np.where(EVEN["t"] == 50, np.inf, EVEN["voltage"])}, {},
     "voltage: line 7 is inf, must be a number"),
    ({"speed": np.where(EVEN["t"] > 50, np.nan, EVEN["speed"]),
      "current": np.where(EVEN["t"] > 50, np.nan, EVEN["current"])}, {"missing": "skip"},
     "speed, current missing from 0.05 s on for longer than sampling.gap, 0.1 s"),
    ({"speed": np.full(1001, np.nan)}, {"missing": "interpolate", "kind": "eso"},
     "has no row from which the observer could start"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "sampling", "said"), REFUSED)
def test_records_beyond_all_policies_are_refused_without_output(
    columns: dict[str, Array], sampling: dict[str, Any], said: str, tmp_path: Path
) -> None:
    name = {**sampling}.pop("kind", "kalman")
    kept = {key: word for key, word in sampling.items() if key != "kind"}
    chosen = specification(name, sampling={
        "period": 0.01, "missing": "refuse", "at_gap": "refuse", **kept,
    })  # fmt: skip
    rows = len(columns.get("t", EVEN["t"]))
    even = {title: values[:rows] for title, values in EVEN.items()}
    record = write_record(tmp_path / "r.csv", {**even, **columns})
    if "9990" in said:
        said = "line 3: the timestamp goes back, at 9.99 s"
    with pytest.raises(InputError) as error:
        estimate_file(chosen, record, tmp_path / "e.csv")
    assert said in str(error.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.csv"]


STARTS = [
    ("kalman", {"state": [0.0] * 3}, "state: has shape (3,), must be a list of 2 numbers"),
    ("kalman", {"covariance": -1.0}, "covariance: must be positive semidefinite"),
    ("augmented-kalman", {"state": [0.0] * 3}, "state: has shape (3,), must be a list of 2 nu"),
    ("augmented-kalman", {"unknown_input": [0.0, 0.0]}, "unknown_input: has shape (2,), must"),
    ("imm-kalman", {"state": [0.0] * 3}, "state: has shape (3,), must be (2,) or (2, 2)"),
    ("imm-svsf", {"probabilities": [0.5, 0.6]}, "probabilities: [0.5, 0.6] must be 0 or more"),
    ("eso", {"state": [0.0]}, "state: has shape (1,), must be a list of 2 numbers"),
    ("high-gain", {"state": [0.0] * 3}, "state: has shape (3,), must be a list of 2 numbers"),
    ("extended-high-gain", {"delay": 30.0}, "delay: 30 s must be inside its bounds, [0, 1.5] s"),
    ("ilo-sampled", {"state": [0.0] * 2}, "state: has shape (2,), must be a list of 3 numbers"),
    ("adaptive", {"state": [0.0] * 2}, "state: has shape (2,), must be a list of 3 numbers"),
    ("levant", {"state": [0.0]}, "state: has shape (1,), must be a list of 3 numbers"),
    ("normal-form-constant", {"state": [0.0]}, "state: has shape (1,), must be a list of 2 numb"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "start", "said"), STARTS)
def test_invalid_initial_state_is_refused_before_the_first_row(
    name: str, start: dict[str, Any], said: str
) -> None:
    changed = {f"initial_{key}": value for key, value in start.items()}
    with pytest.raises(InputError) as error:  # when it is read, or when the observer is constructed
        Estimation(specification(name, observer=changed), list(simulated(name).record()), "it")
    assert str(error.value).startswith(f"observer.initial_{said}")


@pytest.mark.parametrize("block", [2**10, 2**20])
def test_divergence_is_reported_in_record_time(block: int, tmp_path: Path) -> None:
    columns = simulated("ilo-sampled").record()
    columns["t"] = columns["t"] + 5000.0
    columns["wx"][300] = 1e200
    with pytest.raises(DivergenceError, match=r"finite up to t = 7\.99 s"):
        estimate_file(
            specification("ilo-sampled"), write_record(tmp_path / "r.csv", columns),
            tmp_path / "e.csv", block=block,
        )  # fmt: skip


def test_unobservable_delay_is_reported(tmp_path: Path) -> None:
    columns = simulated("extended-high-gain").record()
    columns["valve"] = np.full(len(columns["t"]), 30.0)
    record = write_record(tmp_path / "r.csv", columns)
    made = estimate_file(specification("extended-high-gain"), record, tmp_path / "e.csv")
    assert any(
        reported.startswith("delay: ") and "100 %" in reported for reported in made.report.warnings
    )


def test_saturated_values_are_counted_and_can_be_treated_as_missing(tmp_path: Path) -> None:
    columns = {name: values.copy() for name, values in EVEN.items()}
    high = columns["speed"] >= 350.0
    columns["speed"][high] = 350.0
    tree = {
        "time": {"column": "t", "unit": "ms"},
        "measurements": [
            {"column": "speed", "unit": "rpm", "model_unit": "rad/s", "range": [-350, 350],
             "saturated": "missing"},
            {"column": "current", "unit": "mA", "model_unit": "A"},
        ],
        "inputs": [{"column": "voltage", "unit": "V"}],
    }  # fmt: skip
    chosen = specification("kalman", columns=tree)
    made = estimate_file(chosen, write_record(tmp_path / "r.csv", columns), tmp_path / "e.csv")
    found, status = read_results(tmp_path / "e.csv")
    assert made.report.saturated == {"speed": high.sum()}
    assert [word == "partial" for word in status] == high.tolist()
    truth = signal_at(simulated("kalman"), "speed", found["time"])
    assert np.abs(found["speed"] - truth)[high].max() < 0.2  # 350 rpm are 0.9 rad/s off


def test_observer_receives_deviations_from_the_operating_point(tmp_path: Path) -> None:
    """Columns with offsets give the bits of a record of deviations; residuals are those of
    levels."""
    at = {"speed": 1500.0, "current": 250.0, "voltage": 24.0}
    levels = {name: values + at.get(name, 0.0) for name, values in EVEN.items()}
    less = {name: values - at.get(name, 0.0) for name, values in levels.items()}
    _, expected, _ = kalman(less, tmp_path)
    columns = {
        "time": {"column": "t", "unit": "ms"},
        "measurements": [
            {"column": "speed", "unit": "rpm", "model_unit": "rad/s", "offset": 1500.0},
            {"column": "current", "unit": "mA", "model_unit": "A", "offset": 250.0},
        ],
        "inputs": [{"column": "voltage", "unit": "V", "offset": 24.0}],
    }
    chosen = specification("kalman", columns=columns)
    estimate_file(chosen, write_record(tmp_path / "r.csv", levels), tmp_path / "e.csv")
    found, _ = read_results(tmp_path / "e.csv")
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert np.array_equal(found[name], values, equal_nan=True), name
    assert streamed(chosen, tmp_path / "r.csv") == (tmp_path / "e.csv").read_text()


def test_unit_offset_cancels_in_a_deviation(tmp_path: Path) -> None:
    columns = {
        "time": {"column": "t"},
        "measurements": [
            {"column": "warm", "unit": "degC", "model_unit": "kelvin", "offset": 20.0}
        ],
    }
    record = {"t": 0.01 * np.arange(30), "warm": np.full(30, 21.5)}
    sampling = {"missing": "refuse", "at_gap": "refuse"}
    chosen = specification("levant", columns=columns, sampling=sampling, estimates={})
    estimate_file(chosen, write_record(tmp_path / "r.csv", record), tmp_path / "e.csv")
    found, _ = read_results(tmp_path / "e.csv")
    assert (found["derivatives_1"] + found["residual warm"]) == pytest.approx(1.5)

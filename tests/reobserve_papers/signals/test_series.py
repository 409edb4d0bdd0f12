"""Series on disk, and metrics of signals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from reobserve.core import files
from reobserve.core.errors import InputError
from reobserve_papers.metrics.metrics import (
    Metric,
    lookup,
    name_at,
    parse_name,
    read_metrics,
    write_metrics,
)
from reobserve_papers.metrics.responses import (
    first_crossing,
    peak,
    root_mean_square,
    root_mean_square_of_steps,
    settling_time,
    window,
)
from reobserve_papers.signals.series import Channel, Series

# Values that a conversion to text or single precision would change.
ODD = np.array([[0.1, -0.0, 5e-324], [1 / 3, np.pi, 1.7e308], [np.inf, -1e-17, 2.0**-1074]])


def record() -> Series:
    return Series(
        np.array([0.0, 0.1, 0.2]),
        {"rate": Channel(ODD, "rad/s"), "fault": Channel(np.array([1.0, np.nan, 3.0]), "N m")},
        {"onsets": (0.1, 1 / 3), "none": ()},
        {"seed": 3, "config": {"K1": [1.0, 0.9]}, "version": "0.1"},
    )


def same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    return (
        one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    )


# --- Series -------------------------------------------------------------------------------------


def test_series_round_trips_bitwise(tmp_path: Path) -> None:
    path, series = tmp_path / "new" / "folder" / "run.parquet", record()
    series.write(path)
    found = Series.read(path)
    assert same_bits(found.time, series.time)
    assert set(found.channels) == {"rate", "fault"}
    for name, channel in series.channels.items():
        assert same_bits(found[name], channel.values)
        assert found.channels[name].unit == channel.unit
    assert found.events == {"onsets": (0.1, 1 / 3), "none": ()}
    assert found.provenance == series.provenance


def test_equal_series_give_equal_bytes(tmp_path: Path) -> None:
    first, second, third = (tmp_path / f"{i}.parquet" for i in range(3))
    record().write(first)
    record().write(second)
    assert first.read_bytes() == second.read_bytes()
    Series.read(first).write(third)
    assert first.read_bytes() == third.read_bytes()


def test_series_file_is_parquet_with_flat_columns(tmp_path: Path) -> None:
    record().write(tmp_path / "run.parquet")
    table = parquet.read_table(tmp_path / "run.parquet")
    assert set(table.column_names) == {"time", "rate_1", "rate_2", "rate_3", "fault"}
    assert same_bits(table["rate_2"].to_numpy(), np.ascontiguousarray(ODD[:, 1]))


def test_flat_column_names_count_from_one() -> None:
    columns = record().flat()
    assert list(columns) == ["rate_1", "rate_2", "rate_3", "fault"]
    assert same_bits(columns["rate_3"], np.ascontiguousarray(ODD[:, 2]))


def test_series_converts_to_pandas() -> None:
    frame = record().to_pandas()
    assert frame.index.name == "time"
    assert frame.index.tolist() == [0.0, 0.1, 0.2]
    assert frame["rate_1"].tolist() == ODD[:, 0].tolist()
    assert frame.attrs["units"] == {"rate": "rad/s", "fault": "N m"}
    assert frame.attrs["provenance"] == record().provenance


def test_step_is_the_sampling_period() -> None:
    assert record().step == pytest.approx(0.1, rel=1e-15)
    with pytest.raises(InputError, match=r"^time: must be evenly spaced$"):
        _ = Series(np.array([0.0, 0.1, 0.3]), {}).step
    almost = 0.01 * np.array([0.0, 1.0 + 1e-7, 2.0])
    assert Series(almost, {}).step == 0.01
    assert Series(almost[::2], {}).step == 0.02
    with pytest.raises(InputError, match=r"^time: must be evenly spaced$"):
        _ = Series(0.01 * np.array([0.0, 1.0 + 2e-6, 2.0]), {}).step
    with pytest.raises(InputError, match=r"^time: must have two samples or more for a period$"):
        _ = Series(np.array([0.1]), {}).step


@pytest.mark.parametrize(
    ("off", "even"), [(1e-9, True), (1e-8, True), (1e-4, False), (-1e-4, False)]
)
def test_step_off_by_0_1_percent_is_uneven(off: float, even: bool) -> None:
    """``off`` is in seconds, for steps of 0.1 s; rounding of a time axis is accepted."""
    time = 0.1 * np.arange(11)
    time[5] += off
    series = Series(time, {})
    if even:
        assert series.step == pytest.approx(0.1, rel=1e-12)
    else:
        with pytest.raises(InputError, match=r"^time: must be evenly spaced$"):
            _ = series.step


def test_invalid_series_are_refused() -> None:
    time = np.array([0.0, 0.1, 0.2])
    for bad in (np.array([0.0, 0.2, 0.1]), np.array([0.0, 0.1, 0.1]), time[:, None]):
        with pytest.raises(InputError, match=r"^time: must be one column of increasing numbers$"):
            Series(bad, {})
    with pytest.raises(InputError, match=r"^rate: has shape \(2, 3\), must have 3 rows$"):
        Series(time, {"rate": Channel(np.zeros((2, 3)), "rad/s")})
    with pytest.raises(InputError, match=r"^rate: has shape \(3, 1, 1\), must have 3 rows$"):
        Series(time, {"rate": Channel(np.zeros((3, 1, 1)), "rad/s")})
    for bad in ([0.0, 1.0, 2.0], np.zeros(3), {"values": np.zeros(3)}):
        with pytest.raises(InputError, match=r"^rate: .+ must be of type Channel$"):
            Series(time, {"rate": bad})  # type: ignore[dict-item]
    with pytest.raises(InputError, match=r"^rate: .+ must be of type ndarray$"):
        Series(time, {"rate": Channel([0.0, 1.0, 2.0], "rad/s")})  # type: ignore[arg-type]
    for part in ("channels", "events", "provenance"):
        with pytest.raises(InputError, match=rf"^{part}: .+ must be of type Mapping$"):
            Series(**{"time": time, "channels": {}, part: [1]})
    with pytest.raises(InputError, match=r"^torque: no such channel; there are rate, fault$"):
        _ = record()["torque"]


def test_invalid_series_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    with pytest.raises(
        InputError, match=r"run.parquet: cannot be read \(No such file or directory\)$"
    ):
        Series.read(path)
    record().write(path)
    whole = path.read_bytes()
    for length in (0, 4, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"run.parquet: is damaged or no Parquet .*$") as found:
            Series.read(path)
        assert "\n" not in str(found.value)
    path.write_text("time,rate\n0,1\n")
    with pytest.raises(InputError, match=r"run.parquet: is damaged or no Parquet file"):
        Series.read(path)
    parquet.write_table(pa.table({"time": [0.0, 1.0]}), path)
    with pytest.raises(InputError, match=r"run.parquet: has no reobserve metadata"):
        Series.read(path)


def test_record_of_any_size_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step must be able to read anything an earlier one could write."""
    monkeypatch.setattr(files.read_bytes, "__defaults__", (100,))
    series = Series(np.arange(1000.0), {"x": Channel(np.arange(1000.0), "m")}, {}, {})
    series.write(tmp_path / "x.parquet")
    with pytest.raises(InputError, match="more than 100 bytes"):
        files.read_bytes(tmp_path / "x.parquet")
    assert np.array_equal(Series.read(tmp_path / "x.parquet")["x"], series["x"])


# --- Files --------------------------------------------------------------------------------------


def test_unwritable_folder_is_named(tmp_path: Path) -> None:
    # A file in place of a folder, which also stops root.
    (tmp_path / "folder").write_text("a file")
    for path in (tmp_path / "folder" / "run.parquet", tmp_path / "folder" / "deeper" / "run"):
        with pytest.raises(InputError, match=r"run.*: cannot be written \(.+\)$") as found:
            record().write(path)
        assert found.value.parameter == str(path)
    assert (tmp_path / "folder").read_text() == "a file"


def test_metrics_round_trip_through_a_file(tmp_path: Path) -> None:
    metrics = [Metric("sampled", "rms_error", 1 / 3, "N m"), Metric("adaptive", "delay", 2.0, "s")]
    write_metrics(tmp_path / "metrics.csv", metrics)
    assert read_metrics(tmp_path / "metrics.csv") == metrics
    assert lookup(metrics)["adaptive", "delay"] == 2.0


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a,rms,half,V", r"line 2, value: 'half' must be a number, nan or inf$"),
        ("a,rms,1,bananas", r"line 2, unit: 'bananas' must be a unit$"),
        ("a,rms,1,V/", r"line 2, unit: 'V/' must be a unit$"),
        (",rms,1,V", r"line 2, observer: '' must be a name$"),
        ("a,rms,1,V\na,rms,2,V", r"line 3 repeats 'a, rms'$"),
    ],
)
def test_metrics_table_has_unique_numbers_with_units(tmp_path: Path, row: str, said: str) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(f"observer,metric,value,unit\n{row}\n")
    with pytest.raises(InputError, match=said):
        read_metrics(path)
    path.write_text('observer,metric,value,unit\na,rms,nan,"rad, N m/s^2"\n')
    with pytest.raises(InputError, match=r"^metrics: there is no 'lag' of 'a'$"):
        _ = lookup(read_metrics(path))["a", "lag"]


def test_metric_is_found_by_its_coordinates(tmp_path: Path) -> None:
    levels = (("ise", 1.0, 2.0), ("ise", 2e-05, 3.0), ("ise", 0.1234567890123, 4.0))
    metrics = [
        Metric.at("svsf", (name, value, "s"), noise=level, share=1 / 3, fault="leak")
        for name, level, value in levels
    ]
    assert metrics[0].metric == f"ise fault=leak noise=1 share={1 / 3!r}"
    write_metrics(tmp_path / "metrics.csv", metrics)
    found = lookup(read_metrics(tmp_path / "metrics.csv"))
    for name, level, value in levels:
        assert found.at("svsf", name, share=1 / 3, fault="leak", noise=level) == value
    with pytest.raises(InputError, match=r"^metrics: there is no 'ise noise=1' of 'svsf'$"):
        found.at("svsf", "ise", noise=1.0)


@pytest.mark.parametrize(
    ("text", "name"),
    [("ise", "ise"), ("ise noise=1e-5", "ise noise=1e-05"), ("ise  b=2.0 a=x", "ise a=x b=2")],
)
def test_metric_name_is_parsed(text: str, name: str) -> None:
    metric, at = parse_name(text)
    assert name_at(metric, **at) == name


@pytest.mark.parametrize("text", ["ise 3", "ise a=", "ise =3", "ise a=1 a=2"])
def test_invalid_metric_name_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^metric: '.*' must be a metric, then each coordinate"):
        parse_name(text)


# --- Metrics ------------------------------------------------------------------------------------

TIME = np.array([0.0, 1.0, 2.0, 3.0, 4.0])


def test_root_mean_square_is_exact_for_piecewise_linear_signals() -> None:
    # Over 0..1 the square of t integrates to 1/3; from -1 to 1 and back the same.
    ramp = root_mean_square_of_steps(np.array([0.0]), np.array([1.0]))
    assert ramp == pytest.approx(3**-0.5, rel=1e-15)
    saw = root_mean_square_of_steps(np.array([-1.0, 1.0]), np.array([1.0, -1.0]))
    assert saw == pytest.approx(3**-0.5, rel=1e-15)
    # A jump between steps: 2 in the first, 0 ... 3 in the second: (4 + 3) / 2.
    jump = root_mean_square_of_steps(np.array([2.0, 0.0]), np.array([2.0, 3.0]))
    assert jump == pytest.approx(3.5**0.5, rel=1e-15)
    assert np.isnan(root_mean_square_of_steps(np.array([]), np.array([])))


def test_root_mean_square_of_samples_and_of_an_empty_window() -> None:
    values = np.array([[3.0, 0.0], [-4.0, 0.0]])
    assert root_mean_square(values).tolist() == [12.5**0.5, 0.0]
    assert root_mean_square(values[:, 0]) == 12.5**0.5
    assert np.isnan(root_mean_square(np.empty((0, 2)))).tolist() == [True, True]
    assert np.isnan(root_mean_square(np.array([])))


def test_window_includes_the_sample_at_one_bound_only() -> None:
    assert TIME[window(TIME, 1.0, 3.0)].tolist() == [1.0, 2.0]
    assert TIME[window(TIME, 1.0, 3.0, closed="right")].tolist() == [2.0, 3.0]
    # Times are sums of steps, with rounding errors.
    assert TIME[window(TIME + 1e-12, 1.0, 3.0)].tolist() == [1.0, 2.0]
    assert TIME[window(TIME - 1e-12, 1.0, 3.0)].tolist() == [1.0, 2.0]


def test_peak_is_the_largest_absolute_value() -> None:
    assert peak(np.array([1.0, -3.0]), np.array([[2.0, -5.0]]), np.array([])) == 5.0
    assert np.isnan(peak(np.array([])))


@pytest.mark.parametrize("sign", [1, -1])
def test_first_crossing_is_interpolated(sign: int) -> None:
    # 0 -> 1 -> 2 -> 0 -> 0, straight: 1.25 is exceeded a quarter into the second step.
    start = sign * np.array([0.0, 1.0, 2.0, 0.0])
    end = sign * np.array([1.0, 2.0, 0.0, 0.0])
    assert first_crossing(TIME, start, end, 1.25) == pytest.approx(1.25, rel=1e-15)
    assert np.isnan(first_crossing(TIME, start, end, 2.0))  # reached and not exceeded
    # A jump from 0 to 2 at t = 2 is detected there, not a fraction of a step earlier.
    start, end = sign * np.array([0.0, 0.0, 2.0, 2.0]), sign * np.array([0.0, 0.0, 2.0, 2.0])
    assert first_crossing(TIME, start, end, 1.25) == 2.0


def test_settling_time_is_the_last_entry_into_the_band() -> None:
    # The error leaves the band in the second step for the last time.
    start, end = np.array([3.0, 2.0, 0.5, 0.1]), np.array([2.0, 0.5, 0.1, -0.1])
    assert settling_time(TIME, start, end, 1.0) == 2.0
    assert settling_time(TIME, -start, -end, 1.0) == 2.0
    assert settling_time(TIME, start, end, 5.0) == 0.0  # never outside
    # It comes back at the very end, from inside the last step or at its end.
    assert np.isnan(settling_time(TIME, start, np.array([2.0, 0.5, 0.1, -2.0]), 1.0))
    assert np.isnan(settling_time(TIME, np.array([0.0, 0.0, 0.0, 2.0]), end, 1.0))
    # A jump out of the band and back between two steps belongs to the step that contains it.
    late = np.array([0.0, 0.0, 4.0, 0.0])
    assert settling_time(TIME, late, np.zeros(4), 1.0) == 3.0

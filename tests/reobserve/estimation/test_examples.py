"""Each observer on its example: bitwise the library's results without policies, else close to the
truth.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.cli.main import main
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.example_records import PLANTS, _followed, followed
from reobserve.estimation.families.examples import examples, simulated
from tests.reobserve.estimation.by_hand import BY_HAND
from tests.reobserve.estimation.records import (
    HELD,
    read_results,
    record_at,
    specification,
    truth,
    write_record,
)

NAMES = tuple(examples())
Array = NDArray[np.float64]

# By the column of the truth: the largest root mean square error in the last fifth of the record,
# with even timestamps; and with jittered ones, a gap and a dead sensor. Where a voltage jumps
# between two timestamps, the current is off until it settles.
ERRORS = {
    "fault_1": (0.03, 0.03), "fault_2": (2e-3, 2e-3), "fault_3": (3e-3, 3e-3),
    "angle": (2e-4, 5e-4), "rate": (1e-3, 5e-3), "delay": (3e-3, 3e-3), "level": (1e-5, 2e-5),
    "derivatives_1": (2e-5, 2e-5), "derivatives_2": (1e-3, 1e-3), "derivatives_3": (0.05, 0.05),
    "speed": (0.03, 0.1), "current": (0.01, 0.2), "voltage_lost": (0.05, 0.4),
    "speed_offset": (0.03, 0.1), "probability_worn": (1e-6, 1e-6),
    "probability_healthy": (1e-6, 1e-6),
}  # fmt: skip
# Of one observer: the grid's input is held, which is half a period late; resampled rows look like
# faults that jump to a bank for those.
ERRORS_OF = {
    "delay-grid": {"delay": (0.015, 0.03), "level": (1e-3, 2e-3)},
    "fault-bank": {"voltage_lost": (0.05, 0.5)},
}


def test_names_of_all_examples_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "--example", "list"]) == 0
    assert capsys.readouterr().out.split() == [*NAMES]
    assert set(NAMES) == set(BY_HAND)


def test_every_example_estimate_has_a_true_value() -> None:
    assert set().union(*(truth(simulated(name), np.zeros(1)) for name in NAMES)) == set(ERRORS)


def test_driven_plant_is_integrated_to_fourth_order() -> None:
    """For functions of time the rule is Simpson's, exact for cubics; for the state it is exp(h)'s
    series.
    """
    time = np.array([0.0, 0.4, 1.0])
    pushed = _followed(lambda t, x: np.array([4 * t**3]), np.array([1.0]), time)
    assert pushed[:, 0] == pytest.approx(1 + time**4, rel=1e-14)
    grown = _followed(lambda t, x: x, np.array([1.0]), time)
    series = [1 + h + h**2 / 2 + h**3 / 6 + h**4 / 24 for h in np.diff(time)]
    assert grown[:, 0] == pytest.approx(np.cumprod([1.0, *series]), rel=1e-14)


DERIVATIVES = {
    "pendulum": {"angle": "rate"}, "driven_pendulum": {"angle": "rate"},
    "swing": {"angle": "rate"},
    "lag": {"level": "level_rate", "valve": "valve_rate"}, "signal": {"v0": "v1", "v1": "v2"},
}  # fmt: skip


@pytest.mark.parametrize("plant", PLANTS)
def test_signals_that_are_derivatives_of_others_agree_with_differences(plant: str) -> None:
    made, found = followed(plant), DERIVATIVES.get(plant, {})
    assert {each for each in made.signals if each.endswith("rate")} <= set(found.values())
    assert all(np.isfinite(values).all() for values in made.signals.values())
    for name, rate in found.items():
        by_differences = np.gradient(made.signals[name], made.time)
        assert made.signals[rate][1:-1] == pytest.approx(by_differences[1:-1], abs=1e-4), rate


@pytest.mark.parametrize("name", NAMES)
def test_record_is_sampled_as_specified(name: str) -> None:
    made, stated = simulated(name), specification(name).sampling.period
    assert np.diff(made.record()["t"]) == pytest.approx(1000.0 * stated, rel=1e-9)
    # Held values change only at samples.
    for held in {*HELD} & made.signals.keys():
        steps = made.signals[held][:-1].reshape(-1, 10)
        assert (steps == steps[:, :1]).all()


@pytest.mark.parametrize("name", NAMES)
def test_estimates_are_bitwise_identical_to_the_library_without_policies(
    name: str, tmp_path: Path
) -> None:
    columns = {title: values[:400] for title, values in simulated(name).record().items()}
    made = estimate_file(
        specification(name), write_record(tmp_path / "r.csv", columns), tmp_path / "e.csv"
    )
    found, status = read_results(tmp_path / "e.csv")
    run = BY_HAND[name](columns)
    assert set(status) == {"measured"}
    for column in made.outputs.columns:
        if column.estimate == "residual":
            continue
        values = run[made.design.sigmas[column.estimate] if column.deviation else column.estimate]
        if column.deviation:
            variance = values.reshape(len(values), -1)[:, column.place]
            if values.ndim == 3:
                variance = values[:, column.place, column.place]
            values = np.sqrt(variance)
        elif values.ndim > 1:
            values = values[:, column.place]
        assert np.array_equal(found[column.name], values), column.name


def errors(name: str, path: Path) -> dict[str, float]:
    """The root mean square errors in the last fifth of the results."""
    found, _ = read_results(path)
    time = found["time"]
    late = time > 0.8 * time[-1]
    true = truth(simulated(name), time)
    return {
        column: float(np.sqrt(np.mean((found[column] - values)[late] ** 2)))
        for column, values in true.items() if column in found
    }  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_estimates_converge_on_evenly_sampled_records(name: str, tmp_path: Path) -> None:
    record = write_record(tmp_path / "r.csv", simulated(name).record())
    made = estimate_file(specification(name), record, tmp_path / "e.csv")
    for column, error in errors(name, tmp_path / "e.csv").items():
        assert error < (ERRORS | ERRORS_OF.get(name, {}))[column][0], column
    assert made.report.warnings == []


@pytest.mark.parametrize("name", NAMES)
def test_estimates_converge_despite_jitter_gap_and_dead_sensor(name: str, tmp_path: Path) -> None:
    """Timestamps off by a third of a period, a gap of half a second, and a silent sensor."""
    plant, period = simulated(name), specification(name).sampling.period
    random = np.random.default_rng(5)
    even = plant.time[::10]
    timestamps = even + period * random.uniform(-0.3, 0.3, len(even))
    timestamps[0], timestamps[-1] = even[0], even[-1]
    last = timestamps[-1]
    timestamps = timestamps[(timestamps < 0.3 * last) | (timestamps > 0.3 * last + 0.5)]
    columns = record_at(plant, timestamps)
    sensor = list(columns)[1]
    silent = (timestamps > 0.5 * last) & (timestamps < 0.5 * last + 5.5 * period)
    columns[sensor][silent] = np.nan
    chosen = specification(name, sampling={"uneven": "linear"})
    made = estimate_file(chosen, write_record(tmp_path / "r.csv", columns), tmp_path / "e.csv")
    for column, error in errors(name, tmp_path / "e.csv").items():
        assert error < (ERRORS | ERRORS_OF.get(name, {}))[column][1], column
    report, (_, status) = made.report, read_results(tmp_path / "e.csv")
    assert report.gap_count == 1
    start, end = report.gaps[0]
    assert start is not None
    assert end is not None
    assert abs(start - 0.3 * last) < 3 * period
    assert abs(end - start - 0.5) < 5 * period
    assert report.missing[sensor] == silent.sum()
    assert 0.1 < report.jitter < 1.0
    if chosen.sampling.missing == "skip":
        partial = len(chosen.columns.measurements) > 1
        assert ("partial" if partial else "predicted") in status
        assert status.count("restarted") == 0
        assert status.count("predicted") >= 0.5 / period - 4
    else:
        assert report.restarts == status.count("restarted") == 1
        assert report.filled[sensor] > silent.sum() - 2

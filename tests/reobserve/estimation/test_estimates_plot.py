"""The plot of results: curves that break at gaps, bands, thresholds and alarms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated
from tests.reobserve.estimation.records import read_results, specification, write_record

Array = NDArray[np.float64]


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The saved figures; the files stay empty."""
    saved: list[Any] = []

    def save(figure: Figure, path: Path, **_: Any) -> None:
        saved.append(figure)
        path.touch()

    monkeypatch.setattr(Figure, "savefig", save)
    return saved


def drawn(
    name: str, record: dict[str, Array], folder: Path, figures: list[Any], **changes: Any
) -> tuple[list[Any], dict[str, Array], Any]:
    """The panels, results and report of a record that arrives in many blocks."""
    text = write_record(folder / "r.csv", record)
    chosen = specification(name, **changes)
    made = estimate_file(chosen, text, folder / "e.csv", plot=folder / "e.png", block=2**14)
    return figures[0].axes, read_results(folder / "e.csv")[0], made.report


def test_curves_break_at_grey_gaps_and_bands_are_two_sigma(
    tmp_path: Path, figures: list[Any]
) -> None:
    kept = np.r_[0:100, 160:300]
    columns = {title: values[kept] for title, values in simulated("kalman").record().items()}
    sampling = {"missing": "skip", "gap": 0.1, "at_gap": "restart"}
    axes, found, report = drawn(
        "kalman", columns, tmp_path, figures, sampling=sampling, alarms=[]
    )  # fmt: skip
    panel = axes[0]
    time, speed = panel.get_lines()[0].get_data()
    broken = np.flatnonzero(np.isnan(speed))
    assert broken.tolist() == [110]  # ten rows are predicted, then the observer pauses
    assert np.array_equal(np.delete(speed, broken), found["speed"])
    assert np.array_equal(np.delete(time, broken), found["time"])
    assert panel.get_ylabel() == "speed\n[rad/s]"
    corners = panel.collections[0].get_paths()[0].vertices
    last = found["speed"][109] + 2 * found["speed sigma"][109] * np.array([-1, 1])
    here = corners[np.isclose(corners[:, 0], found["time"][109]), 1]
    assert (here.min(), here.max()) == pytest.approx(tuple(last), rel=1e-9)
    for ax in axes:
        (grey,) = ax.patches
        assert [grey.get_x(), grey.get_x() + grey.get_width()] == pytest.approx([0.99, 1.6])
    assert report.gaps == [[pytest.approx(0.99), pytest.approx(1.6)]]
    assert axes[-1].get_xlim() == (0.0, pytest.approx(2.99))
    assert axes[-1].get_xlabel() == "time [s]"
    assert [ax.get_xlabel() for ax in axes[:-1]] == [""] * (len(axes) - 1)


def test_open_gap_is_grey_up_to_the_last_estimate(tmp_path: Path, figures: list[Any]) -> None:
    columns = {title: values[:200].copy() for title, values in simulated("kalman").record().items()}
    for title in ("speed", "current"):
        columns[title][100:] = np.nan
    sampling = {"missing": "skip", "gap": 0.1, "at_gap": "coast"}
    axes, _, report = drawn("kalman", columns, tmp_path, figures, sampling=sampling, alarms=[])
    assert report.gaps == [[pytest.approx(0.99), None]]
    (grey,) = axes[0].patches
    assert [grey.get_x(), grey.get_x() + grey.get_width()] == pytest.approx([0.99, 1.99])


def test_alarms_are_bars_and_thresholds_are_lines(tmp_path: Path, figures: list[Any]) -> None:
    axes, found, report = drawn(
        "ilo-sampled", simulated("ilo-sampled").record(), tmp_path, figures
    )  # fmt: skip
    panels, bars = axes[:-1], axes[-1]
    assert [label.get_text() for label in bars.get_yticklabels()] == ["leak", "odd"]
    period = found["time"][1] - found["time"][0]
    covered = {0: 0.0, 1: 0.0}
    for bar in bars.collections:
        corners = bar.get_paths()[0].vertices
        row = round(float(corners[:, 1].mean()))
        covered[row] += float(np.ptp(corners[:, 0]))
    for row, name in enumerate(("leak", "odd")):
        raised = np.count_nonzero(found[f"alarm {name}"] == 1.0)
        assert covered[row] == pytest.approx(raised * period, rel=1e-6)
    dashed = {
        ax.get_ylabel().partition("\n")[0]: [
            line.get_ydata()[0] for line in ax.get_lines() if line.get_color() == "0.35"
        ]
        for ax in panels
    }
    odd = report.alarms["odd"]
    for label, bounds in dashed.items():
        if label == "fault":
            assert set(map(abs, bounds)) == {0.2}
        elif "residual" in label:
            for bound in bounds:
                assert abs(bound - odd.mean) == pytest.approx(odd.threshold, rel=1e-9)
        else:
            assert not bounds
    assert dashed["fault"]


def test_probability_has_an_upper_threshold_only(tmp_path: Path, figures: list[Any]) -> None:
    axes, *_ = drawn("imm-kalman", simulated("imm-kalman").record(), tmp_path, figures)
    dashed = {
        ax.get_ylabel().partition("\n")[0]: [
            line.get_ydata()[0] for line in ax.get_lines() if line.get_color() == "0.35"
        ]
        for ax in axes[:-1]
    }
    assert dashed["probability"] == [0.9]


def test_plot_is_the_same_whatever_a_matplotlibrc_says(tmp_path: Path) -> None:
    record = {name: values[:50] for name, values in simulated("kalman").record().items()}
    text, plots = write_record(tmp_path / "r.csv", record), []
    for styles in ([], ["ggplot", "dark_background"]):
        with matplotlib.style.context(styles):
            drawn_in = tmp_path / "e.svg"
            estimate_file(specification("kalman"), text, tmp_path / "e.csv", plot=drawn_in)
        plots.append(drawn_in.read_bytes())
    assert plots[0] == plots[1]


def test_long_record_is_plotted_by_minimum_and_maximum(tmp_path: Path, figures: list[Any]) -> None:
    columns = {
        "t": 0.01 * np.arange(20_001),
        "voltage": np.random.default_rng(4).normal(size=20_001),
    }
    tree = {"time": {"column": "t", "unit": "s"}, "measurements": [{"column": "voltage"}]}
    axes, found, _ = drawn(
        "levant", columns, tmp_path, figures, columns=tree, alarms=[],
        estimates={"derivatives": {"a": "V", "b": "V/s", "c": "V/s^2"}},
    )  # fmt: skip
    corners = axes[0].collections[0].get_paths()[0].vertices
    for first in (0, 2, 9998, 19_998):
        pair = found["a"][first : first + 2]
        here = corners[np.isclose(corners[:, 0], found["time"][first], atol=1e-6), 1]
        assert (here.min(), here.max()) == pytest.approx((pair.min(), pair.max()), rel=1e-12)
    assert corners[:, 0].max() == pytest.approx(200.0)  # the row without a partner


def test_measurements_inputs_and_predicted_bands_are_drawn(
    tmp_path: Path, figures: list[Any]
) -> None:
    """Measurements in the unit of the estimate that they are of, residuals in their bands."""
    columns = {title: values[:200] for title, values in simulated("kalman").record().items()}
    axes, _, _ = drawn(
        "kalman", columns, tmp_path, figures, alarms=[],
        estimates={"state": {"speed": "deg/s", "current": "mA"}},
    )  # fmt: skip
    speed, current, residual, _, voltage = axes
    lines = {ax: [line.get_ydata() for line in ax.get_lines()] for ax in axes}
    assert lines[speed][1] == pytest.approx(6.0 * columns["speed"])
    assert lines[current][1] == pytest.approx(columns["current"])
    assert np.array_equal(lines[voltage][0], columns["voltage"])
    assert voltage.get_ylabel() == "voltage\n[V]"
    assert [line.get_zorder() for line in speed.get_lines()] == [2, 1]
    band = residual.collections[0].get_paths()[0].vertices
    here = band[np.isclose(band[:, 0], columns["t"][150] / 1000.0), 1]
    assert here.min() == -here.max() < 0
    inside = np.abs(lines[residual][0][50:]) < here.max()
    assert 0.9 < inside.mean() < 1.0
    (key,) = figures[0].legends
    texts = [text.get_text() for text in key.get_texts()]
    assert texts == ["±2 standard deviations of the observer", "measured"]
    assert figures[0].get_suptitle() == "r.csv, KalmanFilter"


MEASURED = {
    "kalman": {("state", 0): 0, ("state", 1): 1},
    "eso": {("state", 0): 0, ("state", 1): 1},
    "extended-kalman": {("state", 0): 0},
    "ilo-sampled": {("rate", k): k for k in range(3)},
    "levant": {("derivatives", 0): 0},
}


@pytest.mark.parametrize("name", MEASURED)
def test_estimates_that_are_measured_are_found(name: str) -> None:
    chosen = specification(name)
    assert chosen.observer.design(chosen.sampling.period).measured == MEASURED[name]


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"C": [[0.0, 1.0], [1.0, 0.0]]}, {("state", 1): 0, ("state", 0): 1}),
        ({"C": [[2.0, 0.0], [1.0, 1.0]]}, {}),
        ({"D": [[1.0], [0.0]]}, {("state", 1): 1}),
    ],
)
def test_rows_of_C_say_what_is_measured(changes: dict[str, Any], found: dict[Any, int]) -> None:
    """Whatever the names are."""
    chosen = specification("kalman", observer=changes)
    assert chosen.observer.design(chosen.sampling.period).measured == found

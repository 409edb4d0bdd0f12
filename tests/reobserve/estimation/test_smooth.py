"""Smoothed estimates of whole records: bitwise those of `rts_smoother`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.cli.main import main
from reobserve.core.errors import InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import examples, simulated, specification_text
from reobserve.observers.smoother import rts_smoother
from tests.reobserve.estimation.records import read_results, signal_at, specification, write_record

SMOOTHED = ("kalman", "augmented-kalman", "extended-kalman", "unscented-kalman")
OTHERS = ["kalman-steady", *(name for name in examples() if not name.startswith(SMOOTHED))]


def by_hand(made: Estimation, y: Any, u: Any) -> dict[str, Any]:
    """The smoothed run of an observer, by calls of the library, with the filter's innovations."""
    keep = ["state_unknown_input_covariance"] if "unknown_input" in made.outputs.sources else []
    run = made.observer.run(y, u, start=made.design.start(), keep=keep)
    smooth = rts_smoother(run)
    return {**smooth.estimates, "residual": run["innovation"]}


@pytest.mark.parametrize("at_gap", ["coast", "restart"])
@pytest.mark.parametrize("name", SMOOTHED)
def test_estimates_are_those_of_the_smoother(name: str, at_gap: str, tmp_path: Path) -> None:
    """A record with lost values and a gap, over which the filter predicts or starts again."""
    columns = {title: values[:300].copy() for title, values in simulated(name).record().items()}
    sensor = list(columns)[1]
    columns[sensor][50:55] = np.nan
    kept = {title: np.delete(values, slice(100, 130)) for title, values in columns.items()}
    chosen = specification(name, smooth=True, sampling={"at_gap": at_gap})
    record = write_record(tmp_path / "r.csv", kept)
    made = estimate_file(chosen, record, tmp_path / "e.csv", block=4096)
    found, status = read_results(tmp_path / "e.csv")

    values = np.column_stack([
        way.of(columns[title])
        for title, way in zip(made.layout.titles, made.layout.conversions, strict=True)
    ])[:, 1:]  # fmt: skip
    y, u = np.split(values, [made.layout.measurements], axis=1)
    y[100:130] = np.nan
    u[100:130] = u[99]  # an unknown input is held
    rows = [slice(0, 300)] if at_gap == "coast" else [slice(0, 110), slice(130, 300)]
    parts = [by_hand(made, y[part], u[part]) for part in rows]
    assert status.count("restarted") == (at_gap == "restart")
    assert len(found["time"]) == sum(part.stop - part.start for part in rows)
    for column in made.outputs.columns:
        source = made.design.sigmas[column.estimate] if column.deviation else column.estimate
        expected = np.concatenate([part[source][:, column.place] for part in parts])
        expected = np.sqrt(expected) if column.deviation else expected
        assert np.array_equal(found[column.name], expected, equal_nan=True), column.name


def test_smoothed_estimates_are_closer_to_the_truth(tmp_path: Path) -> None:
    name, errors, sigmas = "kalman", [], []
    record = write_record(tmp_path / "r.csv", simulated(name).record())
    for smooth in (False, True):
        estimate_file(specification(name, smooth=smooth), record, tmp_path / "e.csv")
        found, _ = read_results(tmp_path / "e.csv")
        true = signal_at(simulated(name), "speed", found["time"])
        errors.append(float(np.sqrt(np.mean((found["speed"] - true) ** 2))))
        sigmas.append(found["speed sigma"])
    assert errors[1] < 0.9 * errors[0]
    assert (sigmas[1][:-1] < sigmas[0][:-1]).all()
    assert sigmas[1][-1] == sigmas[0][-1]


@pytest.mark.parametrize("name", OTHERS)
def test_observers_without_a_smoother_refuse_it(name: str) -> None:
    with pytest.raises(InputError, match=r"^smooth: true is for the kinds kalman \(with a varying"):
        Estimation(specification(name, smooth=True), list(simulated(name).record()), "r")


def test_streams_refuse_to_smooth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(specification_text("kalman") + "smooth: true\n", encoding="utf-8")
    write_record(Path("r.csv"), simulated("kalman").record())
    for words in (["--stream"], ["r.csv", "--follow"]):
        assert main(["estimate", "s.yaml", *words]) == 1
        said = capsys.readouterr()
        assert said.err.startswith("reobserve: smooth: true is for whole records, as each estimate")
        assert (said.err.count("\n"), said.out) == (1, "")

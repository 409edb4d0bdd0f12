"""`reobserve fit` on a log: the library's answer, and the specification that it writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reobserve import KalmanFilter, LinearModel, fit
from reobserve.cli.main import main
from reobserve.estimation.specification import read_specification
from tests.reobserve.estimation.records import write_record

SPEC = """\
observer:
  kind: kalman
  time: discrete
  A: [[1]]
  C: [[1]]
  Q: 1.0            # of the level
  R: 1.0
  initial_state: [0]
  initial_covariance: 100
columns: {time: {column: t}, measurements: [{column: level}]}
sampling: {period: 0.5, missing: skip, gap: 5, at_gap: restart}
"""


def record() -> np.ndarray:
    rng = np.random.default_rng(11)
    return np.cumsum(0.5 * rng.standard_normal(400)) + rng.standard_normal(400)


def make(p: dict[str, float]) -> object:
    model = LinearModel([[1]], C=[[1]], Q=p["observer.Q"], R=p["observer.R"], sampling_period=0.5)
    kalman = KalmanFilter(model)
    return kalman, kalman.init([0], 100.0)


def test_numbers_are_those_of_the_library(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    y = record()
    y[50] = np.nan
    time = 0.5 * np.arange(400)
    there = np.ones(400, dtype=bool)
    there[200:215] = False  # a gap, after which the filter restarts
    write_record(tmp_path / "log.csv", {"t": time[there], "level": y[there]})
    (tmp_path / "spec.yaml").write_text(SPEC)
    ranges = ["--range", "observer.Q", "0", "20", "--range", "observer.R", "1e-3", "1e3"]
    ranges += ["--linear", "observer.Q"]  # on a logarithmic scale no range begins at 0
    files = [str(tmp_path / name) for name in ("spec.yaml", "log.csv", "fitted.yaml")]
    assert main(["fit", *files[:2], *ranges, "--output", files[2]]) == 0
    bounds = {"observer.Q": (0.0, 20.0, "linear"), "observer.R": (1e-3, 1e3)}
    expected = fit(make, bounds, [y[:200], y[215:]])
    fitted = read_specification(files[2]).observer.design(0.5).observer.model
    assert fitted.Q[0, 0] == pytest.approx(expected.values["observer.Q"], rel=1e-5)
    assert fitted.R[0, 0] == pytest.approx(expected.values["observer.R"], rel=1e-5)
    assert "# of the level" in Path(files[2]).read_text(encoding="utf-8")
    said = capsys.readouterr().out
    assert f"{expected.standard_errors['observer.R']:.3g}" in said
    assert f"{expected.log_likelihood:.8g} fitted, of 384 measurements" in said
    # A pendulum's model as text has parameters that are fitted alike: any number of the observer.


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (["--range", "observer.P", "1", "2"], "observer.P: there is no 'P'"),
        (["--range", "sampling.period", "1", "2"], "sampling.period: must be a number of the obs"),
        (["--range", "observer.R", "low", "2"], "observer.R: the range's end 'low' must be a num"),
        (["--range", "observer.R", "3", "2"], "ranges.observer.R.high: 2 must be greater than"),
        (["--range", "observer.R", "1", "2", "--linear", "observer.Q"], "--linear observer.Q: has"),
        (["--range", "observer.R", "1", "2", "--budget", "3"], "budget: 3 is spent before"),
    ],
)
def test_what_cannot_be_fitted_is_refused(
    change: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_record(tmp_path / "log.csv", {"t": 0.5 * np.arange(400), "level": record()})
    (tmp_path / "spec.yaml").write_text(SPEC)
    assert main(["fit", str(tmp_path / "spec.yaml"), str(tmp_path / "log.csv"), *change]) == 1
    assert message in capsys.readouterr().err


def test_observer_without_a_likelihood_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_record(tmp_path / "log.csv", {"t": 0.5 * np.arange(400), "level": record()})
    text = SPEC.replace("kind: kalman", "kind: levant").split("  time: discrete")[0]
    tail = "  gains: {L: 1.0, order: 1}\n" + SPEC[SPEC.index("columns:") :]
    (tmp_path / "spec.yaml").write_text(
        text + tail.replace("missing: skip", "missing: interpolate")
    )
    files = [str(tmp_path / name) for name in ("spec.yaml", "log.csv")]
    assert main(["fit", *files, "--range", "observer.gains.L", "1", "2"]) == 1
    assert "observer.kind: a LevantDifferentiator has no likelihood" in capsys.readouterr().err

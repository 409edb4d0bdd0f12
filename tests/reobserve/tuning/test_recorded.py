"""Specifications that are tuned on recorded data: known answers, and what is refused."""

from __future__ import annotations

import csv
import math
import shutil
from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from reobserve.cli.main import main
from reobserve.core.documents import read_yaml
from reobserve.tuning.recorded import RecordedTask
from reobserve.tuning.scoring import ScoredRow, Scorer
from tests.reobserve.estimation.records import read_results, write_record

# A random walk of variance 0.04 a sample that decays and has an input, under noise of variance 1.
Q, R = 0.04, 1.0
SPECIFICATION = """\
observer:
  kind: kalman
  time: discrete
  states: {x: m}
  inputs: {u: m}
  measurements: {y: m}
  A: [[0.98]]
  B: [[0.1]]
  C: [[1.0]]
  Q: 0.04            # a comment that stays
  R: 1.0
  initial_state: [0.0]
  initial_covariance: 1.0
columns:
  time: {column: t, unit: s}
  measurements: [{column: y, unit: m}]
  inputs: [{column: u, unit: m}]
sampling: {period: 0.1}
"""
TUNE: dict[str, Any] = {
    "title": "A walk",
    "training": [{"file": "log.csv", "until": 1000.0, "segments": 8}],
    "held_out": [{"file": "log.csv", "since": 1000.0, "segments": 16}],
    "reference": {"x": {"column": "truth", "unit": "cm"}},
    "candidates": {
        "walk": {
            "specification": "walk.yaml", "ranges": {"observer.Q": {"range": [1e-5, 1e2]}},
        },
    },
    "budget": 40,
}  # fmt: skip


def log(path: Path, **changed: Any) -> Path:
    """A record of the system of the specification, with its true state [cm]."""
    stream, rows = np.random.default_rng(1), 20_000
    time = 0.1 * np.arange(rows)
    u, x = np.sin(time), np.zeros(rows)
    process = math.sqrt(Q) * stream.normal(size=rows)
    for k in range(1, rows):
        x[k] = 0.98 * x[k - 1] + 0.1 * u[k - 1] + process[k]
    y = x + math.sqrt(R) * stream.normal(size=rows)
    return write_record(path, {"t": time, "y": y, "u": u, "truth": 100 * x, **changed})


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return log(tmp_path_factory.mktemp("logged") / "log.csv")


def folder(path: Path, logged: Path, tree: dict[str, Any] = TUNE) -> Path:
    """A folder with a file to tune by, of that name, and what it reads."""
    shutil.copy(logged, path / "log.csv")
    (path / "walk.yaml").write_text(SPECIFICATION)
    (path / "tune.yaml").write_text(yaml.safe_dump(tree, sort_keys=False))
    return path / "tune.yaml"


def without(tree: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: part for key, part in tree.items() if key not in keys}


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("reference", [True, False])
def test_tuned_filter_agrees_with_the_filter_of_true_covariances(
    reference: bool, tmp_path: Path, logged: Path
) -> None:
    """By the true state, and by one-step prediction errors; the specification has the true ones."""
    tree = TUNE if reference else without(TUNE, "reference")
    file = folder(tmp_path, logged, tree)
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 0
    found = {row["training"]: row for row in rows(tmp_path / "out/table.csv")}
    tuned, true = (float(found[name]["error"]) for name in ("tuned", "paper"))
    assert tuned == pytest.approx(true, rel=0.01)
    assert found["tuned"]["within"] == "yes"
    text = (tmp_path / "out/walk.yaml").read_text()
    q = read_yaml(tmp_path / "out/walk.yaml")["observer"]["Q"]
    assert q == pytest.approx(Q, rel=0.3)
    assert text == SPECIFICATION.replace("0.04  ", f"{q!r}  ")
    # The steady-state covariance of the error: p = 0.98^2 p r / (p + r) + q, of the prediction.
    p = 1.0
    for _ in range(200):
        p = 0.98**2 * p * R / (p + R) + Q
    state = np.array([float(row["truth"]) for row in rows(logged)])
    y = np.array([float(row["y"]) for row in rows(logged)])
    if reference:
        expected = 100 * math.sqrt(p * R / (p + R)) / math.sqrt(np.mean(state**2))
    else:
        expected = math.sqrt(p + R) / math.sqrt(np.mean(np.diff(y) ** 2))
    assert true == pytest.approx(expected, rel=0.03)
    assert f"{'' if reference else 'one-step '}error / " in (tmp_path / "out/table.md").read_text()


def test_errors_agree_with_estimates_written_by_estimate(tmp_path: Path, logged: Path) -> None:
    file = folder(tmp_path, logged)
    task = RecordedTask.read(file)
    walk = str(tmp_path / "walk.yaml")
    out = tmp_path / "estimates.csv"
    assert main(["estimate", walk, str(tmp_path / "log.csv"), "--out", str(out)]) == 0
    estimates, _ = read_results(out)
    truth = np.array([float(row["truth"]) for row in rows(logged)])
    wrong = 100 * estimates["x"] - truth
    size = math.sqrt(np.mean(truth**2))  # the segments are the record
    found = Scorer(task).scores(ScoredRow("walk", "paper", (("observer.Q", Q),)), "held_out", 16)
    ends = np.linspace(1000.0, 1999.9, 17)
    ends[-1] += 0.05
    time = 0.1 * np.arange(len(truth))
    expected = [
        math.sqrt(np.mean(wrong[(time >= low) & (time < high)] ** 2)) / size
        for low, high in pairwise(ends)
    ]
    assert [one.error for one in found] == pytest.approx(expected, rel=1e-6)


@pytest.mark.nightly
def test_one_seed_gives_one_result(tmp_path: Path, logged: Path) -> None:
    outputs = []
    for name, seed in (("first", 1), ("again", 1), ("other", 2)):
        (tmp_path / name).mkdir()
        file = folder(tmp_path / name, logged, {**TUNE, "seed": seed})
        assert main(["tune", str(file), "--output", str(tmp_path / name / "out")]) == 0
        outputs.append([
            (tmp_path / name / "out" / one).read_bytes()
            for one in ("walk.yaml", "scores.csv", "table.csv")
        ])  # fmt: skip
    assert outputs[0] == outputs[1]
    assert outputs[0][0] != outputs[2][0]


def test_gaps_hold_the_last_estimate_and_rows_without_reference_are_left_out(
    tmp_path: Path, logged: Path
) -> None:
    """An observer restarts after a gap, in which the reference goes on."""
    record = {name: np.array([float(row[name]) for row in rows(logged)[:400]]) for name in ("t",)}
    t = record["t"]
    record |= {"y": 2.0 * t, "rate": np.full(len(t), 3.0)}
    record["y"][200:240] = np.nan
    record["rate"][300:] = np.nan
    write_record(tmp_path / "log.csv", record)
    (tmp_path / "difference.yaml").write_text(
        "observer:\n  kind: luenberger\n  time: continuous\n  states: {y: m, rate: m/s}\n"
        "  A: [[0, 1], [0, 0]]\n  C: [[1, 0]]\n  gains: {gain: [[1.0], [10.0]]}\n"
        "columns: {time: {column: t, unit: s}, measurements: [{column: y, unit: m}]}\n"
        "sampling: {period: 0.1, missing: interpolate, at_gap: restart}\n"
    )
    tree = {
        **TUNE, "training": [{"file": "log.csv", "since": 5.0, "until": 10.0}],
        "held_out": [{"file": "log.csv", "since": 15.0, "until": 24.0, "segments": 9},
                     {"file": "log.csv", "since": 29.0, "until": 40.0}],
        "reference": {"rate": {"column": "rate"}},
        "candidates": {"difference": {
            "specification": "difference.yaml",
            "ranges": {"observer.gains.gain.1.0": {"range": [5.0, 20.0]}},
        }},
    }  # fmt: skip
    (tmp_path / "tune.yaml").write_text(yaml.safe_dump(tree))
    task = RecordedTask.read(tmp_path / "tune.yaml")
    row = ScoredRow("difference", "paper", (("observer.gains.gain.1.0", 10.0),))
    found = Scorer(task).scores(row, "held_out", 10)
    # An estimate of 2 where 3 is stated, in the gap from 20 s to 24 s as before it.
    assert [one.error for one in found] == pytest.approx([1 / 3] * 10, rel=1e-9)
    assert len(task.record("held_out", task.held_out_seeds(10)[-1]).time) == 10


def test_records_without_times_and_with_dates_have_the_same_errors(
    tmp_path: Path, logged: Path
) -> None:
    found = []
    for name, column in (("numbers", "{column: t, unit: s}"), ("untimed", '{column: ""}'),
                         ("dates", "{column: t, unit: iso8601}")):  # fmt: skip
        (tmp_path / name).mkdir()
        file = folder(tmp_path / name, logged)
        walk = tmp_path / name / "walk.yaml"
        walk.write_text(SPECIFICATION.replace("{column: t, unit: s}", column))
        if name == "dates":
            lines = (tmp_path / name / "log.csv").read_text().splitlines()
            start = np.datetime64("2026-03-01T00:00:00.000")
            dated = [
                f"{start + np.timedelta64(100 * k, 'ms')}Z,{line.partition(',')[2]}"
                for k, line in enumerate(lines[1:])
            ]
            (tmp_path / name / "log.csv").write_text("\n".join([lines[0], *dated]) + "\n")
            tree, moments = deepcopy(TUNE), 0
            for part in (*tree["training"], *tree["held_out"]):
                for key in {"since", "until"} & part.keys():
                    part[key] = f"{start + np.timedelta64(round(1000 * part[key]), 'ms')}Z"
                    moments += 1
            assert moments
            file.write_text(yaml.safe_dump(tree, sort_keys=False))
        task = RecordedTask.read(file)
        row = ScoredRow("walk", "paper", (("observer.Q", 0.1),))
        found.append([one.error for one in Scorer(task).scores(row, "held_out", 16)])
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert found[2] == pytest.approx(found[0], rel=1e-6)


def changed(path: str, value: Any) -> dict[str, Any]:
    """The file with another value at a dotted key; None leaves it out."""
    tree = deepcopy(TUNE)
    *steps, last = path.split("/")
    here: Any = tree
    for step in steps:
        here = here[int(step) if isinstance(here, list) else step]
    if value is None:
        del here[last]
    else:
        here[last] = value
    return tree


RANGES = "candidates/walk/ranges"
SPAN = {"range": [1.0, 2.0]}
REFUSED: list[tuple[str, Any, str]] = [
    ("budget", 0, "tune.yaml: budget: 0 must be 1 or more"),
    ("candidates", {}, "tune.yaml: candidates: has 0 items, must have 1 or more"),
    ("candidates/walk/specification", "none.yaml", "none.yaml: cannot be read (No such file"),
    (RANGES, {"observer.P": SPAN}, "tune.yaml: candidates.walk.ranges.observer.P: there is no 'P'"),
    (RANGES, {"observer.A.0.1": SPAN}, "ranges.observer.A.0.1: there is no '1' in "),
    (RANGES, {"observer.kind": SPAN}, "ranges.observer.kind: is 'kalman' in "),
    (RANGES, {"observer.Q": {"range": [2.0, 1.0]}}, "observer.Q.high: 1 must be greater than the"),
    (RANGES, {"observer.Q": {"range": [0, 1.0]}}, "observer.Q.low: 0 must be greater than zero on"),
    (RANGES, {"observer.Q": {"range": [-2.0, -1.0], "scale": "linear"}},
     "tune.yaml: candidates.walk.ranges: hold no settings that work on a record"),
    ("candidates/a b", TUNE["candidates"]["walk"], "candidates.a b: must be letters, digits, _"),
    ("reference/x/column", "truht", "reference.x.column: "),
    ("reference/x/unit", "kg", "tune.yaml: candidates.walk.specification.x: 'm' cannot b"),
    ("reference", {"z": {"column": "truth"}}, "walk.yaml has no estimate 'z'"),
    ("training", [], "tune.yaml: training: has 0 items, must have 1 or more"),
    ("training/0/file", "other.csv", "other.csv: there is no such file"),
    ("training/0/until", 1100.0, "tune.yaml: held_out.0: overlaps training.0 in log.csv; segments"),
    ("training/0/since", 3000.0, "training.0.until: 1000 must be later than since, 3000"),
    ("held_out/0/since", 1999.0, "held_out.0: must have two rows or more in each segment; log.csv"),
    ("held_out/0/segments", 3, "tune.yaml: held_out: has 3 segments, must have 4 or more"),
    ("held_out/0/segment", 3, "held_out.0.segment: unknown key; did you mean 'segments'?"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "message"), REFUSED, ids=[one[2] for one in REFUSED])
def test_invalid_files_are_refused_naming_file_and_key(
    path: str, value: Any, message: str, tmp_path: Path, logged: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    file = folder(tmp_path, logged, changed(path, value))
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 1
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_copy_of_a_training_record_is_not_held_out(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder(tmp_path, logged, changed("held_out", [{"file": "copy.csv", "segments": 9}]))
    shutil.copy(logged, tmp_path / "copy.csv")
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 1
    message = "tune.yaml: held_out.0: overlaps training.0 in log.csv, of which copy.csv is a copy;"
    assert message in capsys.readouterr().err


def test_faulty_records_are_refused_as_by_estimate_before_the_search(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = logged.read_text(encoding="utf-8").splitlines(keepends=True)
    without_row = [*lines[:15_001], *lines[15_003:]]
    emptied = [
        *lines[:15_001],
        lines[15_001].replace(lines[15_001].split(",")[1], ""),
        *lines[15_002:],
    ]
    out = str(tmp_path / "out")
    for changed_lines in (lines[:1], without_row, emptied):
        file = folder(tmp_path, logged)
        (tmp_path / "log.csv").write_text("".join(changed_lines))
        said = []
        for command in (
            ["tune", str(file)],
            ["estimate", str(tmp_path / "walk.yaml"), str(tmp_path / "log.csv")],
        ):  # fmt: skip
            assert main([*command, "--output" if command[0] == "tune" else "--out", out]) == 1
            said.append(capsys.readouterr().err)
        assert "tuned" not in said[0]
        assert said[0].count("\n") == 1
        assert said[1].partition("log.csv")[2][-60:] in said[0]


def test_measured_column_can_be_the_reference(tmp_path: Path, logged: Path) -> None:
    tree = changed("reference/x", {"column": "y"})
    task = RecordedTask.read(folder(tmp_path, logged, tree))
    first = task.record("held_out", 1)
    y = np.array([float(row["y"]) for row in rows(logged)])
    assert first.truth[:, 0] * task.scale[0] == pytest.approx(y[: len(first.time)])


def test_anchors_are_not_tuned(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder(tmp_path, logged)
    text = SPECIFICATION.replace("Q: 0.04 ", "Q: &q 0.04 ").replace("variance: 1.0", "variance: *q")
    (tmp_path / "walk.yaml").write_text(text)
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 1
    assert "ranges.observer.Q: has an anchor in " in capsys.readouterr().err


def test_settings_that_are_not_better_than_as_specified_are_reported(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = changed("candidates/walk/ranges", {"observer.Q": {"range": [1.0, 100.0]}})
    file = folder(tmp_path, logged, {**tree, "budget": 5})
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 0
    assert "walk: not better than as specified; raise the budget" in capsys.readouterr().err


def test_smoothed_candidate_is_not_what_others_are_compared_with(
    tmp_path: Path, logged: Path
) -> None:
    other = {**TUNE["candidates"]["walk"], "specification": "smoothed.yaml"}
    file = folder(tmp_path, logged, {**changed("candidates/smoothed", other), "budget": 5})
    (tmp_path / "smoothed.yaml").write_text(SPECIFICATION + "smooth: true\n")
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 0
    found = {(row["method"], row["training"]): row for row in rows(tmp_path / "out/table.csv")}
    filtered, smoothed = (found[name, "paper"] for name in ("walk", "smoothed"))
    assert (filtered["within"], smoothed["within"]) == ("yes", "late")
    assert float(smoothed["error"]) < 0.9 * float(filtered["error"])


def test_candidates_state_one_sampling_where_predictions_are_compared(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = without(
        changed("candidates/other", {**TUNE["candidates"]["walk"], "specification": "b.yaml"}),
        "reference",
    )
    file = folder(tmp_path, logged, tree)
    text = SPECIFICATION.replace("period: 0.1", "period: 0.1, missing: interpolate")
    (tmp_path / "b.yaml").write_text(text)
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 1
    assert "b.yaml must state the same sampling as " in capsys.readouterr().err


def test_candidates_measure_one_column_where_predictions_are_compared(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = {**TUNE["candidates"]["walk"], "specification": "b.yaml"}
    file = folder(tmp_path, logged, without(changed("candidates/other", other), "reference"))
    text = SPECIFICATION.replace("measurements: [{column: y,", "measurements: [{column: truth,")
    (tmp_path / "b.yaml").write_text(text)
    assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 1
    assert "b.yaml must measure the same as " in capsys.readouterr().err


def test_input_files_are_not_overwritten(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder(tmp_path, logged)
    assert main(["tune", str(file), "--output", str(tmp_path)]) == 1
    assert "walk.yaml: is read here, and would be overwritten" in capsys.readouterr().err
    assert (tmp_path / "walk.yaml").read_text() == SPECIFICATION


def test_zero_or_missing_reference_is_refused(
    tmp_path: Path, logged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder(tmp_path, logged)
    for value, message in (
        (0.0, "reference.x: does not differ from zero in a segment"),
        (np.nan, "log.csv: has no row with a number in each column"),
    ):
        log(tmp_path / "log.csv", truth=np.full(20_000, value))
        assert main(["tune", str(file), "--output", str(tmp_path / "out")]) == 1
        assert message in capsys.readouterr().err


def test_observer_without_predictions_needs_a_reference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A high-gain observer takes each measurement for the time since the one before."""
    for name in ("high-gain", "levant"):
        files = [str(tmp_path / f"{name}.{kind}") for kind in ("yaml", "csv")]
        assert main(["estimate", "--example", name, "--out", files[0], "--data", files[1]]) == 0
        key = "observer.gains.rho" if name == "high-gain" else "observer.gains.L"
        tree = {
            **without(TUNE, "reference"), "budget": 5,
            "training": [{"file": f"{name}.csv", "until": 2.0}],
            "held_out": [{"file": f"{name}.csv", "since": 2.0, "segments": 4}],
            "candidates": {"one": {"specification": f"{name}.yaml",
                                   "ranges": {key: {"range": [1.0, 10.0]}}}},
        }  # fmt: skip
        (tmp_path / "tune.yaml").write_text(yaml.safe_dump(tree))
        status = main(["tune", str(tmp_path / "tune.yaml"), "--output", str(tmp_path / name)])
        printed = capsys.readouterr().err
        assert status == (name == "high-gain"), printed
        refused = "predicts no measurement from those before it, so there must be a reference"
        assert (refused in printed) == (name == "high-gain")

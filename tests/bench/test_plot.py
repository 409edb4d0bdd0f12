"""Figures and tables show the numbers of the results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from reobserve.bench.plot import evaluations, heat_map, levels
from reobserve.bench.table import Results, summary
from reobserve.bench.task import Task
from reobserve.bench.tuned_file import Cost, Repeat, TunedMethod, TunedOn

from .toy import method, stated, write


def cell(condition: str, method: str, training: str = "nominal", **keys: Any) -> dict[str, Any]:
    return {
        "condition": condition, "method": method, "training": training, "given_noise": "no",
        "seeds": 16.0, "error": 0.2, "low": 0.1, "high": 0.3, "first": keys.get("error", 0.2),
        "ratio": 1.0, "ratio_low": 1.0,
        "ratio_high": 1.0, "within": "yes", "failed": 0.0, "lag": 0.012, "quantile": 0.5,
        "repeat_low": 0.1, "repeat_high": 0.3, **keys,
    }  # fmt: skip


@pytest.fixture
def results(tmp_path: Path) -> Results:
    tree = stated()
    own = {"settings": {"share": 1.0}, "source": "p. 1"}
    tree["methods"] = {"share": method(label="Share", paper=own),
                       "reported": method(label="Given", given_noise=True)}  # fmt: skip
    tree["conditions"]["wrong"] = {"title": "wrong", "model": 0.1}
    tree["shown"] = ["share", "reported"]
    cells = [
        cell("nominal", "share", error=0.25, ratio=1.25, within="no"),
        cell("nominal", "reported"),
        cell("nominal", "share", "paper", error=2.5, ratio=12.5, within="no", failed=0.25),
        cell("noise", "share", error=0.75),
        cell("noise", "share", "noise", error=0.65),
        cell("noise", "reported", error=0.55),
        cell("noise", "reported", given_noise="yes", error=0.45),
        cell("noise", "reported", "noise", given_noise="yes", error=0.35),
        cell("high", "share", error=0.15),
        cell("wrong", "share", error=0.85),
    ]
    repeats = [
        Repeat(
            {"share": 1.0},
            0.0,
            {"share": "high"},
            dict(zip(("10", "25", "40"), errors, strict=True)),
        )
        for errors in ((0.5, 0.3, 0.2), (0.4, 0.21, 0.2), (0.6, 0.2, 0.2))
    ]
    tuned = TunedMethod({"nominal": TunedOn("", repeats)}, Cost(1.5, 0.25))
    task = Task.read(write(tmp_path, tree))
    return Results(task, cells, {"share": tuned, "reported": tuned})


def test_heat_map_has_one_cell_per_number(results: Results) -> None:
    axes = heat_map(results).axes[0]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    assert rows == ["Share", "Share, the paper's settings", "Given", "Given, given R"]
    found = {text.get_position(): text.get_text() for text in axes.texts}
    assert found == {
        (0, 0): "0.250", (1, 0): "0.750", (0, 1): "2.50", (0, 2): "0.200", (1, 2): "0.550",
        (1, 3): "0.450",
    }  # fmt: skip
    bold = {t.get_position() for t in axes.texts if t.get_fontweight() == "bold"}
    assert bold == {(1, 0), (0, 2), (1, 2), (1, 3)}
    shades = {
        (round(p.get_x() + 0.5), round(p.get_y() + 0.5)): (p.get_facecolor()[0], p.get_hatch())
        for p in axes.patches
    }
    assert [place for place, (_, hatch) in shades.items() if hatch] == [(0, 1)]
    assert shades[0, 2][0] > shades[0, 0][0] > shades[0, 1][0]


def test_level_figure_marks_tuned_given_and_retuned_settings(results: Results) -> None:
    noise, model, level = levels(results).axes
    drawn = [
        (line.get_marker(), *map(list, zip(*line.get_xydata().tolist(), strict=True)))
        for line in noise.lines[:-2]
    ]
    assert drawn == [
        ("o", [1.0, 5.0], [0.25, 0.75]), ("o", [5.0], [0.65]),
        ("s", [1.0, 5.0], [0.2, 0.55]), ("x", [5.0], [0.45]), ("o", [5.0], [0.35]),
    ]  # fmt: skip
    assert [text.get_text() for text in noise.figure.legends[0].get_texts()] == [
        "Share", "Given", "the same, given the noise", "tuned again",
    ]  # fmt: skip
    assert model.lines[0].get_xydata().tolist() == [[0.0, 0.25], [10.0, 0.85]]
    assert level.get_xlabel() == "level"
    assert level.lines[0].get_xydata().tolist() == [[1.0, 0.25], [2.0, 0.15]]


def test_error_curve_shows_the_median_of_repeats(results: Results) -> None:
    (line, *_) = evaluations(results).axes[0].lines
    assert line.get_xydata().tolist() == [[10.0, 0.5], [25.0, 0.21], [40.0, 0.2]]


def test_table_lists_requirements_and_cost_of_each_method(results: Results) -> None:
    lines = summary(results).splitlines()
    assert lines[4] == (
        "| Share | k | g | 1 | 25 | 0.250 [0.100 0.300] | **0.750** [0.100 0.300] | 12 ms | 0.50 "
        "| 0.25 µs, 1.5 ms | share (high) |"
    )
    assert "| Share, the paper's settings |  |  |  |  | 2.50 [0.100 0.300], 25 % f" in lines[5]
    assert "**0.450** [0.100 0.300]" in lines[7]
    assert "| lag | 95 % | cost |" in lines[2]
    results.task.module.COLUMNS = ("delay", "false alarms")  # type: ignore[attr-defined]
    head = summary(results).splitlines()[2]
    assert "| delay | false alarms | cost |" in head

"""Figures show the numbers of the results."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve.tuning.results import Results
from reobserve_papers.bench.bench_figures import evaluations, heat_map, levels
from reobserve_papers.bench.task_commands import plot_command
from reobserve_papers.figure_diff.pixels import TOLERANCE, read_pixels, rms_difference
from reobserve_papers.golden.golden_bench import golden_table
from tests import ROOT
from tests.reobserve.tuning.toy import stated_results


@pytest.fixture
def results(tmp_path: Path) -> Results:
    return stated_results(tmp_path)


def test_heat_map_has_one_cell_per_number(results: Results) -> None:
    axes = heat_map(results).axes[0]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    assert rows == ["Share", "Share, the paper's settings", "Given", "Given, given R"]
    found = {text.get_position(): text.get_text() for text in axes.texts}
    assert found == {
        (0, 0): "0.250", (1, 0): "0.750", (0, 1): "2.50", (0, 2): "0.200?", (1, 2): "0.550",
        (1, 3): "0.450",
    }  # fmt: skip
    bold = {t.get_position() for t in axes.texts if t.get_fontweight() == "bold"}
    assert bold == {(1, 0), (1, 2), (1, 3)}
    assert [t.get_position() for t in axes.texts if t.get_fontstyle() == "italic"] == [(0, 2)]
    note = " ".join(axes.figure.note)  # type: ignore[union-attr]
    assert "italic with ?: undecided; neither: more than 5 % worse" in note
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
    x, y = line.get_data()
    assert list(x) == [10.0, 25.0, 40.0]
    assert list(y) == pytest.approx([2.5, 1.05, 1.0])


def test_figures_of_accepted_numbers_are_the_accepted_ones(tmp_path: Path) -> None:
    task = "leak"  # with all kinds of figures
    accepted = {path.stem: path for path in (ROOT / "tests/reference/bench" / task).glob("*.png")}
    drawn = {name: tmp_path / f"{name}.png" for name in accepted}
    settings = ROOT / "config/bench/tuned" / task
    stated, table = ROOT / f"config/bench/{task}.yaml", golden_table(ROOT, task)
    plot_command(stated, table, settings, [*drawn.values()], None)
    assert accepted
    for name, path in accepted.items():
        found = rms_difference(read_pixels(path), read_pixels(drawn[name]), f"{task} {name}")
        assert found <= TOLERANCE, name

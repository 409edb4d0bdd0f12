"""Comparisons on held-out records, on a task with errors in closed form."""

from __future__ import annotations

import csv
import math
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.tuning.results import Results, write_cells, write_scores
from reobserve.tuning.scoring import ScoredRow, Scorer, moved, score_task
from reobserve.tuning.task import Task
from reobserve.tuning.task_tuning import objective, tune_method
from reobserve.tuning.tuned_file import TunedMethod, read_tuned

from .toy import method, stated, toy, write


def kept(task: Task, folder: Path) -> dict[str, TunedMethod]:
    for name in task.methods:
        tune_method(task, name, lambda _: None).write(folder / f"{name}.json")
    return read_tuned(task, folder)


def off(seed: int) -> float:
    return float(np.random.default_rng(seed).normal())


def error(share: float, deviation: float, seed: int) -> float:
    return abs(share * (1.0 + deviation * off(seed)) - 1.0)


def test_scores_agree_with_hand_calculation(tmp_path: Path) -> None:
    task = toy(tmp_path)
    row = ScoredRow("share", "nominal", (("share", 0.9),))
    for condition, deviation in (("nominal", 0.1), ("noise", 0.5)):
        found = [one.error for one in Scorer(task).scores(row, condition, 20)]
        assert found == pytest.approx([error(0.9, deviation, 1001 + k) for k in range(20)])


def test_tuning_uses_separate_records_and_stores_its_objective(tmp_path: Path) -> None:
    task = toy(tmp_path)
    tuned = kept(task, tmp_path / "tuned")
    for name, deviation in (("nominal", 0.1), ("noise", 0.5)):
        repeats = tuned["share"].training[name].repeats
        for k, one in enumerate(repeats):
            seeds = [1 + 100 * k + j for j in range(8)]
            logs = [math.log(error(one.settings["share"], deviation, seed)) for seed in seeds]
            assert one.objective == pytest.approx(np.mean(logs), abs=1e-9)
            assert objective(task, "share", name, k, one.settings) == one.objective
            held_out = [error(one.settings["share"], deviation, 1001 + j) for j in range(16)]
            assert list(one.held_out) == ["10", "25", "40"]
            assert one.error == one.held_out["40"]
            assert one.error == pytest.approx(np.exp(np.mean(np.log(held_out))), rel=1e-5)
    assert len(tuned["share"].training["nominal"].repeats) == 3


def test_cells_hold_geometric_means_of_the_repeat_that_trained_best(
    tmp_path: Path,
) -> None:
    task = toy(tmp_path)
    tuned = kept(task, tmp_path / "tuned")
    cells = score_task(task, tuned)
    found = {(c.condition, c.row.method, c.row.training, c.row.given): c for c in cells}
    assert {key for key in found if key[0] == "noise"} == {
        ("noise", "share", "nominal", False), ("noise", "share", "noise", False),
        ("noise", "reported", "nominal", False), ("noise", "reported", "nominal", True),
        ("noise", "reported", "noise", True),
    }  # fmt: skip

    def mean(share: float, deviation: float, count: int) -> float:
        each = [error(share, deviation, 1001 + k) for k in range(count)]
        return float(np.exp(np.mean(np.log(each))))

    shares = [one.settings["share"] for one in tuned["share"].training["nominal"].repeats]
    seeds = [1 + 100 * k + j for k in range(3) for j in range(8)]  # of all repeats
    best = min(shares, key=lambda share: np.mean(np.log([error(share, 0.1, k) for k in seeds])))
    assert len(set(shares)) == 3
    cell = found["nominal", "share", "nominal", False]
    count = len(cell.scores)
    assert cell.row.settings == (("share", best),)
    assert cell.first == pytest.approx(mean(best, 0.1, 16))
    assert cell.error[0] == pytest.approx(mean(best, 0.1, count))
    spread = [mean(share, 0.1, count) for share in shares]  # over the same seeds
    assert cell.repeats == pytest.approx((min(spread), max(spread)), rel=1e-9)
    trust = dict(found["noise", "reported", "nominal", True].row.settings)["trust"]
    for given, reported in ((False, 0.1), (True, 0.5)):
        cell = found["noise", "reported", "nominal", given]
        assert cell.error[0] == pytest.approx(
            mean(trust / (1 + reported**2), 0.5, len(cell.scores))
        )
    for condition in ("nominal", "noise"):
        here = [c for c in cells if c.condition == condition and c.row.training == "nominal"]
        for c in here:
            others = [one.error[0] for one in here if one is not c]
            assert c.ratio[0] == pytest.approx(c.error[0] / min(others))
            assert c.ratio[1] <= c.ratio[0] <= c.ratio[2]
        decided = [c.ratio[2] <= 1.05 or c.ratio[1] > 1.05 for c in here]
        assert all(decided) or len(here[0].scores) == 64
        assert decided == [c.within != "undecided" for c in here]
    # Rows that are in no table are not extended.
    assert {len(c.scores) for c in cells if c.condition == "high"} == {16}


def test_papers_settings_and_other_conditions_of_a_training_set_have_rows(tmp_path: Path) -> None:
    """The paper's share of 0.8 in the table, that of the noise also where it is `scored`."""
    tree = stated()
    tree["methods"]["share"] = method(paper={"settings": {"share": 0.8}, "source": "p. 1"})
    tree["training"]["noise"]["scored"] = ["high"]
    task = Task.read(write(tmp_path, tree))
    tuned = kept(task, tmp_path / "tuned")
    every = score_task(task, tuned)
    cells = [cell for cell in every if cell.row.method == "share"]
    for cell in every:  # the best is one of the rows of the table, the paper's among them
        listed = [
            one.error[0] for one in every
            if one.condition == cell.condition and one.row.training in ("nominal", "paper")
            and one is not cell
        ]  # fmt: skip
        assert cell.ratio[0] == pytest.approx(cell.error[0] / min(listed))
    assert [(cell.condition, cell.row.training) for cell in cells] == [
        ("nominal", "nominal"), ("nominal", "paper"),
        ("noise", "nominal"), ("noise", "noise"), ("noise", "paper"),
        ("high", "nominal"), ("high", "noise"),
    ]  # fmt: skip
    for cell in cells:
        if cell.row.training == "paper":
            deviation = 0.1 if cell.condition == "nominal" else 0.5
            logs = [math.log(error(0.8, deviation, 1001 + k)) for k in range(len(cell.scores))]
            assert cell.error[0] == pytest.approx(math.exp(np.mean(logs)))
            assert cell.repeats is None
    (other,) = (cell for cell in cells if (cell.condition, cell.row.training) == ("high", "noise"))
    (repeat,) = tuned["share"].training["noise"].repeats
    assert dict(other.row.settings) == repeat.settings


def test_comparison_stops_when_the_five_percent_question_is_decided(tmp_path: Path) -> None:
    def compared(*shares: float) -> list[Any]:
        rows = [ScoredRow("share", "nominal", (("share", value),)) for value in shares]
        return scorer.compared(rows, "nominal")

    scorer = Scorer(toy(tmp_path))
    for shares, within in (((0.5, 0.500001), "yes"), ((0.5, 0.1), "no")):
        first, second = compared(*shares)
        assert len(first.scores) == len(second.scores) == 16
        assert (first.within, second.within) == ("yes", within)
    assert {len(cell.scores) for cell in compared(0.97, 1.03)} == {64}
    # Known to differ after 16 seeds, but not whether by more than 5 %.
    first, second = compared(0.5, 0.475)
    assert second.ratio[1] > 1
    assert (len(first.scores), second.ratio[1] <= 1.05 < second.ratio[2]) == (64, True)


def test_what_reads_later_rows_is_never_the_best(tmp_path: Path) -> None:
    methods = {"share": method(), "later": method(make="share", causal=False)}
    task = toy(tmp_path, methods=methods)
    rows = [
        ScoredRow.of(name, task.main, {"share": share})
        for name, share in (("share", 0.9), ("later", 1.0))
    ]
    first, later = Scorer(task).compared(rows, "nominal")
    assert first.ratio == (1.0, 1.0, 1.0)
    assert later.error[0] < 0.9 * first.error[0]
    assert later.ratio[0] == pytest.approx(later.error[0] / first.error[0])
    assert (first.within, later.within) == ("yes", "late")


def test_unexpected_failures_raise_an_error(tmp_path: Path) -> None:
    tree = {**stated(), "shown": ["fragile"]}
    tree["methods"] = {"fragile": method()}
    task = Task.read(write(tmp_path, tree))
    row = ScoredRow("fragile", "nominal", (("share", 1.0),))
    with pytest.raises(
        InputError, match=r"methods\.fragile: fails in the condition noise, seed 10"
    ):
        Scorer(task).scores(row, "noise", 64)
    tree["methods"] = {"fragile": method(fails={"noise": "large measurements are refused"})}
    task = Task.read(write(tmp_path, tree))
    scores = Scorer(task).scores(row, "noise", 64)
    failed = [1.0 + 0.5 * off(1001 + k) > 1.5 for k in range(64)]
    assert 0 < sum(failed) < 64
    assert [one.failed for one in scores] == failed
    assert [one.error == 3.0 for one in scores] == failed
    task = replace(task, methods={"fragile": replace(task.methods["fragile"], fails={})})
    paper = Scorer(task).scores(replace(row, training="paper"), "noise", 64)
    assert [one.failed for one in paper] == failed


def test_changed_settings_are_detected(tmp_path: Path) -> None:
    task = toy(tmp_path)
    tuned = kept(task, tmp_path / "tuned")
    assert all(one.ratio == one.low == one.high == 1.0 for one in moved(task, tuned, tuned))
    again = deepcopy(tuned)
    for one in again["share"].training["nominal"].repeats:
        one.settings["share"] *= 0.3
    found = {(one.method, one.condition): one for one in moved(task, tuned, again)}
    assert {key for key, one in found.items() if one.moved} == {
        ("share", "nominal"), ("share", "noise"),
    }  # fmt: skip
    shares = [one.settings["share"] for one in tuned["share"].training["nominal"].repeats]
    logs = [
        math.log(error(0.3 * share, 0.1, 1001 + k)) - math.log(error(share, 0.1, 1001 + k))
        for share in shares for k in range(16)
    ]  # fmt: skip
    assert found["share", "nominal"].ratio == pytest.approx(math.exp(np.mean(logs)))


def test_stored_settings_are_kept_for_other_training_sets_of_the_same_task(tmp_path: Path) -> None:
    tuned = tune_method(toy(tmp_path), "share", lambda _: None)
    stored = deepcopy(tuned)
    for one in stored.training.values():
        for repeat in one.repeats:
            repeat.settings["share"] = 0.5
    again = tune_method(toy(tmp_path), "share", lambda _: None, stored)
    assert again.training["nominal"] == tuned.training["nominal"]
    assert again.training["noise"] == stored.training["noise"]
    less = tune_method(toy(tmp_path, budget=20), "share", lambda _: None, stored)
    assert less.training["noise"].repeats[0].settings["share"] != 0.5


def test_training_sets_that_are_left_out_have_no_rows(tmp_path: Path) -> None:
    """A new method, tuned on the main set only; one that is stored keeps its other sets."""
    task, said = toy(tmp_path), lambda _: None
    new = tune_method(task, "share", said, main_only=True)
    old = tune_method(task, "reported", said)
    kept_sets = tune_method(task, "reported", said, old, main_only=True).training
    assert (list(new.training), list(kept_sets)) == (["nominal"], ["nominal", "noise"])
    for name, one in (("share", new), ("reported", old)):
        one.write(tmp_path / f"tuned/{name}.json")
    cells = score_task(task, read_tuned(task, tmp_path / "tuned"))
    assert {(c.row.method, c.row.training) for c in cells if c.condition == "noise"} == {
        ("share", "nominal"), ("reported", "nominal"), ("reported", "noise"),
    }  # fmt: skip
    del new.training["nominal"]
    new.write(tmp_path / "tuned/share.json")
    with pytest.raises(InputError, match=r"share\.json: training\.nominal is not of what"):
        read_tuned(task, tmp_path / "tuned")


def test_result_files_round_trip(tmp_path: Path) -> None:
    task = toy(tmp_path)
    cells = score_task(task, kept(task, tmp_path / "tuned"))
    paths = [tmp_path / f"{name}.csv" for name in ("scores", "table")]
    write_scores(task, cells, paths[0])
    write_cells(cells, paths[1])
    results = Results.read(task, paths[1], tmp_path / "tuned")
    for cell in cells:
        row = results.cell(cell.condition, cell.row.method, cell.row.training, cell.row.given)
        assert row is not None
        assert (row["error"], row["low"], row["high"]) == cell.error
        assert row["seeds"] == len(cell.scores)
    with paths[0].open(newline="") as stream:
        assert len(list(csv.DictReader(stream))) == sum(len(cell.scores) for cell in cells)
    assert [row[0] for row in results.rows()] == ["L", "L", "L, given R"]
    assert len(results.evaluations_needed("share")) == 3
    for one in results.tuned["share"].training["nominal"].repeats:
        one.held_out.clear()
        one.held_out.update({"10": 0.104, "25": 0.106, "50": 0.104, "100": 0.1})
    assert results.evaluations_needed("share") == [50, 50, 50]


def test_settings_tuned_for_another_task_are_refused(tmp_path: Path) -> None:
    task = toy(tmp_path)
    kept(task, tmp_path / "tuned")
    changes: list[dict[str, Any]] = [
        {"budget": 41}, {"plant": {"noise": 0.2}}, {"scored_from": 0.5},
        {"methods": {**stated()["methods"], "share": method(fixed={"other": 1.0})}},
    ]  # fmt: skip
    for changed in changes:
        with pytest.raises(InputError, match=r"share\.json: training\.nominal is not of what"):
            read_tuned(toy(tmp_path, **changed), tmp_path / "tuned")
    # Labels and other methods do not matter.
    words = {**stated()["methods"], "share": method(label="other", needs="more")}
    assert read_tuned(toy(tmp_path, title="new", methods=words), tmp_path / "tuned")
    more = {**stated()["methods"], "second": method(make="share")}
    with pytest.raises(InputError, match=r"second\.json: cannot be read"):
        read_tuned(toy(tmp_path, methods=more), tmp_path / "tuned")

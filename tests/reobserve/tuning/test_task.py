"""Task files: errors are reported with file, key and value."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve.tuning.task import Task

from .toy import method, stated, toy, write


def changed(*path: str, to: Any) -> dict[str, Any]:
    tree = stated()
    place = tree
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to
    return tree


@pytest.mark.parametrize(
    ("tree", "said"),
    [
        (changed("period", to=0.0), r"toy\.yaml\.period: 0 must be greater than zero"),
        (changed("plant", to={"nois": 0.1}), r"conditions\.nominal\.plant\.nois: unknown key; did"),
        (changed("plant", "noise", to="much"), r"plant\.noise: 'much' is not a number"),
        (changed("conditions", "noise", "nose", to=2), r"noise\.nose: unknown key; did"),
        (changed("conditions", "high", "plant", to={"lvl": 1}), r"high\.plant\.lvl: unk"),
        (changed("table", to=["nominl"]), r"table: there is no 'nominl'; did you mean 'nominal'\?"),
        (changed("shown", to=["all"]), r"shown: there is no 'all'"),
        (changed("training", "noise", "conditions", to=["nois"]),
         r"training\.noise\.conditions: there is no 'nois'"),
        (changed("methods", "share", "make", to="shar"),
         r"methods\.share\.make: 'shar' is no function of the task; did you mean 'share'\?"),
        (changed("methods", "share", "make", to="math:none"), r"make: 'math:none' is no function"),
        (changed("methods", "share", "ranges", "share", "range", to=[0.0, 1.0]),
         r"ranges\.share\.low: 0 must be greater than zero on a log scale"),
        (changed("methods", "share", "ranges", "share", "range", to=[2.0, 1.0]),
         r"ranges\.share\.high: 1 must be greater than the lower end, 2"),
        (changed("methods", "share", "fails", to={"nose": "no"}), r"fails: there is no 'nose'"),
        (changed("methods", "share", "paper", to={"settings": {"gain": 1.0}, "source": "p. 1"}),
         r"methods\.share\.paper\.settings: must be those of the ranges: share"),
        (changed("methods", to={"share": {k: v for k, v in method().items() if k != "needs"}}),
         r"methods\.share\.needs: is missing"),
        (changed("seeds", to={"training": 0}), r"seeds\.training: 0 must be 1 or more"),
    ],
)  # fmt: skip
def test_invalid_value_is_reported(tree: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said) as caught:
        Task.read(write(tmp_path, tree))
    assert "toy.yaml" in str(caught.value)


def test_task_without_a_module_is_reported(tmp_path: Path) -> None:
    path = write(tmp_path, stated())
    (tmp_path / "toy.py").unlink()
    with pytest.raises(InputError, match=r"toy\.yaml: needs a module toy\.py beside it$"):
        Task.read(path)


def test_method_is_constructed_from_noise_and_settings(tmp_path: Path) -> None:
    task = toy(tmp_path)
    record = task.record("noise", 5)
    for given, noise in ((False, 0.1), (True, 0.5)):
        estimate = task.make("reported", {"trust": 2.0}, "noise", given=given)(record)
        assert estimate == pytest.approx(2.0 / (1 + noise**2) * record.measurements)
    assert task.record("high", 5).truth[0, 0] == 2.0

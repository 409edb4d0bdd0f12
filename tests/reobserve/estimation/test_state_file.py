"""State files are checked completely; a mutated file is refused and nothing of it is used."""

from __future__ import annotations

import contextlib
import copy
import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reobserve.core.errors import InputError, ReobserveError
from reobserve.estimation.data_report import as_json
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.examples import simulated
from reobserve.estimation.report_table import as_table
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.state_file import _content, _plain, load_state, save_state
from tests.reobserve.estimation.records import specification

NAMES = ("kalman", "extended-kalman", "imm-kalman", "ilo-sampled", "extended-high-gain")


def fresh(name: str) -> Estimation:
    return Estimation(specification(name), list(simulated(name).record()), "r")


@cache
def saved(name: str) -> str:
    """A state after 25 rows of an example, the last with an empty cell."""
    estimation, columns = fresh(name), simulated(name).record()
    rows = RowByRow(estimation, list(columns))
    for k in range(25):
        cells = [repr(float(values[k])) for values in columns.values()]
        rows.read(",".join([*cells[:1], "", *cells[2:]] if k == 24 else cells))
    rows.settle()
    path = Path.cwd() / f".{name}.state.json"
    try:
        save_state(path, estimation, "d", 1234)
        return path.read_text()
    finally:
        path.unlink(missing_ok=True)


def places(tree: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """All parts of a tree, by key."""
    parts = tree.items() if isinstance(tree, dict) else enumerate(tree)
    found = [place] if place else []
    for key, part in parts:
        if isinstance(part, dict | list):
            found += places(part, (*place, key))
        else:
            found.append((*place, key))
    return found


def signed(tree: Any) -> Any:
    """The same state with a digest that matches its content."""
    content = {name: part for name, part in tree.items() if name != "digest"}
    return {**content, "digest": _content(content)} if "digest" in tree else content


def memory(estimation: Estimation) -> Any:
    """Everything that a state file can change."""
    interpolation = {name: _plain(value) for name, value in vars(estimation.interpolation).items()}
    return json.dumps(
        [_plain(estimation.state), _plain(estimation.report), _plain(estimation.timestamps.grid),
         estimation.timestamps.begun, estimation.gaps.last, interpolation]
    )  # fmt: skip


def read(tree: Any, name: str, folder: Path) -> Estimation | None:
    """The estimation resumed from a state; None if it is refused as required."""
    path, estimation = folder / "s.json", fresh_again(name)
    text = json.dumps(tree)
    path.write_text(text)
    before = memory(estimation)
    said = ""
    try:
        load_state(path, estimation, "d")
    except InputError as error:
        said = str(error)
    assert path.read_text() == text
    if not said:
        return estimation
    assert said.startswith(str(path))
    assert "\n" not in said
    assert memory(estimation) == before
    return None


@cache
def _made(name: str) -> Estimation:
    return fresh(name)


def fresh_again(name: str) -> Estimation:
    """An estimation as made by `fresh`, but faster."""
    made = copy.copy(_made(name))
    for part in ("report", "timestamps", "gaps", "interpolation"):
        setattr(made, part, copy.deepcopy(getattr(made, part)))
    made.timestamps.report = made.gaps.report = made.report
    return made


@pytest.mark.parametrize("name", NAMES)
def test_state_file_resumes_in_any_formatting(name: str, tmp_path: Path) -> None:
    tree = json.loads(saved(name))
    found = read(dict(sorted(tree.items())), name, tmp_path)
    assert found is not None
    save_state(tmp_path / "again.json", found, "d", 1234)
    assert json.loads((tmp_path / "again.json").read_text()) == tree


REPLACED = st.sampled_from(
    [None, True, False, 0, -1, 3, 2**53, 0.5, -2.5, 1e300, "", "x", "1_000", "\uff11", "nan", [],
     [1.0], {}, {"float": "nan"}, {"float": "\uff11"}, {"float": 1},
     {"shape": [1], "values": [True]}]
)  # fmt: skip


@given(data=st.data())
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_mutated_state_is_refused_or_equivalent(data: Any, tmp_path: Path) -> None:
    """A part removed, replaced or renamed; with the old digest or a matching one."""
    name = data.draw(st.sampled_from(NAMES))
    tree = json.loads(saved(name))
    before = copy.deepcopy(tree)
    place = data.draw(st.sampled_from(places(tree)))
    parent = tree
    for key in place[:-1]:
        parent = parent[key]
    change = data.draw(st.sampled_from(["remove", "replace", "rename"]))
    if change == "remove":
        del parent[place[-1]]
    elif change == "replace" or isinstance(parent, list):
        parent[place[-1]] = data.draw(REPLACED)
    else:
        parent[f"{place[-1]}s"] = parent.pop(place[-1])
    resigned = data.draw(st.booleans()) and place != ("digest",)
    found = read(signed(tree) if resigned else tree, name, tmp_path)
    if found is not None and not resigned:
        assert tree == before
    if found is not None:  # what is accepted equals what was written
        save_state(tmp_path / "again.json", found, "d", tree["offset"])
        again = json.loads((tmp_path / "again.json").read_text())
        assert {**again, "digest": ""} == {**tree, "digest": ""}
        rows = RowByRow(found, list(simulated(name).record()))
        with contextlib.suppress(ReobserveError):  # no other exception for any content
            rows.read(",".join(["250", *["0"] * (rows.rows.width - 1)]))
            rows.finish()
        as_json(found.report, {})
        as_table(found.report, 0.01)


DAMAGED: list[tuple[str, Any, str]] = [
    ("schema", 1, "schema: 1 must be 9"),
    ("offset", True, "offset: True must be a whole number"),
    ("offset", -1, "offset: -1 must not be negative"),
    ("specification", "e", "specification: is another one than that of this stream, or a file"),
    ("observer", None, "observer: is missing, though rows were estimated"),
    ("observer.count", "1_000", "observer.count: '1_000' must be a whole number"),
    (
        "observer.posterior.mean.values.0",
        True,
        "observer.posterior.mean.values.0: True is not a number",
    ),
    (
        "observer.posterior.mean.values.0",
        {"float": "\uff11"},
        "observer.posterior.mean.values.0: {'float'",
    ),
    (
        "observer.posterior.covariance.values.1",
        0.5,
        "observer.posterior.covariance: must be symmetric",
    ),
    (
        "observer.posterior.covariance.values.0",
        -1.0,
        "observer.posterior.covariance: must be positive s",
    ),
    ("timestamps.grid", [1.0, 0.5], "timestamps.grid: [1.0, 0.5] must be rising"),
    ("interpolation.kept", None, "interpolation.kept: must have 2 rows of 3 numbers"),
    ("report.alarms", {}, "report.alarms: must be those of the specification: ['odd']"),
    ("report.alarms.odd.rows", None, "report.alarms.odd.rows: None must be a whole number"),
    ("report.alarms.odd.unit", "..", "report.alarms.odd.unit: is missing"),
    ("report.alarms.odd.rows", "..", "report.alarms.odd.rows: is missing"),
    ("digest", "0", "digest: is not that of the content, which was damaged or edited"),
]


@pytest.mark.parametrize(("key", "value", "said"), DAMAGED)
def test_message_names_file_and_key(key: str, value: Any, said: str, tmp_path: Path) -> None:
    """With a matching digest; otherwise only the digest would be reported."""
    tree = json.loads(saved("kalman"))
    *path, last = key.split(".")
    parent = tree
    for step in path:
        parent = parent[int(step) if step.isdigit() else step]
    if value == "..":
        del parent[last]
    else:
        parent[int(last) if last.isdigit() else last] = value
    text = tmp_path / "s.json"
    text.write_text(json.dumps(tree if key == "digest" else signed(tree)))
    with pytest.raises(InputError) as error:
        load_state(text, fresh("kalman"), "d")
    place, _, problem = said.partition(": ")
    assert str(error.value).startswith(f"{text}: {place}: ")
    assert problem in str(error.value)

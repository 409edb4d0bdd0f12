"""A state file resumes an estimation; a mutated one is refused and nothing of it is used."""

from __future__ import annotations

import copy
import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.examples import simulated
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.state_file import (
    _content,
    _decoded,
    _plain,
    load_state,
    save_state,
)
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
def test_mutated_state_is_refused(data: Any, tmp_path: Path) -> None:
    """A part removed, replaced or renamed."""
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
    changed = json.dumps(tree, sort_keys=True) != json.dumps(before, sort_keys=True)
    assert (read(tree, name, tmp_path) is None) == changed


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("schema", 10, "schema: 10 must be 11: another version wrote it; remove the file to rest"),
        ("specification", "e", "specification: is another one than that of this stream, or a file"),
        ("digest", "0", "digest: is not that of the content, which was damaged or edited"),
    ],
)
def test_file_of_another_stream_or_version_is_refused(
    key: str, value: Any, said: str, tmp_path: Path
) -> None:
    """With a digest that matches the content, unless that is what is changed."""
    tree = json.loads(saved("kalman")) | {key: value}
    if key != "digest":
        del tree["digest"]
        tree["digest"] = _content(tree)
    text = tmp_path / "s.json"
    text.write_text(json.dumps(tree))
    with pytest.raises(InputError) as error:
        load_state(text, fresh("kalman"), "d")
    assert str(error.value).startswith(f"{text}: {said}")


@pytest.mark.parametrize("content", ["[]", "3", "{}", "null"])
def test_what_is_no_state_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "s.json").write_text(content)
    with pytest.raises(InputError, match="digest: is not that of the content"):
        load_state(tmp_path / "s.json", fresh("kalman"), "d")


@pytest.mark.parametrize("name", ["float", "shape", "values", "odd"])
@pytest.mark.parametrize("value", [3, -2.5, float("inf"), None, True, [1.0], {"rows": 2}])
def test_values_come_back_under_any_name(name: str, value: Any) -> None:
    """Names are those of users: of an alarm, say."""
    alarms = {name: {"rows": value}}
    assert _decoded(json.loads(json.dumps(_plain(alarms)))) == alarms

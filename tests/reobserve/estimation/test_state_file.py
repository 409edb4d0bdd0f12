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
from reobserve.estimation import state_file
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.examples import simulated, specification_text
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.state_file import (
    _content,
    _decoded,
    _plain,
    identity,
    load_state,
    save_state,
)
from tests.reobserve.bad_input.odd import damaged
from tests.reobserve.estimation.records import specification

NAMES = ("kalman", "extended-kalman", "imm-kalman", "ilo-sampled", "extended-high-gain")
OTHERS = [b"", b"[]", b"3", b"{}", b"null", b"t,y\n0,1\n", specification_text("kalman").encode()]


@cache
def fresh_once(name: str) -> Estimation:
    return Estimation(specification(name), list(simulated(name).record()), "r")


def fresh(name: str) -> Estimation:
    """An estimation that was compiled before."""
    made = copy.copy(fresh_once(name))
    for part in ("report", "timestamps", "gaps", "interpolation"):
        setattr(made, part, copy.deepcopy(getattr(made, part)))
    made.timestamps.report = made.gaps.report = made.report
    return made


@cache
def saved(name: str, folder: Path) -> bytes:
    """A state after 25 rows of an example, the last with an empty cell."""
    estimation, columns = fresh(name), simulated(name).record()
    rows = RowByRow(estimation, list(columns))
    for k in range(25):
        cells = [repr(float(values[k])) for values in columns.values()]
        rows.read(",".join([*cells[:1], "", *cells[2:]] if k == 24 else cells))
    rows.settle()
    save_state(folder / "saved.json", estimation, "d", 1234)
    return (folder / "saved.json").read_bytes()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("states")


def places(tree: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """All parts of a tree, by key."""
    found = [place] if place else []
    for key, part in tree.items() if isinstance(tree, dict) else enumerate(tree):
        inner = isinstance(part, dict | list)
        found += places(part, (*place, key)) if inner else [(*place, key)]
    return found


def memory(estimation: Estimation) -> Any:
    """Everything that a state file can change."""
    parts = (estimation.timestamps, estimation.gaps, estimation.interpolation, estimation.report)
    tree = [{key: _plain(value) for key, value in vars(part).items()} for part in parts]
    return json.dumps([_plain(estimation.state), tree], default=lambda _: "")


def read(content: bytes, name: str, folder: Path) -> Estimation | None:
    """The estimation resumed from a state; None if it is refused as required."""
    path, estimation = folder / "s.json", fresh(name)
    path.write_bytes(content)
    before, said = memory(estimation), ""
    try:
        load_state(path, estimation, "d")
    except InputError as error:
        said = str(error)
    assert path.read_bytes() == content
    if not said:
        return estimation
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    assert memory(estimation) == before
    return None


@pytest.mark.parametrize("name", NAMES)
def test_state_file_resumes_in_any_formatting(name: str, folder: Path) -> None:
    tree = json.loads(saved(name, folder))
    found = read(json.dumps(dict(sorted(tree.items())), indent=2).encode(), name, folder)
    assert found is not None
    save_state(folder / "again.json", found, "d", 1234)
    assert (folder / "again.json").read_bytes() == saved(name, folder)


REPLACED = st.sampled_from(
    [None, True, False, 0, -1, 3, 2**53, 0.5, -2.5, 1e300, "", "x", "1_000", "\uff11", "nan", [],
     [1.0], {}, {"float": "nan"}, {"float": "\uff11"}, {"float": 1},
     {"shape": [1], "values": [True]}]
)  # fmt: skip


@st.composite
def mutated(draw: st.DrawFn, content: bytes) -> bytes:
    """Another file, some bytes changed, a truncated one, or a part removed, replaced or renamed."""
    change = draw(st.sampled_from(["other", "byte", "bytes", "cut", "remove", "replace", "rename"]))
    if change == "other":
        return draw(st.sampled_from(OTHERS))
    if change == "bytes":
        return draw(damaged(content))
    at = draw(st.integers(0, len(content) - 1))
    if change == "cut":
        return content[:at]
    if change == "byte":
        return content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]
    tree = json.loads(content)
    *above, last = draw(st.sampled_from(places(tree)))
    parent = tree
    for key in above:
        parent = parent[key]
    if change == "remove":
        del parent[last]
    elif change == "replace" or isinstance(parent, list):
        parent[last] = draw(REPLACED)
    else:
        parent[f"{last}s"] = parent.pop(last)
    return json.dumps(tree).encode()


@given(data=st.data())
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_mutated_state_is_refused_or_the_same(data: Any, folder: Path) -> None:
    name = data.draw(st.sampled_from(NAMES))
    found = read(data.draw(mutated(saved(name, folder))), name, folder)
    if found is not None:
        same = read(saved(name, folder), name, folder)
        assert same is not None
        assert memory(found) == memory(same)


def sealed(tree: dict[str, Any]) -> bytes:
    """A tree with the digest of its content."""
    rest = {key: part for key, part in tree.items() if key != "digest"}
    return json.dumps({**rest, "digest": _content(rest)}).encode()


@pytest.mark.parametrize("name", NAMES)
def test_arrays_of_another_size_never_reach_a_loop(name: str, folder: Path) -> None:
    """Anyone can write a digest that holds."""
    tree = json.loads(saved(name, folder))
    arrays = [place[:-1] for place in places(tree["observer"]) if place[-1] == "values"]
    assert arrays
    for place in arrays:
        other = copy.deepcopy(tree)
        part = other["observer"]
        for key in place:
            part = part[key]
        part |= {"shape": [1, 1, 1], "values": [0.5]}
        assert read(sealed(other), name, folder) is None


def test_another_specification_file_or_version_is_another_stream(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec, design = folder / "s.yaml", folder / "d.json"
    spec.write_text("a"), design.write_text("b")
    first = identity(spec, [design])
    assert first == identity(spec, [design])
    spec.write_text("c")
    found = {first, identity(spec, [design]), identity(spec, [])}
    design.write_text("d")
    found.add(identity(spec, [design]))
    monkeypatch.setattr(state_file, "_SCHEMA", 0)
    found.add(identity(spec, [design]))
    assert len(found) == 5
    (folder / "e.json").write_bytes(sealed(json.loads(saved("kalman", folder))))
    with pytest.raises(InputError, match="specification: is another one than that of this stream"):
        load_state(folder / "e.json", fresh("kalman"), "e")


@pytest.mark.parametrize("name", ["float", "shape", "values", "odd"])
@pytest.mark.parametrize("value", [3, -2.5, float("inf"), None, True, [1.0], {"rows": 2}])
def test_values_come_back_under_any_name(name: str, value: Any) -> None:
    """Names are those of users: of an alarm, say."""
    alarms = {name: {"rows": value}}
    assert _decoded(json.loads(json.dumps(_plain(alarms)))) == alarms

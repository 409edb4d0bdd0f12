"""State files: all that estimation remembers between two rows, so that a stream can resume.

A file is checked whole before an estimation takes anything from it: its keys and types, shapes and
covariances of the observer's state, and the digest of its content.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from reobserve.core.covariances import as_covariance
from reobserve.core.documents import parse_json
from reobserve.core.errors import InputError, located, shown
from reobserve.core.files import read_text, write_text
from reobserve.core.validation import items, join, parse, within
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimation

Array = NDArray[np.float64]

SCHEMA = 9
_VALUES = 5_000_000
_NOT_FINITE = ("nan", "inf", "-inf")  # written as {"float": "nan"}, since JSON has none of them


@dataclass
class _Timestamps:
    begun: list[float]
    grid: Annotated[list[float], items(2, 2)]
    held_time: list[float]
    held_values: list[list[float]]
    early_time: list[float]
    early_values: list[list[float]]


@dataclass
class _Gaps:
    last: float | None
    started: bool
    in_gap: bool


@dataclass
class _Interpolation:
    time: list[float]
    values: list[list[float]] | None
    asked: list[float]
    kept: list[list[float]] | None


@dataclass
class _State:
    """A state file. ``offset`` is the byte up to which a file was read, ``line`` the last line."""

    format: Literal["reobserve estimate state"]
    schema: Literal[9]
    specification: str
    offset: Annotated[int, within(0, 2**53)] | None
    line: str  # its digest
    observer: Any
    timestamps: _Timestamps
    gaps: _Gaps
    interpolation: _Interpolation
    report: DataReport
    digest: str


def save_state(
    path: Path, estimation: Estimation, digest: str, offset: int | None, line: str = ""
) -> None:
    """Write what is needed to go on. ``offset`` is the byte up to which a file was read.

    ``line`` is the last line before it.
    """
    gaps, values, clock = estimation.gaps, estimation.interpolation, estimation.timestamps
    tree = {
        "format": "reobserve estimate state",
        "schema": SCHEMA,
        "specification": digest,
        "offset": offset,
        "line": digest_of(line) if line else "",
        "observer": _plain(estimation.state),
        "timestamps": _plain(
            _Timestamps(
                clock.begun,
                *(
                    part.tolist()
                    for part in (
                        clock.grid,
                        clock.held_time,
                        clock.held_values,
                        clock.early_time,
                        clock.early_values,
                    )
                ),
            )
        ),
        "gaps": _plain(_Gaps(gaps.last, gaps.started, gaps.in_gap)),
        "interpolation": {
            name: _plain(getattr(values, name).tolist())
            for name in ("time", "values", "asked", "kept")
        },
        "report": _plain(estimation.report),
    }
    write_text(path, json.dumps({**tree, "digest": _content(tree)}) + "\n")


def load_state(path: Path, estimation: Estimation, digest: str) -> tuple[int | None, str]:
    """Put an estimation where it was when its state was saved.

    Returns
    -------
    tuple
        The offset that was saved, and the digest of the line before it.
    """
    tree = parse_json(read_text(path), str(path), _VALUES)
    try:
        return _load(tree, estimation, digest)
    except InputError as error:
        place = f"{path}: {error.parameter}" if error.parameter else str(path)
        raise error.renamed(place) from None


def _load(tree: Any, estimation: Estimation, digest: str) -> tuple[int | None, str]:
    given = _decoded(tree, "")
    saved = parse(_State, given, finite=False)
    if saved.specification != digest:
        raise InputError(
            "specification",
            "is another one than that of this stream, or a file that it names has changed; remove "
            "the file to restart",
        )
    _check_keys(given, asdict(saved), "")
    begun, grid = saved.timestamps.begun, np.array(saved.timestamps.grid)
    if not np.isfinite(begun).all():
        raise InputError("timestamps.begun", "must be finite")
    if not (np.isnan(grid).all() or (np.isfinite(grid).all() and grid[0] <= grid[1])):
        raise InputError("timestamps.grid", f"{shown(saved.timestamps.grid)} must be rising")
    alarms = estimation.report.alarms
    if saved.report.alarms.keys() != alarms.keys():
        raise InputError("report.alarms", f"must be those of the specification: {list(alarms)}")
    width, rows = len(estimation.interpolation.held), saved.timestamps
    held = _rows("held", rows.held_time, rows.held_values, width)
    if len(set(rows.held_time)) > 1:
        raise InputError("timestamps.held_time", "must be finite, and one time")
    early = _rows("early", rows.early_time, rows.early_values, width)
    arrays = _interpolation(saved.interpolation, len(estimation.interpolation.held))
    state = None
    if given["observer"] is not None:
        state = _like(estimation.template, given["observer"], "observer")
        with located("observer"):
            estimation.observer._checked(state)
    elif saved.gaps.started:
        raise InputError("observer", "is missing, though rows were estimated")
    if saved.gaps.started and saved.gaps.last is None:
        raise InputError("gaps.last", "is missing, though rows were estimated")
    if saved.digest != _content({name: part for name, part in tree.items() if name != "digest"}):
        raise InputError("digest", "is not that of the content, which was damaged or edited")
    estimation.state = state
    estimation.timestamps.begun[:], estimation.timestamps.grid[:] = begun, grid
    estimation.timestamps.held_time, estimation.timestamps.held_values = held
    estimation.timestamps.early_time, estimation.timestamps.early_values = early
    vars(estimation.gaps).update(vars(saved.gaps))
    vars(estimation.interpolation).update(arrays)
    vars(estimation.report).update(vars(saved.report))
    return saved.offset, saved.line


def _rows(
    name: str, times: list[float], rows: list[list[float]], columns: int
) -> tuple[Array, Array]:
    """Rows that wait for others, and their times."""
    time = np.array(times, dtype=np.float64)
    if not np.isfinite(time).all():
        one = ", and one time" if name == "held" else ""
        raise InputError(f"timestamps.{name}_time", f"must be finite{one}")
    if len(rows) != len(time) or any(len(row) != columns for row in rows):
        problem = f"must have {len(time)} rows of {columns} numbers"
        raise InputError(f"timestamps.{name}_values", problem)
    values = np.array(rows, dtype=np.float64).reshape(len(time), columns)
    if np.isinf(values).any():
        raise InputError(f"timestamps.{name}_values", "must not be infinite")
    return time, values


def identity(specification: Path, files: Iterable[Path]) -> str:
    """The content of a specification, and of the files it names, which tells it from others."""
    named = [digest_of(read_text(path)) for path in files]
    return digest_of("".join([read_text(specification), *named]))


def digest_of(text: str) -> str:
    """The digest of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def _content(tree: Any) -> str:
    return digest_of(json.dumps(tree, sort_keys=True))


def _plain(value: Any) -> Any:
    """A value as JSON can hold it."""
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "values": _plain(value.ravel().tolist())}
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": str(value)}
    return value


def _decoded(saved: Any, place: str) -> Any:
    """The same with numbers that are not finite."""
    if isinstance(saved, dict):
        if saved.keys() == {"float"}:
            if saved["float"] not in _NOT_FINITE:
                raise InputError(place, f"{shown(saved)} must be one of {', '.join(_NOT_FINITE)}")
            return float(saved["float"])
        return {name: _decoded(part, join(place, name or "''")) for name, part in saved.items()}
    if isinstance(saved, list):
        return [_decoded(part, join(place, str(k))) for k, part in enumerate(saved)]
    return saved


def _check_keys(given: Any, whole: Any, place: str) -> None:
    """Refuse what lacks a key that has a default elsewhere."""
    if isinstance(whole, dict):
        for name, part in whole.items():
            if name not in given:
                raise InputError(join(place, name), "is missing")
            if name != "observer":
                _check_keys(given[name], part, join(place, name))
    elif isinstance(whole, list):
        for k, (one, part) in enumerate(zip(given, whole, strict=True)):
            _check_keys(one, part, join(place, str(k)))


def _like(template: Any, saved: Any, place: str) -> Any:
    """A value of the types and shapes that a template has, of which a state is made."""
    if is_dataclass(template) and not isinstance(template, type):
        names = [each.name for each in fields(template)]
        if not isinstance(saved, dict) or set(saved) != set(names):
            raise InputError(place, f"{shown(saved)} must have the keys {', '.join(names)}")
        parts = {
            name: _like(getattr(template, name), saved[name], join(place, name)) for name in names
        }
        return type(template)(**parts)
    if isinstance(template, tuple):
        if not isinstance(saved, list) or len(saved) != len(template):
            raise InputError(place, f"{shown(saved)} must be a list of {len(template)} parts")
        pairs = enumerate(zip(template, saved, strict=True))
        return tuple(_like(one, part, join(place, str(k))) for k, (one, part) in pairs)
    if isinstance(template, np.ndarray):
        return _array(template, saved, place)
    if template is None and saved is not None:
        raise InputError(place, f"{shown(saved)} must be null")
    kind = float if isinstance(template, np.floating) else type(template)
    return parse(kind, saved, place, finite=False) if template is not None else None


def _array(template: Array, saved: Any, place: str) -> Array:
    shape, whole = list(template.shape), isinstance(saved, dict)
    if not whole or saved.keys() != {"shape", "values"} or saved["shape"] != shape:
        raise InputError(place, f"{shown(saved)} must be numbers of the shape {shape}")
    numbers = parse(list[float], saved["values"], join(place, "values"), finite=False)
    if len(numbers) != template.size:
        problem = f"has {len(numbers)} numbers, must have {template.size}"
        raise InputError(join(place, "values"), problem)
    found = np.array(numbers, dtype=np.float64).reshape(template.shape)
    square = len(shape) >= 2 and shape[-1] == shape[-2] > 0
    if place.rpartition(".")[2].startswith("covariance") and square:
        for part in found.reshape(-1, *shape[-2:]):
            as_covariance(place, part, shape[-1])
    return found


def _interpolation(saved: _Interpolation, columns: int) -> dict[str, Any]:
    """The samples that values between them may still need, and the times at which these wait."""
    found: dict[str, Any] = {
        name: np.array(getattr(saved, name), dtype=np.float64) for name in ("time", "asked")
    }
    for name, times in found.items():
        if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
            raise InputError(f"interpolation.{name}", "must be finite and rising")
    for name, rows in (("values", len(saved.time)), ("kept", 2)):
        table = getattr(saved, name)
        if table is None and saved.values is None and saved.kept is None and not saved.time:
            continue  # before the first row
        if table is None or len(table) != rows or any(len(row) != columns for row in table):
            problem = f"must have {rows} rows of {columns} numbers"
            raise InputError(f"interpolation.{name}", problem)
        found[name] = np.array(table, dtype=np.float64).reshape(rows, columns)
        if np.isinf(found[name]).any():
            raise InputError(f"interpolation.{name}", "must not be infinite")
    return found

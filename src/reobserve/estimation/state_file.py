"""All that estimation remembers between two rows, as a file of plain values."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from reobserve.core.documents import parse_json
from reobserve.core.errors import InputError
from reobserve.core.files import read_text, write_text
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimation

FORMAT = "reobserve estimate state"
SCHEMA = 2
_VALUES = 5_000_000

# What changes from row to row; the rest of these is the specification's.
_ALARM = ("origin", "learned", "mean", "squares", "ready")
_GAPS = ("last", "started", "in_gap")
_INTERPOLATION = ("time", "values", "asked", "kept")


def save_state(path: Path, estimation: Estimation, digest: str, offset: int | None) -> None:
    """Write what is needed to go on; ``offset`` is the byte up to which a file was read.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    tree = {
        "format": FORMAT,
        "schema": SCHEMA,
        "specification": digest,
        "offset": offset,
        "observer": _plain(estimation.state),
        "begun": estimation.timestamps.begun,
        "grid": _plain(estimation.timestamps.grid),
        "report": _plain(estimation.report),
        "alarms": [_parts(alarm, _ALARM) for alarm in estimation.alarms],
        "gaps": _parts(estimation.gaps, _GAPS),
        "interpolation": _parts(estimation.interpolation, _INTERPOLATION),
    }
    write_text(path, json.dumps(tree) + "\n")


def load_state(path: Path, estimation: Estimation, digest: str) -> int | None:
    """Put an estimation where it was when its state was saved; the offset that was saved.

    Raises
    ------
    InputError
        If the file is none of this specification, or damaged.
    """
    tree = parse_json(read_text(path), str(path), _VALUES)
    if not isinstance(tree, dict) or (tree.get("format"), tree.get("schema")) != (FORMAT, SCHEMA):
        raise InputError(str(path), f"is no state of schema {SCHEMA}")
    if tree.get("specification") != digest:
        raise InputError(
            str(path), "is the state of another specification; remove it to start anew"
        )
    try:
        state = tree["observer"]
        estimation.state = None if state is None else _like(estimation.template, state)
        if estimation.state is not None:
            estimation.observer._checked(estimation.state)
        estimation.timestamps.begun[:] = parse(list[float], tree["begun"], "begun")
        estimation.timestamps.grid[:] = _value(tree["grid"])
        for alarm, saved in zip(estimation.alarms, tree["alarms"], strict=True):
            _fill(alarm, _ALARM, saved)
        _fill(estimation.gaps, _GAPS, tree["gaps"])
        report = parse(DataReport, _value(tree["report"]), "report")
        vars(estimation.report).update(vars(report))
        _interpolation(estimation, tree["interpolation"])
        if estimation.gaps.started and estimation.state is None:
            raise TypeError
        offset = tree["offset"]
        if offset is not None and (isinstance(offset, bool) or not isinstance(offset, int)):
            raise TypeError
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        if isinstance(error, InputError):
            raise InputError(str(path), str(error)) from None
        raise InputError(
            str(path), "is damaged: it lacks a part, or has another in its place"
        ) from None
    found: int | None = offset
    return found


def digest_of(text: str) -> str:
    """What tells one specification from another."""
    return hashlib.sha256(text.encode()).hexdigest()


def _parts(value: Any, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: _plain(getattr(value, name)) for name in names}


def _plain(value: Any) -> Any:
    """A value as JSON can hold it."""
    if is_dataclass(value) and not isinstance(value, type):
        return _parts(value, tuple(each.name for each in fields(value)))
    if isinstance(value, np.ndarray):
        return {
            "shape": list(value.shape),
            "values": [_plain(one) for one in value.ravel().tolist()],
        }
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": str(value)}
    return value


def _value(saved: Any) -> Any:
    """What `_plain` was given, of plain types and arrays."""
    if isinstance(saved, dict):
        if saved.keys() == {"float"}:
            return float(saved["float"])
        if saved.keys() == {"shape", "values"}:
            numbers = [float(_value(one)) for one in saved["values"]]
            return np.array(numbers, dtype=np.float64).reshape(saved["shape"])
        return {name: _value(part) for name, part in saved.items()}
    if isinstance(saved, list):
        return [_value(part) for part in saved]
    return saved


def _like(template: Any, saved: Any) -> Any:
    """A value of the types that a template has; a state is made of such."""
    if is_dataclass(template) and not isinstance(template, type):
        parts = {
            each.name: _like(getattr(template, each.name), saved[each.name])
            for each in fields(template)
        }
        return type(template)(**parts)
    if isinstance(template, tuple):
        return tuple(_like(one, part) for one, part in zip(template, saved, strict=True))
    return _value(saved)


def _fill(target: Any, names: tuple[str, ...], saved: Any) -> None:
    """Set fields that were saved, each of its type."""
    hints = get_type_hints(type(target))
    for name in names:
        setattr(target, name, parse(hints[name], _value(saved[name]), name))


def _interpolation(estimation: Estimation, saved: Any) -> None:
    """The samples that values between them may still need, and the times at which these wait."""
    found = {name: _value(saved[name]) for name in _INTERPOLATION}
    columns = len(estimation.interpolation.held)
    rows = len(found["time"])
    wanted: dict[str, tuple[int, ...]] = {"time": (rows,), "asked": (len(found["asked"]),)}
    if found["values"] is not None or found["kept"] is not None or rows:
        wanted |= {"values": (rows, columns), "kept": (2, columns)}
    for name, shape in wanted.items():
        if not isinstance(found[name], np.ndarray) or found[name].shape != shape:
            raise TypeError
    for name in ("time", "asked"):
        if not (np.isfinite(found[name]).all() and (np.diff(found[name]) > 0).all()):
            raise ValueError
    vars(estimation.interpolation).update(found)

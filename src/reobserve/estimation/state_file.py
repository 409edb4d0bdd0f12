"""State files: all that estimation remembers between two rows, so that a stream can resume.

A file has the digest of its content: one that was damaged or edited is refused, and nothing of it
is used. It says nothing of who wrote it, so the observer checks its own state.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.documents import parse_json
from reobserve.core.errors import InputError
from reobserve.core.files import read_text, write_text
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimation

_SCHEMA = 12  # of state files
_VALUES = 5_000_000
_OF_CLOCK = ("grid", "held_time", "held_values", "early_time", "early_values")
_OF_GAPS = ("last", "started", "in_gap")
_OF_INTERPOLATION = ("time", "values", "asked", "kept")


def save_state(
    path: Path, estimation: Estimation, digest: str, offset: int | None, line: str = ""
) -> None:
    """Write what is needed to go on. ``offset`` is the byte up to which a file was read.

    ``line`` is the last line before it.
    """
    gaps, values, clock = estimation.gaps, estimation.interpolation, estimation.timestamps
    tree = {
        "format": "reobserve estimate state",
        "specification": digest,
        "offset": offset,
        "line": digest_of(line) if line else "",
        "observer": _plain(estimation.state),
        "timestamps": {"begun": _plain(clock.begun)}
        | {name: _plain(getattr(clock, name)) for name in _OF_CLOCK},
        "gaps": {name: _plain(getattr(gaps, name)) for name in _OF_GAPS},
        "interpolation": {name: _plain(getattr(values, name)) for name in _OF_INTERPOLATION},
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
    whole = dict(tree) if isinstance(tree, dict) else {}
    if whole.pop("digest", None) != _content(whole):
        raise InputError("digest", "is not that of the content, which was damaged or edited")
    saved = _decoded(whole)
    if saved.get("specification") != digest:
        raise InputError(
            "specification",
            "is another one than that of this stream, a file that it names has changed, or another "
            "version wrote this; remove the file to restart",
        )
    clock, state = estimation.timestamps, _like(estimation.template, saved["observer"])
    estimation.state = None if state is None else estimation.observer._checked(state)
    clock.begun[:] = saved["timestamps"]["begun"]
    for name in _OF_CLOCK:
        setattr(clock, name, saved["timestamps"][name])
    vars(estimation.gaps).update(saved["gaps"])
    vars(estimation.interpolation).update(saved["interpolation"])
    vars(estimation.report).update(vars(parse(DataReport, saved["report"], finite=False)))
    return saved["offset"], saved["line"]


def identity(specification: Path, files: Iterable[Path]) -> str:
    """The content of a specification and of the files it names, and the form of state files."""
    digests = [digest_of(read_text(path)) for path in files]
    return digest_of("".join([str(_SCHEMA), read_text(specification), *digests]))


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
        return {"float": str(value)}  # JSON has none of them
    return value


def _decoded(saved: Any) -> Any:
    """The values that `_plain` wrote."""
    if isinstance(saved, dict):
        if saved.keys() == {"float"} and isinstance(saved["float"], str):
            return float(saved["float"])
        if saved.keys() == {"shape", "values"} and isinstance(saved["shape"], list):
            return np.array(_decoded(saved["values"]), dtype=np.float64).reshape(saved["shape"])
        return {name: _decoded(part) for name, part in saved.items()}
    return [_decoded(part) for part in saved] if isinstance(saved, list) else saved


def _like(template: Any, saved: Any) -> Any:
    """A state of the types that a template has, from its values."""
    if saved is None:
        return None
    if is_dataclass(template) and not isinstance(template, type):
        names = [each.name for each in fields(template)]
        return type(template)(
            **{name: _like(getattr(template, name), saved[name]) for name in names}
        )
    return tuple(map(_like, template, saved)) if isinstance(template, tuple) else saved

"""State files: all that estimation remembers between two rows, so that a stream can resume.

A file has the digest of its content: one that was damaged or edited is refused, and nothing of it
is used. It says nothing of who wrote it, so the observer checks its own state.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from reobserve.core.documents import parse_json
from reobserve.core.errors import InputError, located, shown
from reobserve.core.files import read_text, write_text
from reobserve.core.matrices import as_numbers
from reobserve.core.validation import parse, within
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimation

_SCHEMA = 12  # of state files
_VALUES = 5_000_000
_Size = Annotated[int, within(0, 2**63 - 1)]
_KEYS = (
    "format", "specification", "offset", "line", "observer", "timestamps", "gaps",
    "interpolation", "report",
)  # fmt: skip
_OF_CLOCK = ("begun", "grid", "held_time", "held_values", "early_time", "early_values")
_OF_GAPS = ("last", "started", "in_gap")
_OF_INTERPOLATION = ("time", "values", "asked", "kept")


def save_state(
    path: Path, estimation: Estimation, digest: str, offset: int | None, line: str = ""
) -> None:
    """Write what is needed to go on. ``offset`` is the byte up to which a file was read.

    ``line`` is the last line before it.
    """
    tree = {
        "format": "reobserve estimate state",
        "specification": digest,
        "offset": offset,
        "line": digest_of(line) if line else "",
        "observer": _plain(estimation.state),
        **{
            part: {name: _plain(getattr(owner, name)) for name in names}
            for part, (owner, names) in _parts(estimation).items()
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
    with located(str(path), ": "):
        return _load(tree, estimation, digest)


def _load(tree: Any, estimation: Estimation, digest: str) -> tuple[int | None, str]:
    whole = dict(tree) if isinstance(tree, dict) else {}
    if whole.pop("digest", None) != _content(whole):
        raise InputError("digest", "is not that of the content, which was damaged or edited")
    if whole.get("specification") != digest:
        raise InputError(
            "specification",
            "is another one than that of this stream, a file that it names has changed, or another "
            "version wrote this; remove the file to restart",
        )
    saved = _keyed(_decoded(whole), _KEYS, "")
    state = _like(estimation.template, saved["observer"], "observer")
    estimation.state = None if state is None else estimation.observer._checked(state)
    for part, (owner, names) in _parts(estimation).items():
        for name, value in _keyed(saved[part], names, part).items():
            setattr(owner, name, _alike(getattr(owner, name), value, f"{part}.{name}"))
    report = _keyed(saved["report"], list(vars(estimation.report)), "report")
    vars(estimation.report).update(vars(parse(DataReport, report, "report", finite=False)))
    offset = parse(_Size | None, saved["offset"], "offset")
    return offset, parse(str, saved["line"], "line")


def _parts(estimation: Estimation) -> dict[str, tuple[Any, tuple[str, ...]]]:
    """The objects that are saved in parts, and the names of their attributes."""
    return {
        "timestamps": (estimation.timestamps, _OF_CLOCK),
        "gaps": (estimation.gaps, _OF_GAPS),
        "interpolation": (estimation.interpolation, _OF_INTERPOLATION),
    }


def _keyed(saved: Any, names: Sequence[str], place: str) -> dict[str, Any]:
    """A part of a file, which must have these keys and no others."""
    if not isinstance(saved, dict) or saved.keys() != set(names):
        raise InputError(place, f"must have the keys {', '.join(names)}, and no others")
    return saved


def _alike(held: Any, value: Any, place: str) -> Any:
    """A value of the kind that an attribute has: an array, numbers, a number or None, a flag."""
    if isinstance(held, np.ndarray) and isinstance(value, np.ndarray):
        good = value.ndim == held.ndim
    elif isinstance(held, list):
        good = isinstance(value, list) and all(isinstance(one, float) for one in value)
    else:
        good = isinstance(value, type(held)) or (held is None and isinstance(value, float))
    if not good:
        raise InputError(place, f"{shown(value)} is not of the kind that is saved there")
    return value


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
        if saved.keys() == {"float"} and saved["float"] in ("nan", "inf", "-inf"):
            return float(saved["float"])
        if saved.keys() == {"shape", "values"}:
            values = as_numbers("values", _decoded(saved["values"]))
            sizes = parse(list[_Size], saved["shape"], "shape")
            if values.ndim != 1 or math.prod(sizes) != len(values):
                raise InputError("shape", f"{sizes} is not that of {values.size} values")
            return values.reshape(sizes)
        return {name: _decoded(part) for name, part in saved.items()}
    return [_decoded(part) for part in saved] if isinstance(saved, list) else saved


def _like(template: Any, saved: Any, place: str) -> Any:
    """A state of the types that a template has, from its values."""
    if saved is None:
        return None
    if is_dataclass(template) and not isinstance(template, type):
        saved = _keyed(saved, [each.name for each in fields(template)], place)
        return type(template)(
            **{name: _like(getattr(template, name), one, place) for name, one in saved.items()}
        )
    if isinstance(template, tuple) and isinstance(saved, list) and len(saved) == len(template):
        return tuple(_like(*pair, place) for pair in zip(template, saved, strict=True))
    return saved

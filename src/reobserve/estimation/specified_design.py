"""The design that a specification states, for `reobserve design` and `reobserve export`.

The observer and its sampling period are taken; columns and estimates name signals that the observer
does not name. What only concerns a record is left out, and listed.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError, located, nearest
from reobserve.estimation.families.observer_section import DesignFile
from reobserve.estimation.families.signals import NamedSignal, check_signals
from reobserve.estimation.layout import lay_out
from reobserve.estimation.observer_design import Design
from reobserve.estimation.specification import (
    SECTIONS,
    Columns,
    Constant,
    Specification,
    TimeColumn,
    as_specification,
)

_ANY_COLUMNS = {"measurements": [{"column": "y"}]}  # in place of those that are not stated
_LONGEST = 40  # letters of a name
_NUMBERED = re.compile(r"(measurement|input|rate|torque)(_\d+)?")
_FIELDS = {"rate": "states"}  # of a system, that names an estimate; of others its plural


@dataclass(frozen=True)
class SpecifiedDesign:
    """A design with names of its columns and estimates, and sentences on what is left out."""

    design: Design
    signals: tuple[Sequence[NamedSignal], Sequence[NamedSignal]]
    estimates: Mapping[str, Sequence[NamedSignal]] = field(default_factory=dict)
    readings: tuple[str, ...] = ()
    left_out: str = ""
    from_file: bool = False

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what the observer reads, and on what was left out."""
        return (*self.readings, *filter(None, [self.left_out]))


def is_specification(tree: Tree) -> bool:
    """True if a tree is one that `reobserve estimate` reads, or lacks only the columns for it."""
    return any(name in tree for name in ("kind", *SECTIONS))


def specified_design(
    tree: Tree, kind: str = "", changed: Mapping[str, Any] | None = None
) -> SpecifiedDesign:
    """The design of the observer in a specification, which may lack the columns.

    ``kind``, if it is given, must be that of the observer, of which keys are ``changed``.
    """
    chosen = _specification(tree, kind, changed or {})
    if chosen.smooth:
        problem = "true is for whole records, and a step takes no later row; here it must be false"
        raise InputError("smooth", problem)
    with located("observer" if "observer" in tree else ""):
        design = chosen.observer.design(chosen.sampling.period)
    for name in chosen.estimates:
        if name not in design.estimates:
            problem = f"there is no such estimate{nearest(name, design.estimates)}"
            raise InputError(f"estimates.{name}", problem)
    design = _renamed(design, chosen.estimates)
    labels, left = _labels(design, chosen), _left_out(tree)
    from_file = isinstance(chosen.observer, DesignFile)
    own = design.measurements, design.inputs
    if "columns" not in tree:
        return SpecifiedDesign(design, own, labels, (), left, from_file)
    columns = replace(chosen.columns, time=TimeColumn())
    titles = [column.column for column in columns.read]
    layout = lay_out(columns, design, titles, "the specification")
    given = [
        NamedSignal(name, unit)
        for name, unit in zip(map(_identifier, layout.names), layout.units, strict=True)
    ]
    parts = given[: layout.measurements], given[layout.measurements :]
    for k, entry in enumerate(columns.inputs):
        if isinstance(entry, Constant):
            name, unit = design.inputs[k] if k < len(design.inputs) else (f"input_{k + 1}", "")
            parts[1].insert(k, NamedSignal(name, unit or entry.unit))
    for key, signals in zip(("measurements", "inputs"), parts, strict=True):
        design = _carried(design, key, dict(signals), len(signals))
    own = design.measurements, design.inputs
    named = [
        mine if len(mine) == len(read) and not all(_NUMBERED.fullmatch(each.name) for each in mine)
        else read
        for mine, read in zip(own, parts, strict=True)
    ]  # fmt: skip
    readings = (*_readings(columns), *_constants(columns, parts[1]))
    return SpecifiedDesign(design, (named[0], named[1]), labels, readings, left, from_file)


def _specification(tree: Tree, kind: str, changed: Mapping[str, Any]) -> Specification:
    inner = tree.get("observer", tree)
    if isinstance(inner, Mapping):
        inner = {"kind": kind, **inner} if kind else dict(inner)
        if kind and inner["kind"] != kind:
            place = "observer.kind" if "observer" in tree else "kind"
            raise InputError(place, f"{inner['kind']!r} must be {kind}, as it was asked for")
        inner |= changed
        tree = {**tree, "observer": inner} if "observer" in tree else inner
    return as_specification({"columns": _ANY_COLUMNS, **tree})


def _identifier(name: str) -> str:
    """A name of letters, digits and _, without a unit at its end."""
    plain = unicodedata.normalize("NFKD", re.split(r"\s*[\[(]", name)[0] or name)
    word = re.sub(r"\W+", "_", plain.encode("ascii", "ignore").decode()).strip("_")[:_LONGEST]
    return word if word[:1].isalpha() else f"column_{word}"[:_LONGEST]


def _renamed(design: Design, names: Mapping[str, Mapping[str, str]]) -> Design:
    """The design with the names of estimates, where its system can have them."""
    for name, labels in names.items():
        signals = {_identifier(label): unit for label, unit in labels.items()}
        key = _FIELDS.get(name, f"{name}s")
        with suppress(InputError):
            design = _with(design, key, signals, len(labels))
    return design


def _carried(design: Design, key: str, signals: Mapping[str, str], count: int) -> Design:
    """The design with names of signals, unless they would rename an estimate."""
    with suppress(InputError):
        made = _with(design, key, signals, count)
        if _estimates(made) == _estimates(design):
            return made
    return design


def _with(design: Design, key: str, signals: Mapping[str, str], count: int) -> Design:
    """The design whose system has these signals, or `InputError` if it takes or has others."""
    if getattr(design.system, key, None) != {} or not signals or len(signals) != count:
        return design
    check_signals(key, signals)
    system = replace(design.system, **{key: dict(signals)})
    made = type(design)(system=system, gains=design.gains)
    _ = made.observer, made.start()
    return made


def _estimates(design: Design) -> list[tuple[str, list[str]]]:
    return [
        (name, [part.name for part in parts])
        for name, parts in design.estimates.items() if name not in design.left_out
    ]  # fmt: skip


def _labels(design: Design, chosen: Specification) -> dict[str, list[NamedSignal]]:
    """Names of estimates as the specification states them, in the units of the design."""
    signals = {}
    for name, labels in chosen.estimates.items():
        own = design.estimates[name]
        if len(labels) != len(own):
            problem = f"names {len(labels)} components, the observer estimates {len(own)}"
            raise InputError(f"estimates.{name}", problem)
        signals[name] = [
            NamedSignal(_identifier(label), part.unit or unit)
            for (label, unit), part in zip(labels.items(), own, strict=True)
        ]
    return signals


def _left_out(tree: Tree) -> str:
    left = [name for name in SECTIONS if name in tree and name not in ("observer", "sampling")]
    left += [f"sampling.{name}" for name in tree.get("sampling") or {} if name != "period"]
    return f"left out, as only records have them: {', '.join(left)}" if left else ""


def _readings(columns: Columns) -> Iterator[str]:
    """Sentences on what the observer reads in place of a column's own values."""
    for column in columns.read:
        name = _identifier(column.column)
        if column.offset:
            sign = "-" if column.offset > 0 else "+"
            value = f"{abs(column.offset):g} {column.unit}".rstrip()
            yield f"{name} is the deviation from the operating point, {name} {sign} {value}"
        if column.wrap is not None:
            yield f"{name} is an angle that goes on beyond a turn, without jumps"
        if column.range is not None and column.saturated == "missing":
            yield f"{name} is missing (nan) where the sensor is saturated"


def _constants(columns: Columns, signals: Sequence[NamedSignal]) -> Iterator[str]:
    for column, (name, _) in zip(columns.inputs, signals, strict=True):
        if isinstance(column, Constant):
            yield f"{name} is constant, {column.value:g} {column.unit}".rstrip()

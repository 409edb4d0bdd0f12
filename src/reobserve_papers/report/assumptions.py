"""The parameters for readers: values, ranges and reasons, equal ones of several keys in one row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from reobserve_papers.parameters.parameters import OVERRIDDEN, Parameters
from reobserve_papers.report.report_gaps import line
from reobserve_papers.report.reported_claims import ReportedClaim


@dataclass(frozen=True)
class AssumptionRow:
    """Parameters of a paper that say the same of several keys.

    ``status`` is `assumed`, `stated` or `overridden`, ``value`` and ``range`` one line a part.
    """

    keys: tuple[str, ...]
    value: tuple[str, ...]
    unit: str
    status: str
    source: str
    range: tuple[str, ...]
    why: str
    numerical: bool
    chosen_for: str
    claims: tuple[str, ...] = ()

    @property
    def section(self) -> str:
        """The branch of the parameters it stands in."""
        return self.keys[0].partition(".")[0]


def entries(parameters: Parameters, claims: Iterable[ReportedClaim]) -> tuple[AssumptionRow, ...]:
    """Return the parameters of a paper in file order, with the claims that depend on them.

    Entries that have the same last key in the same section and say the same stand together: what
    several observers share was decided once.
    """
    dependent: dict[str, list[str]] = {}
    for claim in claims:
        for key in claim.depends_on:
            dependent.setdefault(key, []).append(claim.name)
    grouped: dict[tuple[Any, ...], AssumptionRow] = {}
    for key, body in parameters.entries():
        entry = _entry(key, body)
        identity = (entry.section, key.rpartition(".")[2], replace(entry, keys=("",)))
        if identity in grouped:
            entry = replace(entry, keys=(*grouped[identity].keys, key))
        grouped[identity] = entry
    return tuple(
        replace(
            entry, claims=tuple(dict.fromkeys(c for k in entry.keys for c in dependent.get(k, ())))
        )
        for entry in grouped.values()
    )


def _entry(key: str, body: Mapping[str, Any]) -> AssumptionRow:
    source = str(body["source"])
    status = {"assumed": "assumed", OVERRIDDEN: "overridden"}.get(source, "stated")
    return AssumptionRow(
        keys=(key,),
        value=value_lines(body["value"]),
        unit=str(body["unit"]),
        status=status,
        source=source,
        range=range_lines(body.get("range")),
        why=line(body.get("why", "")),
        numerical=bool(body.get("numerical")),
        chosen_for=line(body.get("chosen_for", "")),
    )


def value_lines(value: Any) -> tuple[str, ...]:
    """A value as text: a line for each row of a matrix or term of a signal."""
    if isinstance(value, list) and value and isinstance(value[0], list | Mapping):
        return tuple(_text(part) for part in value)
    return (_text(value),)


def range_lines(allowed: Any) -> tuple[str, ...]:
    """The range of an assumption as text, a line for each pattern."""
    if allowed is None:
        return ()
    if isinstance(allowed, list):
        return (_interval(allowed),)
    if "choices" in allowed:
        return ("one of " + ", ".join(map(_text, allowed["choices"])),)
    return tuple(
        f"{_interval(interval)} each" if pattern == "*" else f"{pattern}: {_interval(interval)}"
        for pattern, interval in allowed.items()
    )


def _interval(interval: list[float]) -> str:
    low, high = (_text(end) for end in interval)
    return low if low == high else f"{low} to {high}"


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        kind = f"{value['kind']}: " if "kind" in value else ""
        fields = (f"{key} {_text(part)}" for key, part in value.items() if key != "kind")
        return kind + ", ".join(fields)
    if isinstance(value, list):
        return f"({', '.join(map(_text, value))})"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        short = f"{value:.6g}"
        return (short if float(short) == value else f"{value:.12g}").replace("-", "−")
    return str(value).replace("-", "−") if isinstance(value, int) else str(value)

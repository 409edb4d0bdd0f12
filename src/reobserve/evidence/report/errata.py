"""The errata of a paper, and the limitations of its replication."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from reobserve.evidence.report.reading import line, need
from reobserve.ledger.config import read_yaml

_KEYS = ("place", "printed", "corrected", "why", "test", "certainty")


@dataclass(frozen=True)
class Erratum:
    """What a paper prints wrong, the correction, and the test that shows it.

    ``certainty`` is `certain`, `likely`, or `copy` for what the text at hand may have lost.
    """

    name: str
    place: str
    printed: str
    corrected: str
    why: str
    test: str
    certainty: str


def read_errata(project: Path, paper: str) -> tuple[Erratum, ...]:
    """Read the errata of a paper, in file order.

    Raises
    ------
    InputError
        If the file cannot be read, or an erratum lacks a key.
    """
    path = project / f"config/errata/{paper}.yaml"
    bodies = need(str(path), need(str(path), read_yaml(path), "errata")["errata"] or {})
    return tuple(
        Erratum(name, *(line(need(f"{path}, {name}", body, *_KEYS)[key]) for key in _KEYS))
        for name, body in bodies.items()
    )


def read_obstacles(project: Path, paper: str) -> str:
    """Read what limits the replication of a paper; `InputError` if its claims do not say."""
    path = project / f"config/claims/{paper}.yaml"
    return line(need(str(path), read_yaml(path), "obstacles")["obstacles"])

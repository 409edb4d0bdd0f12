"""The errata of a paper, and the obstacles to replicating it."""

from __future__ import annotations

from reobserve.errors import InputError
from reobserve.evidence.report.model import Erratum, Gap
from reobserve.evidence.report.reading import Project, line, need

_KEYS = ("place", "printed", "corrected", "why", "test", "certainty")


def read_errata(project: Project, paper: str) -> tuple[Erratum, ...] | Gap:
    """The errata of a paper in file order, or why there are none."""
    path = f"config/errata/{paper}.yaml"
    try:
        bodies = need(path, need(path, project.yaml(path), "errata")["errata"] or {})
        return tuple(
            Erratum(name, *(line(need(f"{path}, {name}", body, *_KEYS)[key]) for key in _KEYS))
            for name, body in bodies.items()
        )
    except InputError as error:
        return project.gaps.add(f"{paper}-errata", error)


def read_obstacles(project: Project, paper: str) -> str | Gap:
    """The obstacles to replicating a paper, in the words of its claims file."""
    path = f"config/claims/{paper}.yaml"
    try:
        return line(need(path, project.yaml(path), "obstacles")["obstacles"])
    except InputError as error:
        return project.gaps.add(f"{paper}", error)

"""A paper's parameter file by the types that the paper declares: whole, and as one job receives it.

The declaration is the dataclass ``Parameters`` among the paper's ``keys``: a field for each section
of the parameter file, a mapping where the branches of a section have names.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, get_args, get_type_hints

from pydantic import Tag

from reobserve.core.errors import InputError, nearest
from reobserve.core.validation import Names, checked, having, parse
from reobserve_papers.parameters.names import SECTIONS, paper_part
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.inputs import Signal

# The branch that a job is about: its keys are named in errors without the job's name for it.
_SUBJECTS = ("theory", "observer", "table", "design")


@dataclass(frozen=True)
class Job:
    """The branches of a parameter file that one job receives, with the types its paper declares."""

    plant: Any
    seed: int = 0
    scenario: Any = None
    observer: Any = None
    observers: Mapping[str, Any] = field(default_factory=dict)
    design: Any = None
    designs: Mapping[str, Any] = field(default_factory=dict)
    study: Any = None
    search: Any = None
    table: Any = None
    figure: Any = None
    metrics: Any = None
    theory: Any = None


Settings = Mapping[str, Any] | Job


def signal(axes: int) -> Any:
    """The terms of a signal with so many components; see `reobserve_papers.signals.inputs`."""
    return checked(lambda place, value: Signal.parse(place, value, axes))


@dataclass(frozen=True, kw_only=True)
class Study:
    """What every study states; the method, if there are several, is for the paper to name."""

    scenario: str
    observers: Names
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """What every figure states; a paper's own narrow the layouts to those that it samples."""

    layout: str
    scenario: str
    observers: Names
    title: str = ""
    source: str = ""


@dataclass(frozen=True, kw_only=True)
class StudyFigure(Figure):
    """The figure of a study, whose method is the layout's name if it has one."""

    study: str


# For papers whose layouts do not tell these apart.
AnyFigure = Annotated[
    Annotated[StudyFigure, Tag("figure of a study")] | Annotated[Figure, Tag("figure")],
    having("study", "figure of a study", "figure"),
]


def record_axis(job: Job) -> tuple[float, float]:
    """Horizon and step of a plant's record [s], unless the paper's `record` says otherwise."""
    return job.plant.horizon, job.plant.step


def read_job(keys: type, settings: Settings) -> Job:
    """The settings of a job, checked and as types; see `Parameters.settings`.

    Raises
    ------
    InputError
        With the key of what is missing, unknown or wrong, by the job's own name of the branch.
    """
    if isinstance(settings, Job):
        return settings
    kinds = _sections(keys)
    subject = next((name for name in _SUBJECTS if name in settings), None)
    branches = {}
    for name, branch in settings.items():
        if name == "seed":
            branches[name] = branch
            continue
        # A theory is shown all sections, those that the paper does not have as empty ones.
        kind = kinds.get(SECTIONS.get(name, name), dict[str, str])
        if name in SECTIONS:
            kind = get_args(kind)[1]
        branches[name] = parse(kind, branch, "" if name == subject else name)
    return Job(**branches)


@cache
def _sections(keys: type) -> dict[str, Any]:
    """The types of the sections that a paper declares."""
    return get_type_hints(keys, include_extras=True)


def read_parameters(parameters: Parameters) -> Any:
    """The whole parameter file as the ``Parameters`` of its paper.

    Raises
    ------
    InputError
        With the dotted key of what is missing, unknown or wrong, or if no package is the paper's.
    """
    sections = {name: parameters.section(name) for name in parameters.tree if name != "about"}
    return parse(declared_keys(parameters), sections, parameters.paper)


def declared_keys(parameters: Parameters) -> type:
    """The declaration of a paper's parameter file.

    Raises
    ------
    InputError
        If the package that the file names, or its module with the keys, is not there.
    """
    package = parameters.package
    module = paper_part(package, "keys")
    try:
        keys: type = importlib.import_module(module).Parameters
    except ModuleNotFoundError as error:
        if not f"{module}.".startswith(f"{error.name}."):
            raise
        problem = f"{package!r}: there is no module {error.name}"
        raise InputError(f"{parameters.paper}.about.package", problem) from None
    return keys


def named(observers: Mapping[str, Any], name: str, kind: Any) -> Any:
    """The observer of a name that a study or the theory is about.

    Raises
    ------
    InputError
        If there is none, or it is of another form than ``kind``.
    """
    found = observers.get(name)
    if found is None:
        raise InputError("observers", f"must have {name!r}{nearest(name, observers)}")
    if not isinstance(found, kind):
        raise InputError(f"observers.{name}.algorithm", f"must not be {found.algorithm} here")
    return found

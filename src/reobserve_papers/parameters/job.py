"""A paper's parameter file by the types that the paper declares: whole, and as one job receives it.

The declaration is the dataclass ``Parameters`` among the paper's ``keys``: a field for each section
of the parameter file, a mapping where the branches of a section have names.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Generic, get_args, get_type_hints, overload

from pydantic import Field, Tag
from typing_extensions import TypeVar  # with defaults, as `typing` has it from 3.13 on

from reobserve.core.errors import InputError, nearest
from reobserve.core.validation import Names, checked, having, parse
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import SECTIONS
from reobserve_papers.parameters.units import Duration
from reobserve_papers.signals.inputs import Signal

# The branch that a job is about: its keys are named in errors without the job's name for it.
_SUBJECTS = ("theory", "observer", "table", "design")


PlantType = TypeVar("PlantType")
# A paper that has not a section leaves its type out.
ScenarioType = TypeVar("ScenarioType", default=None)
ObserverType = TypeVar("ObserverType", default=None)
MetricsType = TypeVar("MetricsType", default=None)
FigureType = TypeVar("FigureType", default=None)
TheoryType = TypeVar("TheoryType", default=None)
StudyType = TypeVar("StudyType", default=None)
DesignType = TypeVar("DesignType", default=None)
SearchType = TypeVar("SearchType", default=None)
TableType = TypeVar("TableType", default=None)

Kind = TypeVar("Kind")

_ABSENT: Any = None  # what another kind of job reads


@dataclass(frozen=True)
class Job(
    Generic[
        PlantType, ScenarioType, ObserverType, MetricsType, FigureType, TheoryType, StudyType,
        DesignType, SearchType, TableType,
    ]
):  # fmt: skip
    """The branches of a parameter file that one job receives, with the types its paper declares.

    Each paper names its types once, ``Job = job.Job[Plant, Scenario, ...]`` among its keys. Which
    branches there are depends on the step, see `reobserve_papers.parameters.settings`.
    """

    plant: PlantType
    seed: int = 0
    scenario: ScenarioType = _ABSENT
    observer: ObserverType = _ABSENT
    observers: Mapping[str, ObserverType] = field(default_factory=dict)
    design: DesignType = _ABSENT
    designs: Mapping[str, DesignType] = field(default_factory=dict)
    study: StudyType = _ABSENT
    search: SearchType = _ABSENT
    table: TableType = _ABSENT
    figure: FigureType = _ABSENT
    metrics: MetricsType = _ABSENT
    theory: TheoryType = _ABSENT


# Of whichever paper.
AnyJob = Job[Any, Any, Any, Any, Any, Any, Any, Any, Any, Any]
Settings = Mapping[str, Any]  # plain values of the same branches, see `Parameters.settings`

# The key that says which of several types a branch has.
_CHOSEN_BY = {"observer": "algorithm", "design": "kind", "study": "method", "figure": "layout"}


def sections(stated: Any) -> type:
    """The declaration of a parameter file with a section for each type of a paper's ``Job``."""
    found: list[tuple[str, Any]] = []
    for variable, kind in zip(Job.__parameters__, get_args(stated), strict=True):  # type: ignore[attr-defined]
        name = variable.__name__.removesuffix("Type").lower()
        key = _CHOSEN_BY[name] if isinstance(kind, UnionType) else None
        one = Annotated[kind, Field(discriminator=key)]  # type: ignore[valid-type]
        if kind not in (None, NoneType):
            named = name in SECTIONS
            found.append((SECTIONS[name], Mapping[str, one]) if named else (name, one))
    order = ["plant", *SECTIONS.values(), "metrics", "theory"]  # a value before what takes it
    found.sort(key=lambda section: order.index(section[0]))
    return make_dataclass("Parameters", found, frozen=True)


def signal(axes: int) -> Any:
    """The terms of a signal with so many components (see `reobserve_papers.signals.inputs`)."""
    return checked(lambda place, value: Signal.parse(place, value, axes))


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Keys of every observer of sampled signals. Which algorithm it is, is for the paper to say."""

    sampling_period: Duration
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Keys of every study. The method, if there are several, is for the paper to name."""

    scenario: str
    observers: Names
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Keys of every figure. A paper's own narrow the layouts to those that it samples."""

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
    having({"study": "figure of a study"}, "figure"),
]


def read_job(keys: type, settings: Settings) -> AnyJob:
    """The settings of a job, checked and as types (see `Parameters.settings`)."""
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
    return AnyJob(**branches)


@cache
def _sections(keys: type) -> dict[str, Any]:
    """The types of the sections that a paper declares."""
    return get_type_hints(keys, include_extras=True)


def read_parameters(parameters: Parameters) -> Any:
    """The whole parameter file as the ``Parameters`` of its paper."""
    sections = {name: parameters.section(name) for name in parameters.tree if name != "about"}
    return parse(declared_keys(parameters), sections, parameters.paper)


def declared_keys(parameters: Parameters) -> type:
    """The declaration of a paper's parameter file."""
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


@overload
def named(observers: Mapping[str, Any], name: str, kind: type[Kind]) -> Kind: ...


@overload
def named(observers: Mapping[str, Kind], name: str, kind: UnionType) -> Kind: ...


def named(observers: Mapping[str, Any], name: str, kind: Any) -> Any:
    """The observer of a name that a study or the theory is about."""
    found = observers.get(name)
    if found is None:
        raise InputError("observers", f"must have {name!r}{nearest(name, observers)}")
    if not isinstance(found, kind):
        raise InputError(f"observers.{name}.algorithm", f"must not be {found.algorithm} here")
    return found

"""The structure of a parameter file, ``config/papers/<paper>.yaml``.

A parameter file has sections, sections have branches, and branches have entries: a value with its
unit and source. Which entries a branch has, and of what type their values are, each paper declares
in its module ``keys``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Discriminator, Field, Tag, model_validator

from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError, shown
from reobserve.core.files import read_text
from reobserve.core.validation import STRICT, Names, Positive, Text, checked, distinct, parse

_WORDING = ("label", "source", "title")  # keys that decide no number, wherever they stand
_LONGEST = 60


class Model(BaseModel):
    """A mapping with these keys and no other."""

    model_config = STRICT


FileKind = TypeVar("FileKind", bound=Model)


def parse_file(kind: type[FileKind], tree: object, folder: str, paper: str) -> FileKind:
    """Check a file of a paper whose main part is named after its folder, as ``claims``."""
    try:
        return parse(kind, tree, f"{folder}.{paper}")
    except InputError as error:
        key = error.parameter.replace(f"{folder}.{paper}.{folder}.", f"{folder}.{paper}.", 1)
        raise InputError(key, error.problem) from None


def read_part(path: Path, part: str) -> dict[str, Any]:
    """The file of a paper, whose main part is empty if there is no file, no text or no entry."""
    text = read_text(path) if path.is_file() else ""
    if not (tree := parse_yaml(text, str(path))):
        return {part: {}}
    if not isinstance(tree, dict):
        raise InputError(str(path), "must be a mapping of keys to values")
    return {**tree, part: tree.get(part) or {}}


def name(pattern: str, allowed: str, *reserved: str) -> Any:
    """Text that can stand in a path, in a pattern of Snakemake's and in a command."""

    def check(place: str, text: str) -> None:
        if not re.fullmatch(pattern, text) or len(text) > _LONGEST:
            raise InputError(place, f"{shown(text)} is no name: {allowed}")
        if text in (*_WORDING, *reserved):
            raise InputError(place, f"{shown(text)} has a meaning of its own, must be another name")

    return checked(check)


_LETTERS = "a letter, then up to 59 letters, digits and _"
Name = Annotated[str, name(r"[A-Za-z][A-Za-z0-9_]*", _LETTERS)]
ObserverName = Annotated[str, name(r"[A-Za-z][A-Za-z0-9_]*", _LETTERS, "plant")]
FigureName = Annotated[str, name("fig[0-9]+[a-z_]*", "fig with digits, then small letters or _")]
TableName = Annotated[str, name("table[0-9]*[a-z_]*", "table with digits, then small letters or _")]


@checked
def dotted(place: str, text: str) -> None:
    """Refuse what `import` does not take."""
    if not all(word.isidentifier() for word in text.split(".")):
        raise InputError(place, f"{shown(text)} must be the name of a package, such as papers.mine")


Interval = Annotated[list[float], Field(min_length=2, max_length=2)]


class Choices(Model):
    """A range as a list of all allowed values."""

    choices: Annotated[list[Any], Field(min_length=1)]


def _form_of_range(value: Any) -> str:
    if isinstance(value, dict):
        return "choices" if "choices" in value else "intervals by pattern"
    return "interval"


Range = Annotated[
    Annotated[Interval, Tag("interval")]
    | Annotated[Choices, Tag("choices")]
    | Annotated[Annotated[dict[str, Interval], Field(min_length=1)], Tag("intervals by pattern")],
    Discriminator(_form_of_range),
]
Multiples = Annotated[
    Annotated[Positive, Tag("number")]
    | Annotated[Annotated[dict[str, Positive], Field(min_length=1)], Tag("numbers by pattern")],
    Discriminator(lambda value: "numbers by pattern" if isinstance(value, dict) else "number"),
]
Places = Annotated[
    Annotated[bool, Tag("all")] | Annotated[Annotated[list[str], Field(min_length=1)], Tag("some")],
    Discriminator(lambda value: "some" if isinstance(value, list) else "all"),
]


def _value(place: str, value: Any) -> None:
    if value is None or isinstance(value, dict):
        raise InputError(place, f"{shown(value)} must be a number, a list, a word, true or false")


class Entry(Model):
    """One parameter: its value, its unit, and where it comes from."""

    value: Annotated[Any, checked(_value)]
    unit: Text
    source: Text = Field(description="The place where the paper states it, or `assumed`.")
    why: Text | None = Field(None, description="Why this value is assumed.")
    range: Range | None = Field(
        None, description="The values that another reader of the paper could have chosen."
    )
    named: Annotated[list[Any], Field(min_length=1)] | None = Field(
        None,
        description="Values that the paper names; half of the samples take one, if numbers.",
    )
    multiple_of: Multiples | None = Field(
        None, description="The grid on which sampled values lie; by pattern as in `range`."
    )
    same_as: Text | None = Field(None, description="The key of an entry whose value it takes.")
    chosen_for: Text | None = Field(
        None, description="The claim for which it was chosen, and the search that found it."
    )
    numerical: bool = Field(
        False, description="Whether it is a resolution of the computation, which is not sampled."
    )
    levels: bool = Field(
        False, description="Whether it is a list of levels that a study goes through."
    )
    no_effect: Places = Field(
        False, description="Its numbers on which no result depends; true for all."
    )
    plot_only: bool = Field(False, description="Whether only a plot depends on it.")

    @model_validator(mode="after")
    def _assumed(self) -> Entry:
        if self.source == "assumed":
            for key in ("why", "range"):
                if getattr(self, key) is None:
                    raise InputError(key, "is missing; what is assumed needs it")
        return self


class _Branch(BaseModel):
    """A branch of entries, in addition to the declared keys."""

    model_config = {
        **STRICT,
        "extra": "allow",
        "model_title_generator": lambda kind: kind.__name__.removesuffix("Branch"),
    }
    __pydantic_extra__: dict[str, Entry]

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: Any) -> Any:
        found = handler.resolve_ref_schema(handler(core))
        return {**found, "additionalProperties": handler(Entry.__pydantic_core_schema__)}


def _check_drawn(place: str, text: str) -> None:
    """Refuse text with formulas that cannot be drawn."""
    if "$" in text:
        from reobserve_papers.plotting.formulas import check_formulas

        check_formulas(place, text)


_Drawn = Annotated[str, checked(_check_drawn)]


class Titled(_Branch):
    """A scenario or a design."""

    title: _Drawn


class ObserverBranch(_Branch):
    """An observer."""

    algorithm: str
    label: _Drawn
    design: str | None = None


class SearchBranch(_Branch):
    """A search for values."""

    title: _Drawn
    scenario: str
    observers: list[str]


class StudyBranch(SearchBranch):
    """A study over many runs."""

    method: str | None = None
    design: str | None = None


class TableBranch(_Branch):
    """A table of the paper."""

    title: _Drawn
    source: str
    design: str


class FigureBranch(_Branch):
    """A figure of the paper."""

    title: _Drawn
    source: str
    layout: str
    scenario: str
    observers: Annotated[list[str], distinct]
    study: str | None = None


class About(Model):
    """The paper itself, and the Python package with its plant, observers, metrics and plots."""

    package: Annotated[Text, dotted]
    title: _Drawn
    authors: list[str]
    year: int | None = None
    doi: str | None = None


class ParameterFile(Model):
    """The parameters of one paper."""

    about: About
    plant: dict[str, Entry]
    scenarios: dict[Name, Titled]
    designs: dict[Name, Titled] = {}
    observers: dict[ObserverName, ObserverBranch]
    studies: dict[Name, StudyBranch] = {}
    searches: dict[Name, SearchBranch] = {}
    tables: dict[TableName, TableBranch] = {}
    metrics: dict[str, Entry]
    theory: dict[str, Entry] | None = None
    figures: dict[FigureName, FigureBranch]


class Configuration(BaseModel):
    """Contents of a build, ``config/config.yaml``. Other keys are papers, with overrides."""

    model_config = {**STRICT, "extra": "allow"}
    __pydantic_extra__: dict[str, dict[str, Any]]

    formats: Annotated[
        list[Literal["pdf", "svg", "png", "eps", "pgf"]], Field(min_length=1), distinct
    ]
    seed: Annotated[int, Field(ge=0, le=2**53 - 1)]
    samples: Annotated[int, Field(ge=1, le=1_000_000)]
    cached: bool
    papers: Annotated[Names | None, Field(description="The papers to build; all if left out.")] = (
        None
    )
    bench: Annotated[
        list[str] | None,
        Field(description="Tasks of the bench to build; all if both this and papers are left out."),
    ] = None
    style: str = "default"
    notes: bool = True
    latex: bool = False

"""Values of YAML and JSON checked against types, by pydantic, with errors of one sentence.

A file is declared as a dataclass (or a pydantic model) whose fields are its keys:

    @dataclass(frozen=True)
    class Plant:
        horizon: Positive
        step: Positive
        initial_rate: Annotated[list[float], vector(3)]

`parse` makes one of what YAML or JSON holds, or names the key that is missing, unknown or wrong.
Types are strict: a word is no number, and neither is true. Where a branch has several forms, a
discriminator tells them apart. The same declarations give the JSON schemas for editors, `schema`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any, TypeVar, overload

import numpy as np

from reobserve.core.covariances import as_positive_definite
from reobserve.core.documents import check_plain
from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.extras import package
from reobserve.core.matrices import as_floats, as_matrix, as_vector

package("pydantic", "check keys and values")
from pydantic import (  # noqa: E402
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    TypeAdapter,
    ValidationError,
)

Type = TypeVar("Type")
Path = tuple[Any, ...]

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


@overload
def parse(kind: type[Type], tree: object, place: str = "", *, finite: bool = True) -> Type: ...


@overload
def parse(kind: Any, tree: object, place: str = "", *, finite: bool = True) -> Any: ...


def parse(kind: Any, tree: object, place: str = "", *, finite: bool = True) -> Any:
    """Make a ``kind`` of the values of YAML or JSON.

    Parameters
    ----------
    kind
        A dataclass, a pydantic model, or any type that a field of one may have.
    tree
        Mappings, lists, numbers, text, booleans and None.
    place
        The dotted key or the file in which it stands, for errors.
    finite
        Whether infinity and nan are refused.

    Raises
    ------
    InputError
        With the dotted key of what is unknown, missing or not of its type.
    """
    # As JSON, where a list is also a tuple. It has one value, so that locations begin with 0.
    try:
        text = json.dumps([tree], allow_nan=not finite, default=_as_list)
    except (TypeError, ValueError, RecursionError):
        check_plain(tree, place)
        raise InputError(place, "cannot be written as JSON") from None
    try:
        (found,) = _adapter(kind, finite).validate_json(text)
    except ValidationError as error:
        raise _sentence(error, kind, tree, place) from None
    return found


def schema(kind: Any) -> dict[str, Any]:
    """The JSON schema of a kind of file."""
    whole = _adapter(kind, True).json_schema()
    defs = whole.get("$defs", {})
    found = whole["prefixItems"][0]
    top: dict[str, Any] = defs[found["$ref"].rpartition("/")[2]] if "$ref" in found else found
    return {**top, "$defs": defs}


def join(place: str, name: str) -> str:
    """The dotted key of ``name`` under ``place``, where a name may be ``[0].kind``, or empty."""
    name = name.lstrip(".")
    return f"{place}{'' if not (place and name) or name[0] == '[' else '.'}{name}"


@cache
def _adapter(kind: Any, finite: bool) -> Any:
    # pydantic takes no settings for a dataclass itself, but for a tuple that holds one.
    return TypeAdapter(tuple[kind], config={**STRICT, "allow_inf_nan": not finite})


def _as_list(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError


# One sentence for the worst error

_UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
_NO_NUMBER = "{value} is not a number, must be one that is finite"
_NOT_WHOLE = "{value} must be a whole number"
_NO_MAPPING = "{value} must be a mapping of keys to values"

# By pydantic's type of an error: what is wrong, and what is allowed.
_PROBLEMS = {
    "float_type": _NO_NUMBER,
    "finite_number": _NO_NUMBER,
    "int_type": _NOT_WHOLE,
    "int_from_float": _NOT_WHOLE,
    "int_parsing_size": _NOT_WHOLE,
    "bool_type": "{value} must be one of true and false, not a word or a number",
    "string_type": "{value} must be a word",
    "literal_error": "{value} must be {one_of}",
    "list_type": "{value} must be a list{of_items}",
    "tuple_type": "{value} must be a list{of_items}",
    "dict_type": _NO_MAPPING,
    "dataclass_type": _NO_MAPPING,
    "model_type": _NO_MAPPING,
    "model_attributes_type": _NO_MAPPING,
    "too_short": "has {actual_length} items, must have {min_length} or more",
    "too_long": "has {length} items, must have {max_length} or fewer",
    "greater_than": "{value} must be greater than {gt:g}",
    "greater_than_equal": "{value} must be {ge:g} or more",
    "less_than": "{value} must be less than {lt:g}",
    "less_than_equal": "{value} must be {le:g} or less",
    "missing": "is missing{needed}",
    "union_tag_invalid": "{value} must be {one_of}",
    "union_tag_not_found": "is missing, must be {one_of}",
}
_PLURALS = {"number": "numbers", "integer": "whole numbers", "string": "words", "object": "terms"}


def _sentence(error: ValidationError, kind: Any, tree: Any, place: str) -> InputError:
    """The first of the most telling errors: a misspelt key is unknown and missing at once."""
    telling = {**dict.fromkeys(_UNKNOWN, 0), "missing": 1}
    worst = min(error.errors(include_url=False), key=lambda one: telling.get(one["type"], 2))
    location, problem, value = worst["loc"], worst["type"], worst["input"]
    about = worst.get("ctx", {})
    path, tag = _path(location[1:], tree, absent=problem in telling)
    here = ".".join([place, *map(str, path)] if place else map(str, path))
    if problem == "value_error" and isinstance(about["error"], InputError):
        return about["error"].renamed(join(here, about["error"].parameter))

    schema = _adapter(kind, True).json_schema()
    parts: dict[str, Any] = {**about}
    if problem.startswith("union_tag"):
        if isinstance(value, Mapping):
            key = about["discriminator"].strip("'")
            here, value = join(here, key), value.get(key)
            tags = ", ".join(_at(schema, location)[0].get("discriminator", {}).get("mapping", {}))
            parts["one_of"] = _one_of(about.get("expected_tags", tags))
        else:
            problem = "dict_type"
    elif problem in _UNKNOWN:
        others = [name for name in _known(schema, location) if name != path[-1]]
        return InputError(here, f"unknown key{nearest(path[-1], others)}")
    elif problem == "missing":
        needed = tag or _title(schema, location)
        parts["needed"] = needed and f"; {needed} needs it"
    elif problem == "literal_error":
        parts["one_of"] = _one_of(about["expected"])
    elif problem in ("list_type", "tuple_type"):
        inner = [one.get("items", {}) for one in _branches(*_at(schema, location))]
        items = next((_PLURALS[one["type"]] for one in inner if one.get("type") in _PLURALS), "")
        parts["of_items"] = items and f" of {items}"
    elif problem == "too_long":
        parts["length"] = len(value)
    parts["value"] = f"{value:g}" if isinstance(value, float) else shown(value)
    template = _PROBLEMS.get(problem, "{value}: " + worst["msg"].replace("{", "").replace("}", ""))
    said = template.format(**parts)
    said = said.replace("must be greater than 0", "must be greater than zero")
    return InputError(here, said.replace("must be 0 or more", "must not be negative"))


def _one_of(words: str) -> str:
    """A list of words as pydantic has it, without quotes."""
    listed = words.replace("'", "").replace(" or ", ", ")
    return f"one of {listed}" if ", " in listed else listed


def _path(location: Path, tree: Any, absent: bool) -> tuple[Path, str]:
    """The keys of a location, without names of types, and the name of the innermost type."""
    path: list[Any] = []
    tag, last = "", len(location) - 1
    for index, step in enumerate(location):
        if isinstance(tree, Mapping) and (step in tree or (absent and index == last)):
            path.append(step)
            tree, tag = tree.get(step), tag if index == last else ""
        elif isinstance(tree, list | tuple) and isinstance(step, int):
            path.append(step)
            tree, tag = tree[step] if step < len(tree) else None, ""
        elif isinstance(tree, Mapping) and step != "[key]":
            key = next((key for key, value in tree.items() if value == step), "")
            tag = f"the {key} {step}" if key else f"the {step}"
    return tuple(path), tag


def _branches(schema: Any, defs: Mapping[str, Any]) -> Iterator[Any]:
    """A schema without references, or all that it may be."""
    if "$ref" in schema:
        schema = defs[schema["$ref"].rpartition("/")[2]]
    inner = schema.get("anyOf", schema.get("oneOf"))
    if inner is None:
        yield schema
    for one in inner or ():
        yield from _branches(one, defs)


def _at(schema: Any, location: Path) -> tuple[Any, Mapping[str, Any]]:
    """The part of a schema at a location."""
    defs, node = schema.get("$defs", {}), schema
    for step in location:
        mapping = node.get("discriminator", {}).get("mapping", {})
        if step in mapping:
            node = {"$ref": mapping[step]}
            continue
        for branch in _branches(node, defs):
            if isinstance(step, int):
                found = (branch.get("prefixItems", [])[step : step + 1] or [branch.get("items")])[0]
            else:
                patterns = branch.get("patternProperties", {}).values()
                others = next(iter(patterns), branch.get("additionalProperties"))
                found = branch.get("properties", {}).get(step, others)
            if isinstance(found, dict):
                node = found
                break
    return node, defs


def _known(schema: Any, location: Path) -> list[str]:
    """The keys that are allowed beside the last one of a location."""
    node, defs = _at(schema, location[:-1])
    return list(
        dict.fromkeys(key for one in _branches(node, defs) for key in one.get("properties", {}))
    )


def _title(schema: Any, location: Path) -> str:
    """The name of the type that has the last key of a location, for a sentence."""
    node, defs = _at(schema, location[:-1])
    titles = [one.get("title", "") for one in _branches(node, defs) if "properties" in one]
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", titles[0]) if len(titles) == 1 else ""
    return words and f"the {words.strip('_').lower()}"


def form(name: str) -> Tag:
    """The tag of a form, as a discriminator has it."""
    return Tag(name)


def having(forms: Mapping[str, str], other: str) -> Discriminator:
    """A discriminator of forms: the tag of mappings that have a key, and that of all others."""

    def tag(tree: Any) -> str:
        known = (name for key, name in forms.items() if isinstance(tree, dict) and key in tree)
        return next(known, other)

    return Discriminator(tag)


# Conditions on values


def checked(check: Callable[[str, Any], object]) -> AfterValidator:
    """Validator that calls ``check(name, value)``, which raises `InputError` for what is wrong."""

    def validate(value: Any) -> Any:
        check("", value)
        return value

    return AfterValidator(validate)


def as_stated(check: Callable[[str, Any], object]) -> PlainValidator:
    """`checked`, where the check is the only one: no other type is demanded before it."""
    return PlainValidator(checked(check).func)


def _distinct(place: str, value: list[Any]) -> None:
    if len(set(value)) < len(value):
        raise InputError(place, f"{shown(value)} must not name anything twice")


def _rising(place: str, value: list[float]) -> None:
    first, last = as_vector(place, value, 2)
    if not 0 <= first < last:
        raise InputError(place, f"[{first:g}, {last:g}] must be 0 or more, rising")


def _text(place: str, value: str) -> None:
    if not value.strip():
        raise InputError(place, "must not be empty")


distinct = checked(_distinct)
"""A list that names nothing twice."""

rising = checked(_rising)
"""Two numbers from zero on, the second one greater."""


def within(low: float, high: float) -> Any:
    """Limits from one number to another, both included."""
    return Field(ge=low, le=high)


def items(least: int = 1, most: int = 10_000) -> Any:
    """A list of so many."""
    return Field(min_length=least, max_length=most)


def vector(size: int) -> AfterValidator:
    """A list of ``size`` numbers."""
    return checked(lambda place, value: as_vector(place, value, size))


def array(*shape: int) -> AfterValidator:
    """Lists of lists of numbers, as many as ``shape`` says."""

    def check(place: str, value: Any) -> None:
        found = as_floats(place, value).shape
        if found != shape:
            raise InputError(place, f"has shape {found}, must be {shape}")

    return checked(check)


# What `matrix` and `positive_definite` leave as it is stated.
MatrixValue = float | list[float] | list[list[float]]


def matrix(size: int) -> PlainValidator:
    """A number (times the identity), a diagonal or a square matrix, as the type `MatrixValue`."""
    return as_stated(lambda place, value: as_matrix(place, value, size))


def positive_definite(size: int) -> PlainValidator:
    """The same, and symmetric positive definite."""
    return as_stated(lambda place, value: as_positive_definite(place, value, size))


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, lt=1)]
Count = Annotated[int, within(1, 1_000_000)]
Seed = Annotated[int, within(0, 2**63 - 1)]
Levels = Annotated[list[Positive], items()]  # what a study or a figure goes through
Window = Annotated[list[float], rising]  # from one time to another
Text = Annotated[str, checked(_text), AfterValidator(lambda text: " ".join(text.split()))]
Names = Annotated[list[str], items(), distinct]
Terms = list[dict[str, Any]]  # of a signal or a polynomial, which have conditions of their own

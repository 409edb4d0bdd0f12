"""Two folders of results of any script, compared file by file: tables, JSON and pictures.

A number agrees if it differs from the accepted one by no more than an absolute tolerance and a
share of the accepted one, a picture by its root mean square (see `pixels`), words letter by letter.
"""

from __future__ import annotations

import fnmatch
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from reobserve.core.documents import parse_json, read_yaml
from reobserve.core.errors import InputError
from reobserve.core.files import read_bytes, read_rows, read_text, write_bytes
from reobserve.core.validation import NotNegative, parse
from reobserve_papers.figure_diff import pixels
from reobserve_papers.figure_diff.build_comparison import Item
from reobserve_papers.golden.comparison import compare
from reobserve_papers.golden.number_files import GoldenNumber, Key, Numbers

COMPARED = (".csv", ".json", ".png")
_MOST_VALUES = 5_000_000  # of a JSON file


@dataclass(frozen=True)
class Tolerance:
    """Differences that are allowed: of a number, and of a picture in grey levels of 0 to 255."""

    relative: NotNegative = 1e-6
    absolute: NotNegative = 1e-12
    picture: NotNegative = pixels.TOLERANCE


@dataclass(frozen=True)
class _Own:
    """The tolerance of some files, as far as it is not that of all."""

    relative: NotNegative | None = None
    absolute: NotNegative | None = None
    picture: NotNegative | None = None


@dataclass(frozen=True)
class Tolerances(Tolerance):
    """The same for all files, and others for ``files`` by name or pattern, such as ``fig*.png``."""

    files: dict[str, _Own] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None) -> Tolerances:
        """The tolerances of a YAML file, or those that hold without one."""
        return cls() if path is None else parse(cls, read_yaml(path), str(path))

    def of(self, name: str) -> Tolerance:
        """The tolerance of a file, from the first pattern that it matches."""
        matching = (self.files[pattern] for pattern in self.files if fnmatch.fnmatch(name, pattern))
        own = vars(next(matching, _Own()))
        return replace(self, **{key: value for key, value in own.items() if value is not None})


def compare_folders(reference: Path, results: Path, tolerances: Tolerances) -> list[Item]:
    """An item for each file of either folder and of folders in it, the largest change first."""
    sides = [Path(os.path.realpath(side)) for side in (reference, results)]
    if sides[0].is_relative_to(sides[1]) or sides[1].is_relative_to(sides[0]):
        raise InputError(
            "--results", f"{results} must be beside {reference}, not in it or around it"
        )
    if not _names(results):
        kinds = ", ".join(f"*{kind}" for kind in COMPARED)
        raise InputError(str(results), f"has no files to compare: {kinds}")
    names = sorted({*_names(reference), *_names(results)})
    items = [_compare(reference / name, results / name, name, tolerances) for name in names]
    return sorted(items, key=lambda item: -item.gravity)


def copy_results(reference: Path, results: Path) -> None:
    """Put the files of results in place of the accepted ones, then remove those that are gone."""
    contents = {name: read_bytes(results / name) for name in _names(results)}
    gone = {*_names(reference)} - contents.keys()
    for name, content in contents.items():
        write_bytes(reference / name, content)
    for name in gone:
        (reference / name).unlink()


def _names(folder: Path) -> list[str]:
    paths = (path for path in folder.rglob("*") if path.suffix.lower() in COMPARED)
    return [path.relative_to(folder).as_posix() for path in paths if path.is_file()]


def _compare(accepted: Path, new: Path, name: str, tolerances: Tolerances) -> Item:
    allowed = tolerances.of(name)
    item = Item("", name, allowed=allowed.picture)
    with item.problem_noted():
        contents: list[Any] = []
        picture = new.suffix.lower() == ".png"
        for path, problem in ((new, "it is missing"), (accepted, "there is no accepted file")):
            if not path.is_file():
                item.missing = True
                raise InputError(str(path), problem)
            contents.append(pixels.read_pixels(path) if picture else _numbers(path, allowed))
        if picture:
            item.reference, item.new = accepted, new
            item.rms, item.note_rms = pixels.compare_images(accepted, new, name)
        else:
            built, golden = contents
            item.moved = list(compare(golden, built, name))
    return item


def _numbers(path: Path, allowed: Tolerance) -> Numbers:
    """The numbers and words of a table or of a JSON file, with what is allowed of each."""
    table = path.suffix.lower() == ".csv"
    numbers: dict[Key, GoldenNumber] = {}
    for key, text in (
        _cells(path) if table else _leaves(parse_json(read_text(path), str(path), _MOST_VALUES))
    ):
        number = GoldenNumber(text)
        if not number.is_word:
            size = abs(float(text))
            number = GoldenNumber(text, "", f"{allowed.absolute + allowed.relative * size:g}")
        numbers[key] = number
    return numbers


def _cells(path: Path) -> Iterator[tuple[Key, str]]:
    header, rows = read_rows(path)
    for column, title in enumerate(header):
        name = title if header.count(title) == 1 else f"{title} (number {column + 1})"
        yield ("column", name, "the header"), title
        for line, row in enumerate(rows, start=2):
            yield ("column", name, f"line {line}"), row[column]


def _leaves(tree: Any, name: str = "", item: str = "") -> Iterator[tuple[Key, str]]:
    """The values of a tree by their keys with dots between, those of lists by their places.

    Words are in quotes, as are keys in which a dot or nothing is.
    """
    if isinstance(tree, dict):
        for key, branch in tree.items():
            part = key if key.isidentifier() else json.dumps(key)
            yield from _leaves(branch, f"{name}.{part}" if name else part, item)
    elif isinstance(tree, list):
        for place, branch in enumerate(tree):
            yield from _leaves(branch, name, f"{item}{place}.")
    if not isinstance(tree, dict | list) or not tree:
        yield ("", name or "value", f"item {item[:-1]}" if item else ""), json.dumps(tree)

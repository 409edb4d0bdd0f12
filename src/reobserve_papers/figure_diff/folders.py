"""Two folders of results of any script, compared file by file: tables, JSON and pictures.

A number agrees if it differs from the accepted one by no more than an absolute tolerance and a
share of the accepted one, a picture by its root mean square (see `pixels`), words letter by letter.
"""

from __future__ import annotations

import fnmatch
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from reobserve.core.documents import parse_json, read_yaml
from reobserve.core.errors import InputError
from reobserve.core.files import read_rows, read_text
from reobserve.core.validation import NotNegative, parse
from reobserve_papers.figure_diff import pixels
from reobserve_papers.figure_diff.build_comparison import Item
from reobserve_papers.golden.comparison import compare
from reobserve_papers.golden.number_files import GoldenNumber, Key, Numbers

COMPARED = (".csv", ".json", ".png")


@dataclass(frozen=True)
class Tolerance:
    """Differences that are allowed: of a number, and of a picture in grey levels of 0 to 255."""

    relative: NotNegative = 1e-6
    absolute: NotNegative = 1e-12
    picture: NotNegative = pixels.TOLERANCE


@dataclass(frozen=True)
class Tolerances(Tolerance):
    """The same for all files, and others for ``files`` by name or pattern, such as ``fig*.png``."""

    files: dict[str, Tolerance] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None) -> Tolerances:
        """The tolerances of a YAML file, or those that hold without one."""
        return cls() if path is None else parse(cls, read_yaml(path), str(path))

    def of(self, name: str) -> Tolerance:
        """The tolerance of a file: that of the first pattern which it matches."""
        matching = (self.files[pattern] for pattern in self.files if fnmatch.fnmatch(name, pattern))
        return next(matching, self)


def compare_folders(reference: Path, results: Path, tolerances: Tolerances) -> list[Item]:
    """An item for each file of either folder and of folders in it, the largest change first."""
    names = sorted({*_names(reference), *_names(results)})
    if not names:
        kinds = ", ".join(f"*{kind}" for kind in COMPARED)
        raise InputError(str(reference), f"has no files to compare: {kinds}")
    items = [_compare(reference / name, results / name, name, tolerances) for name in names]
    return sorted(items, key=lambda item: -item.gravity)


def copy_results(reference: Path, results: Path) -> None:
    """Put the files of results in place of the accepted ones, and remove those that are gone."""
    for name in _names(reference):
        (reference / name).unlink()
    for name in _names(results):
        (reference / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(results / name, reference / name)


def _names(folder: Path) -> list[str]:
    paths = (path for path in folder.rglob("*") if path.suffix.lower() in COMPARED)
    return [path.relative_to(folder).as_posix() for path in paths if path.is_file()]


def _compare(accepted: Path, new: Path, name: str, tolerances: Tolerances) -> Item:
    allowed = tolerances.of(name)
    item = Item("", name, allowed=allowed.picture)
    with item.problem_noted():
        for path, problem in ((accepted, "there is no accepted file"), (new, "it is missing")):
            if not path.is_file():
                raise InputError(str(path), problem)
        if new.suffix.lower() == ".png":
            item.reference, item.new = accepted, new
            item.rms, item.note_rms = pixels.compare_images(accepted, new, name)
        else:
            golden, built = (_numbers(path, allowed) for path in (accepted, new))
            item.moved = list(compare(golden, built, name))
    return item


def _numbers(path: Path, allowed: Tolerance) -> Numbers:
    """The numbers and words of a table or of a JSON file, with what is allowed of each."""
    table = path.suffix.lower() == ".csv"
    numbers: dict[Key, GoldenNumber] = {}
    for key, text in _cells(path) if table else _leaves(parse_json(read_text(path), str(path))):
        number = GoldenNumber(text)
        if not number.is_word:
            size = abs(float(text))
            number = GoldenNumber(text, "", f"{allowed.absolute + allowed.relative * size:g}")
        numbers[key] = number
    return numbers


def _cells(path: Path) -> Iterator[tuple[Key, str]]:
    header, rows = read_rows(path)
    for column, title in enumerate(header):
        name = title if header.count(title) == 1 else f"{title} ({column + 1})"
        yield ("column", name, "the header"), title
        for line, row in enumerate(rows, start=2):
            yield ("column", name, f"line {line}"), row[column]


def _leaves(tree: Any, name: str = "", item: str = "") -> Iterator[tuple[Key, str]]:
    """The values of a tree by their keys with dots between, those of lists by their places."""
    if isinstance(tree, dict):
        for key, branch in tree.items():
            yield from _leaves(branch, f"{name}.{key}" if name else key, item)
    elif isinstance(tree, list):
        for place, branch in enumerate(tree):
            yield from _leaves(branch, name, f"{item}{place}.")
    if not isinstance(tree, dict | list) or not tree:
        yield ("", name, f"item {item[:-1]}" if item else ""), str(tree)

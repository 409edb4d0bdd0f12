"""The project a report is made of: where files are, and how they are read or found missing."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from reobserve.errors import InputError
from reobserve.evidence.report.model import Gaps, Link
from reobserve.plain_data.documents import read_yaml
from reobserve.plain_data.files import read_bytes, read_table, read_text

# How the command line begins the sentence that says why it failed.
_SAID = "reobserve: "

Read = TypeVar("Read")


@dataclass(frozen=True)
class Project:
    """The folder, where the page will be, and the gaps found so far.

    Paths are relative to the folder, in messages as in arguments.
    """

    folder: Path
    page: Path
    gaps: Gaps = field(default_factory=Gaps)

    def exists(self, path: str) -> bool:
        """Whether there is such a file."""
        return (self.folder / path).is_file()

    def bytes(self, path: str) -> bytes:
        """The content of a file; `InputError` if it cannot be read."""
        return self.named(path, read_bytes)

    def text(self, path: str) -> str:
        """The text of a file; `InputError` if it cannot be read."""
        return self.named(path, read_text)

    def yaml(self, path: str) -> dict[str, Any]:
        """A mapping from YAML; `InputError` if it cannot be read or is none."""
        return self.named(path, read_yaml)

    def table(self, path: str, header: Sequence[str]) -> list[dict[str, str]]:
        """The rows of a CSV; `InputError` if it cannot be read or has other columns."""
        return self.named(path, lambda file: read_table(file, header))

    def named(self, path: str, read: Callable[[Path], Read]) -> Read:
        """What ``read`` makes of a file; an `InputError` of its names the path in the project."""
        file = self.folder / path
        try:
            return read(file)
        except InputError as error:
            place = error.parameter.removeprefix(str(file))
            raise InputError(f"{path}{place}", error.problem) from None

    def reason(self, log: str) -> str:
        """What a stage said in its log when it could not do its work; empty if it said nothing."""
        try:
            last = self.text(log).rstrip().rpartition("\n")[2]
        except InputError:
            return ""
        return f"; {log} says: {last.removeprefix(_SAID)}" if last.startswith(_SAID) else ""

    def link(self, path: str, label: str) -> Link:
        """A link from the page to a file."""
        target = os.path.relpath(self.folder.resolve() / path, self.page.resolve().parent)
        return Link(label, Path(target).as_posix())


def line(text: object) -> str:
    """Text on one line."""
    return " ".join(str(text).split())


def need(path: str, body: Any, *keys: str) -> Mapping[str, Any]:
    """``body`` if it is a mapping with ``keys``; `InputError` if not."""
    if not isinstance(body, Mapping):
        raise InputError(path, "must be a mapping of keys to values")
    for key in keys:
        if key not in body:
            raise InputError(path, f"has no key {key!r}")
    return body

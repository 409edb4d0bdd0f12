"""The project a report is made of: where files are, and how they are read or found missing."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from reobserve.config import read_yaml
from reobserve.errors import InputError
from reobserve.files import read_table
from reobserve.replication_report.model import Gaps, Link

# How the command line begins the sentence that says why it failed.
_SAID = "reobserve: "


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
        try:
            return (self.folder / path).read_bytes()
        except OSError as error:
            raise InputError(path, f"cannot be read ({error.strerror})") from None

    def text(self, path: str) -> str:
        """The text of a file; `InputError` if it cannot be read."""
        try:
            return self.bytes(path).decode("utf-8")
        except UnicodeDecodeError:
            raise InputError(path, "cannot be read (it is not UTF-8)") from None

    def yaml(self, path: str) -> dict[str, Any]:
        """A mapping from YAML; `InputError` if it cannot be read or is none."""
        try:
            return read_yaml(self.folder / path)
        except InputError as error:
            raise InputError(path, error.problem) from None
        except UnicodeDecodeError:
            raise InputError(path, "cannot be read (it is not UTF-8)") from None

    def json(self, path: str) -> dict[str, Any]:
        """A mapping from JSON; `InputError` if it cannot be read or is none."""
        try:
            tree = json.loads(self.text(path))
        except json.JSONDecodeError as error:
            raise InputError(path, f"is not JSON: {error}") from None
        if not isinstance(tree, dict):
            raise InputError(path, "must be a mapping of keys to values")
        return tree

    def table(self, path: str, header: Sequence[str]) -> list[dict[str, str]]:
        """The rows of a CSV; `InputError` if it cannot be read or has other columns."""
        try:
            return read_table(self.folder / path, header)
        except InputError as error:
            raise InputError(path, error.problem) from None

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

"""Design files: JSON, written whole, read as checked values and certified again.

    {"format": "reobserve design", "schema": 1, "kind": "kalman", "system": {...},
     "gains": {...}, "certificate": {...}, "versions": {...}}

``system`` has the keys of the model's file that the design was made from. Floats are written in
the shortest form that reads back to the same number.
"""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import metadata
from math import isfinite
from pathlib import Path
from typing import TypeVar

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, shown
from reobserve.core.files import write_text
from reobserve.core.validation import parse
from reobserve.estimation.families import family, name_of
from reobserve.estimation.observer_design import Design, plain

FORMAT = "reobserve design"
SCHEMA = 1

DesignKind = TypeVar("DesignKind", bound=Design)

_HEADER = ("format", "schema", "kind", "versions")
_PACKAGES = ("reobserve", "numpy", "scipy")
_ROW = re.compile(r"\[\n[^][{}]*\]")  # a list of numbers or words, which is put on one line


def load_design(path: str | Path) -> Design:
    """The design in a file, certified again: ``design.observer`` is ready to run.

    Raises
    ------
    InputError
        If the file is no design file, or of another schema; a key is missing, unknown or wrong; or
        the certificate is not that of its system and gains, with the numbers.
    """
    tree = read_json(path)
    if tree.get("format") != FORMAT:
        raise InputError(f"{path}: format", f"{shown(tree.get('format'))} must be {FORMAT!r}")
    if tree.get("schema") != SCHEMA or isinstance(tree["schema"], bool):
        said = shown(tree.get("schema"))
        raise InputError(f"{path}: schema", f"{said} must be {SCHEMA}, which this version reads")
    kind = family(tree.get("kind"), f"{path}: kind")
    body = {name: part for name, part in tree.items() if name not in _HEADER}
    if "gains" not in body and kind.needs_gains():
        raise InputError(f"{path}: gains", f"are missing; a design of {tree['kind']} needs them")
    with naming(path):
        return parse(kind, body).checked()


def save_design(path: str | Path, design: DesignKind) -> DesignKind:
    """Certify a design, write its file, whole or not at all, and return it with its certificate.

    Before, the observer is started and run over some rows.

    Raises
    ------
    InputError
        As `Design.certify` and `Design.try_out`; or if it is no design, a number of the certificate
        is not finite, or the file cannot be written.
    """
    name = name_of(type(design))
    with design.keyed():
        certified = replace(design, certificate=design.certify())
    for key, value in certified.certificate.items():
        if isinstance(value, float) and not isfinite(value):
            raise InputError(f"certificate.{key}", "is beyond floating-point numbers")
    certified.try_out()
    tree = {
        "format": FORMAT,
        "schema": SCHEMA,
        "kind": name,
        **plain(certified),
        "versions": {
            "python": platform.python_version(),
            **{package: _version(package) for package in _PACKAGES},
        },
    }
    text = json.dumps(tree, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(path, _ROW.sub(lambda row: " ".join(row[0].split()), text) + "\n")
    return certified


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Put the file before the key that an `InputError` inside names."""
    try:
        yield
    except InputError as error:
        raise error.renamed(f"{path}: {error.parameter}") from None


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"

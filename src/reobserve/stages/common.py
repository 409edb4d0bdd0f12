"""What the stages share: provenance, designs, what a figure reads, and the paper's own module."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from reobserve.errors import InputError, located
from reobserve.files import read_table
from reobserve.ledger import Ledger, digest
from reobserve.provenance import code_digest, versions
from reobserve.series import Series


def paper_module(paper: str, stage: str) -> Any:
    """The module ``reobserve.papers.<paper>.<stage>``."""
    return importlib.import_module(f"reobserve.papers.{paper}.{stage}")


def signed(series: Series, ledger: Ledger, stage: str, job: str, settings: Any) -> Series:
    """``series`` with its provenance: what made it, from which settings, by which code."""
    return replace(series, provenance=provenance(ledger, stage, job, settings))


def provenance(ledger: Ledger, stage: str, job: str, settings: Any) -> dict[str, Any]:
    """What made a result, from which settings, by which code and packages."""
    return {
        "paper": ledger.paper,
        "stage": stage,
        "job": job,
        "settings": settings,
        "settings_digest": digest(settings),
        "code_digest": code_digest(stage, ledger.paper),
        "packages": versions(),
    }


def compute_design(ledger: Ledger, design: str) -> dict[str, Any]:
    """A design of the ledger as its readers get it: what JSON makes of what the paper computes.

    Raises
    ------
    InputError
        If a setting cannot be used or a number of the design is not finite.
    """
    place = f"{ledger.paper}.designs.{design}"
    settings = ledger.settings("design", design)
    with located(place):
        computed = paper_module(ledger.paper, "design").compute(settings)
    try:
        read_back: dict[str, Any] = json.loads(json.dumps(computed, allow_nan=False))
    except ValueError:
        raise InputError(place, "gives a number that is not finite") from None
    return read_back


def read_design(path: Path, wanted: tuple[str, str] | None = None) -> dict[str, Any]:
    """A design from the file that its stage wrote; ``wanted`` are the paper and the name it has.

    Raises
    ------
    InputError
        If the file is missing or damaged, no design, or another than ``wanted``.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        design = dict(stored["design"])
        found = (stored["provenance"]["paper"], stored["provenance"]["job"])
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(str(path), "is no design; build it anew") from None
    if wanted is not None and wanted != found:
        raise InputError(
            str(path), f"is {found[1]!r} of {found[0]}, must be {wanted[1]!r} of {wanted[0]}"
        )
    return design


def named_design(ledger: Ledger, body: dict[str, Any], path: Path | None) -> list[dict[str, Any]]:
    """The design that an observer, a study or a table names, from its file; empty without one.

    Raises
    ------
    InputError
        If there is a file and no name, a name and no file, or the file holds another design.
    """
    wanted = body.get("design")
    if wanted is None and path is None:
        return []
    if path is None:
        raise InputError("--design-file", f"must be given: the ledger names the design {wanted!r}")
    if wanted is None:
        raise InputError("--design-file", "is given, but the ledger names no design here")
    return [read_design(path, (ledger.paper, wanted))]


def read_estimates(observers: list[str], paths: list[Path]) -> dict[str, Series]:
    """The estimates of a figure by observer, from the files in the same order.

    Raises
    ------
    InputError
        If there are more or fewer files than observers, or one cannot be read.
    """
    if len(paths) != len(observers):
        wanted = ", ".join(observers)
        raise InputError("--estimate-files", f"{len(paths)} given, must be one each for {wanted}")
    return {name: Series.read(path) for name, path in zip(observers, paths, strict=True)}


def read_study(paper: str, path: Path | None) -> list[dict[str, str]] | None:
    """The rows of a figure's study; None for a figure without one."""
    return None if path is None else read_table(path, paper_module(paper, "study").HEADER)

"""Errors and inconsistencies of a paper, each with the test that shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from reobserve.core.errors import InputError
from reobserve.core.validation import Text
from reobserve_papers.parameters.parameter_file import Model, parse_file, read_part


class ErratumEntry(Model):
    """An error of a paper: what it prints, the correction, and the test that shows it."""

    place: Text = Field(description="Where in the paper it is.")
    printed: Text = Field(description="What the paper prints.")
    corrected: Text = Field(description="What it should be.")
    why: Text = Field(description="Why that is the correction.")
    certainty: Literal["certain", "likely", "copy"] = Field(
        description="`certain`: it contradicts the paper or a computation; `likely`: nothing else"
        " fits; `copy`: it may come from the copy at hand, in which signs, primes and indices can"
        " be lost."
    )
    settles: Text | None = Field(
        None, description="The parameter whose value it corrects; no claim may depend on that."
    )
    test: Annotated[str, StringConstraints(pattern=r"^tests/[\w/]+\.py::test_\w+$")] = Field(
        description="FILE::FUNCTION, which shows that the printed form fails."
    )


class Erratum(ErratumEntry):
    """An error of a paper, with its name."""

    name: str


class ErrataFile(Model):
    """The errata of a paper, ``config/errata/<paper>.yaml``."""

    errata: dict[Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]+$")], ErratumEntry]


def errata_file(project: Path, paper: str) -> Path:
    """The file with the errata of a paper."""
    return project / "config" / "errata" / f"{paper}.yaml"


def read_errata(project: Path, paper: str) -> tuple[Erratum, ...]:
    """Read the errata of a paper, in file order, none without a file."""
    tree = read_part(errata_file(project, paper), "errata")
    found = parse_file(ErrataFile, tree, "errata", paper).errata
    for name, erratum in found.items():
        if erratum.printed == erratum.corrected:
            raise InputError(f"errata.{paper}.{name}.corrected", "is what is printed")
    return tuple(Erratum(name=name, **one.model_dump()) for name, one in found.items())

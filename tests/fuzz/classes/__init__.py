"""The classes of input, by name: how many cases of each the tests run, and what makes one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random

from ..case import Case
from . import (
    arguments,
    claims,
    command_line,
    configs,
    design_files,
    designs,
    equations,
    errata,
    expressions,
    ledger_files,
    ledgers,
    models,
    overrides,
    own_data,
    pictures,
    records,
    robustness,
    samples,
    tables,
    yaml,
)


@dataclass(frozen=True)
class Class:
    """So many ``cases`` of what ``made`` makes in the tests.

    The ``valid`` examples must be accepted; they bring along all that is compiled or made once.
    """

    cases: int
    made: Callable[[Random], Case]
    valid: Callable[[], Iterator[Case]]


CLASSES = {
    "ledgers": Class(200, ledgers.make, ledgers.examples),
    "overrides": Class(150, overrides.make, overrides.examples),
    "config": Class(200, configs.make, configs.examples),
    "yaml": Class(300, yaml.make, yaml.examples),
    "claims": Class(120, claims.make, claims.examples),
    "errata": Class(100, errata.make, errata.examples),
    "equations": Class(150, equations.make, equations.examples),
    "ledger-files": Class(250, ledger_files.make, ledger_files.examples),
    "records": Class(120, records.make, records.examples),
    "samples": Class(250, samples.make, samples.examples),
    "designs": Class(200, designs.make, designs.examples),
    "models": Class(120, models.make, models.examples),
    "design-files": Class(100, design_files.make, design_files.examples),
    "robustness": Class(50, robustness.make, robustness.examples),
    "tables": Class(250, tables.make, tables.examples),
    "pictures": Class(200, pictures.make, pictures.examples),
    "command-line": Class(250, command_line.make, command_line.examples),
    "arguments": Class(900, arguments.make, arguments.examples),
    "own-data": Class(250, own_data.make, own_data.examples),
    "expressions": Class(150, expressions.make, expressions.examples),
}


def make(name: str, seed: int, number: int) -> Case:
    """The case of a class that a seed and a number say."""
    return CLASSES[name].made(Random(f"{name} {seed} {number}"))

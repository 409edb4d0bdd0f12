"""A ledger checked whole, before anything runs: its types, and what takes building to see."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from reobserve.errors import InputError, located
from reobserve.ledger import Ledger
from reobserve.ledger_types import Job, read_ledger


def check_ledger(ledger: Ledger) -> None:
    """Read the ledger as what its paper declares, build what it states, and run nothing.

    Raises
    ------
    InputError
        With the dotted key of what no stage could use.
    """
    stated = read_ledger(ledger)
    module = importlib.import_module(f"reobserve.papers.{ledger.paper}.ledger")
    with located(ledger.paper):
        module.check(stated)


def check_scenarios(ledger: Any, build: Callable[[Job], object]) -> None:
    """Build the plant of every scenario of a paper's typed ledger, and run none.

    Raises
    ------
    InputError
        With the config key: what a plant calls ``scenario`` stands there under its own name.
    """
    for name, scenario in ledger.scenarios.items():
        try:
            build(Job(ledger.plant, scenario=scenario))
        except InputError as error:
            key = error.parameter.replace("scenario", f"scenarios.{name}", 1)
            raise InputError(key, error.problem) from None

"""What the checks of all papers' ledgers share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reobserve.errors import InputError, located
from reobserve.ledger import Ledger


def check_scenarios(ledger: Ledger, build: Callable[[dict[str, Any]], object]) -> None:
    """Build the plant of every scenario from its settings and run none.

    Raises
    ------
    InputError
        With the config key: what a plant calls ``scenario`` stands there under its own name.
    """
    for name in ledger.section("scenarios"):
        try:
            with located(ledger.paper):
                build(ledger.settings("plant", name))
        except InputError as error:
            here = f"{ledger.paper}.scenarios.{name}"
            key = error.parameter.replace(f"{ledger.paper}.scenario", here)
            raise InputError(key, error.problem) from None

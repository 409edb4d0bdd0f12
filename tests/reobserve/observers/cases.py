"""All observers with a record each, from the modules ``cases_*`` beside this one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from tests.reobserve.observers.case import Case


def stated(name: str) -> Iterator[Any]:
    """What the modules have under a name, those that have it."""
    for path in sorted(Path(__file__).parent.glob("cases_*.py")):
        module = import_module(f"{__package__}.{path.stem}")
        if hasattr(module, name):
            yield getattr(module, name)


CASES: dict[str, Callable[[], Case]] = {
    name: make for cases in stated("CASES") for name, make in cases.items()
}

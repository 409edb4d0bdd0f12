"""The observer of a specification: a design file, or the keys of a family."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.observer_design import Design


@dataclass(frozen=True)
class DesignFile:
    """A file that `reobserve design` wrote, by its path."""

    file: str

    def design(self, period: float) -> Design:
        """The design, certified again, if it is one of this sampling period."""
        from reobserve.estimation.families.file import load_design

        design = load_design(Path(self.file))
        design.start()
        own = design.observer.sampling_period
        if abs(own - period) > 1e-9 * period:
            raise InputError(
                "file", f"{self.file} is of a sampling period of {own:g} s, sampling.period says "
                f"{period:g} s",
            )  # fmt: skip
        return design


@dataclass(frozen=True, eq=False)
class ObserverSection:
    """The system of a family, and its gains, None where they are to be found."""

    kind: type[Design]
    system: Any
    gains: Any = None

    def design(self, period: float) -> Design:
        """The design, with gains found where they are not stated."""
        with self.kind.keyed():
            design = self.kind.of(self.system, self.gains)
            _ = design.observer, design.start()  # which are refused here
            return design


def as_observer(tree: Mapping[str, Any], period: float) -> DesignFile | ObserverSection:
    """The observer that a mapping states, for a sampling period [s].

    Raises
    ------
    InputError
        If a key is missing, unknown or wrong.
    """
    if "kind" not in tree:
        raise InputError("kind", f"is missing, must be one of design, {', '.join(FAMILIES)}")
    rest = {name: part for name, part in tree.items() if name != "kind"}
    if tree["kind"] == "design":
        if list(rest) != ["file"] or not isinstance(rest["file"], str):
            problem = f"{shown(rest)} must be the path of a design file, and no other key"
            raise InputError("file", problem)
        return DesignFile(rest["file"])
    if "sampling_period" in rest:
        problem = f"must be left out, or {period:g}, which sampling.period states"
        raise InputError("sampling_period", problem)
    kind = family(tree["kind"])
    return ObserverSection(kind, *kind.read({**rest, "sampling_period": period}))

"""An observer from a design file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from reobserve.own_data.kinds.setup import Setup


@dataclass(frozen=True)
class DesignFile:
    """What `reobserve design` wrote."""

    kind: Literal["design"]
    file: str

    def set_up(self, period: float) -> Setup:
        """The observer, its gains certified again."""
        raise NotImplementedError


def from_design(design: Any) -> Setup:
    """The one place that knows what a design offers."""
    raise NotImplementedError

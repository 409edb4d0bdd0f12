"""Extended Kalman filter, from right-hand sides as text."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from reobserve.estimation.families.rules import rules
from reobserve.estimation.families.text_model import RECORD, TextFilterDesign
from reobserve.estimation.observer_design import Example
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter


@dataclass(frozen=True, eq=False, kw_only=True)
class ExtendedKalmanDesign(TextFilterDesign):
    """An extended Kalman filter, whose Jacobians are derived from the texts."""

    gains: None = None

    about: ClassVar[str] = "extended Kalman filter"
    programs: ClassVar = {ExtendedKalmanFilter: "filters:filter_program"}
    records: ClassVar = {
        "extended-kalman": Example(
            "swing",
            "# Extended Kalman filter of a system x' = f(x, u), y = h(x, u) that is written as "
            "text.\nobserver:\n  kind: extended-kalman\n" + RECORD,
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> ExtendedKalmanFilter:
        """The filter, with its Jacobians."""
        made = ExtendedKalmanFilter(self.system.model, **rules(self.system))
        with self.system.naming():
            _ = made.functions
        return made

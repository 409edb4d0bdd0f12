"""Unscented Kalman filter, from right-hand sides as text."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from reobserve.estimation.families.rules import rules
from reobserve.estimation.families.text_model import RECORD, TextFilterDesign, TextSystem
from reobserve.estimation.observer_design import Example
from reobserve.observers.nonlinear_filter import UnscentedKalmanFilter


@dataclass(frozen=True, eq=False)
class SigmaPointGains:
    """alpha, beta and kappa of scaled sigma points."""

    alpha: float = 0.1
    beta: float = 2.0
    kappa: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class UnscentedKalmanDesign(TextFilterDesign):
    """An unscented Kalman filter, without Jacobians."""

    gains: SigmaPointGains

    about: ClassVar[str] = "unscented Kalman filter"
    programs: ClassVar = {UnscentedKalmanFilter: "filters:filter_program"}
    records: ClassVar = {
        "unscented-kalman": Example(
            "swing",
            "# Unscented Kalman filter of a system x' = f(x, u), y = h(x, u) that is written as "
            "text.\nobserver:\n  kind: unscented-kalman\n" + RECORD
            + "  gains: {alpha: 0.1, beta: 2.0, kappa: 0.0}  # may be left out\n",
        ),
    }  # fmt: skip

    @classmethod
    def find_gains(cls, system: TextSystem) -> SigmaPointGains:
        """The defaults of the library."""
        return SigmaPointGains()

    @cached_property
    def observer(self) -> UnscentedKalmanFilter:
        """The filter."""
        gains = self.gains
        return UnscentedKalmanFilter(
            self.system.model,
            alpha=gains.alpha,
            beta=gains.beta,
            kappa=gains.kappa,
            **rules(self.system),
        )

"""State and fault observers, and their designs.

Each name below is imported when it is first asked for: what one observer needs, another may lack.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reobserve.core.errors import DivergenceError, InputError
    from reobserve.detection.false_alarms import false_alarm_threshold
    from reobserve.estimation.families.loading import load_design
    from reobserve.observers.adaptive import AdaptiveObserver
    from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
    from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
    from reobserve.observers.extended_kalman import ExtendedKalmanFilter
    from reobserve.observers.extended_state import ExtendedStateObserver
    from reobserve.observers.fixed_gain import FixedGainObserver, luenberger, steady_kalman
    from reobserve.observers.high_gain import HighGainObserver
    from reobserve.observers.ilo import ILO
    from reobserve.observers.ilo_sampled import SampledILO
    from reobserve.observers.imm import IMM
    from reobserve.observers.kalman import KalmanFilter
    from reobserve.observers.levant import LevantDifferentiator
    from reobserve.observers.normal_form import normal_form_observer
    from reobserve.observers.normal_form_identity import IdentityObserver
    from reobserve.observers.normal_form_transformed import TransformedObserver
    from reobserve.observers.run import Estimate, Run
    from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
    from reobserve.observers.smoother import rts_smoother
    from reobserve.observers.unscented_kalman import UnscentedKalmanFilter
    from reobserve.systems.linear import LinearModel
    from reobserve.systems.nonlinear import NonlinearModel
    from reobserve.systems.polynomial import PolynomialSystem
    from reobserve.systems.rigid_body import RigidBody
    from reobserve.systems.triangular import TriangularModel
    from reobserve.tuning.search import tune

__all__ = [
    "ILO",
    "IMM",
    "AdaptiveObserver",
    "AugmentedKalmanFilter",
    "DivergenceError",
    "Estimate",
    "ExtendedHighGainObserver",
    "ExtendedKalmanFilter",
    "ExtendedStateObserver",
    "FixedGainObserver",
    "HighGainObserver",
    "IdentityObserver",
    "InputError",
    "KalmanFilter",
    "LevantDifferentiator",
    "LinearModel",
    "NonlinearModel",
    "PolynomialSystem",
    "RigidBody",
    "Run",
    "SampledILO",
    "SmoothVariableStructureFilter",
    "TransformedObserver",
    "TriangularModel",
    "UnscentedKalmanFilter",
    "false_alarm_threshold",
    "load_design",
    "luenberger",
    "normal_form_observer",
    "rts_smoother",
    "steady_kalman",
    "tune",
]

_HOMES = {
    "detection.false_alarms": ("false_alarm_threshold",),
    "estimation.families.loading": ("load_design",),
    "core.errors": ("DivergenceError", "InputError"),
    "systems.linear": ("LinearModel",),
    "systems.nonlinear": ("NonlinearModel",),
    "systems.polynomial": ("PolynomialSystem",),
    "systems.rigid_body": ("RigidBody",),
    "systems.triangular": ("TriangularModel",),
    "observers.adaptive": ("AdaptiveObserver",),
    "observers.augmented_kalman": ("AugmentedKalmanFilter",),
    "observers.extended_high_gain": ("ExtendedHighGainObserver",),
    "observers.extended_kalman": ("ExtendedKalmanFilter",),
    "observers.extended_state": ("ExtendedStateObserver",),
    "observers.fixed_gain": ("FixedGainObserver", "luenberger", "steady_kalman"),
    "observers.high_gain": ("HighGainObserver",),
    "observers.ilo": ("ILO",),
    "observers.ilo_sampled": ("SampledILO",),
    "observers.imm": ("IMM",),
    "observers.kalman": ("KalmanFilter",),
    "observers.levant": ("LevantDifferentiator",),
    "observers.normal_form": ("normal_form_observer",),
    "observers.normal_form_identity": ("IdentityObserver",),
    "observers.normal_form_transformed": ("TransformedObserver",),
    "observers.run": ("Estimate", "Run"),
    "observers.smooth_variable_structure": ("SmoothVariableStructureFilter",),
    "observers.smoother": ("rts_smoother",),
    "observers.unscented_kalman": ("UnscentedKalmanFilter",),
    "tuning.search": ("tune",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        found = globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
        return found
    from reobserve.core.errors import nearest

    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{nearest(name, __all__)}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

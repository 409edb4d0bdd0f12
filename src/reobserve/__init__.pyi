# The public names, one import each, for type checkers and for the package itself.

from reobserve.core.errors import DivergenceError as DivergenceError
from reobserve.core.errors import InputError as InputError
from reobserve.detection.false_alarms import false_alarm_threshold as false_alarm_threshold
from reobserve.estimation.estimates import estimate as estimate
from reobserve.estimation.families.loading import load_design as load_design
from reobserve.observers.adaptive import AdaptiveObserver as AdaptiveObserver
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter as AugmentedKalmanFilter
from reobserve.observers.extended_high_gain import (
    ExtendedHighGainObserver as ExtendedHighGainObserver,
)
from reobserve.observers.extended_state import ExtendedStateObserver as ExtendedStateObserver
from reobserve.observers.fault_bank import FaultBank as FaultBank
from reobserve.observers.fixed_gain import FixedGainObserver as FixedGainObserver
from reobserve.observers.fixed_gain import filter_gain as filter_gain
from reobserve.observers.fixed_gain import luenberger as luenberger
from reobserve.observers.fixed_gain import steady_kalman as steady_kalman
from reobserve.observers.grid_filter import GridFilter as GridFilter
from reobserve.observers.high_gain import HighGainObserver as HighGainObserver
from reobserve.observers.ilo import ILO as ILO
from reobserve.observers.ilo import SampledILO as SampledILO
from reobserve.observers.imm import IMM as IMM
from reobserve.observers.kalman import KalmanFilter as KalmanFilter
from reobserve.observers.levant import LevantDifferentiator as LevantDifferentiator
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter as ExtendedKalmanFilter
from reobserve.observers.nonlinear_filter import UnscentedKalmanFilter as UnscentedKalmanFilter
from reobserve.observers.normal_form import IdentityObserver as IdentityObserver
from reobserve.observers.normal_form import TransformedObserver as TransformedObserver
from reobserve.observers.normal_form import normal_form_observer as normal_form_observer
from reobserve.observers.run import Estimate as Estimate
from reobserve.observers.run import Run as Run
from reobserve.observers.simulation import simulate as simulate
from reobserve.observers.smooth_variable_structure import (
    SmoothVariableStructureFilter as SmoothVariableStructureFilter,
)
from reobserve.observers.smoother import rts_smoother as rts_smoother
from reobserve.systems.linear import LinearModel as LinearModel
from reobserve.systems.nonlinear import NonlinearModel as NonlinearModel
from reobserve.systems.polynomial import PolynomialSystem as PolynomialSystem
from reobserve.systems.rigid_body import RigidBody as RigidBody
from reobserve.systems.triangular import TriangularModel as TriangularModel
from reobserve.tuning.fit import fit as fit
from reobserve.tuning.search import tune as tune

__all__: list[str]
__version__: str
_HOME: dict[str, str]

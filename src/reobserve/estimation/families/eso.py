"""Extended state observer, PI or PD/PI, with a proved H-infinity norm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.estimation.families.linear_system import check_shape
from reobserve.estimation.families.signals import NamedSignal, Signals, listed, numbered
from reobserve.estimation.observer_design import (
    Certificate,
    Design,
    Estimates,
    Example,
    System,
    pairs,
    pole_text,
)
from reobserve.observers.extended_state import EsoState, ExtendedStateObserver
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.design import CertifiedGains
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

Array = FloatArray

_RECORD = """\
# PD/PI extended state observer: faults of actuator and sensor at once.
observer:
  kind: eso
  states: {speed: rad/s, current: A}
  inputs: {voltage: V}
  measurements: {speed: rad/s, current: A}
  actuator_faults: {voltage_lost: V}
  sensor_faults: {speed_offset: rad/s}
  A: [[-10.0, 40.0], [-0.4, -20.0]]
  B: [[0.0], [20.0]]
  C: [[1.0, 0.0], [0.0, 1.0]]
  Dd: [[1.0], [0.0]]         # a disturbance of the speed
  Dw: [[0.05, 0.0], [0.0, 0.02]]
  Fa: [[0.0], [20.0]]        # a voltage that is lost
  Fs: [[1.0], [0.0]]         # an offset of the speed's sensor
  filter_rate: 20.0          # [1/s]
  structure: pd_pi           # of gains that are computed: with the derivative of the error; or pi
  factor: 1.05               # of gamma over its lower bound; or decay, or bound, see the reference
"""
_GAINS = """\
  gains:                     # if left out, they are computed
    L: [[23.3, 494], [6.4, 206], [132, -103], [-30.3, 420], [1.96, 166], [133, -457]]
    Ld: [[0.337, 6.95], [0.168, 2.7], [2.03, -0.814], [-0.276, 4.65], [0.176, 2.32], [2.06, -6.75]]
"""
_ALARM = "  - {name: weak, of: voltage_lost, beyond: 1.0}\n"


@dataclass(frozen=True, eq=False, kw_only=True)
class FaultySystem(System):
    """x' = A x + B u + Dd d + Fa fa,  y = C x + Dw w + Fs fs, and how gains are found.

    By linear matrix inequalities, unless gains are given: ``structure`` is PD/PI, or PI with
    Ld = 0. ``factor`` is gamma over its lower bound, with matrices of minimum norm; the default is
    1.05. ``decay`` [1/s] instead, for PI only, gives any gains with all poles left of -decay.
    ``bound`` [1/s] instead gives the minimum gamma with all poles right of -bound and matrices of a
    norm within ``radius``.
    """

    time: Literal["continuous"] = "continuous"  # as linear models state it
    actuator_faults: Signals = field(default_factory=dict)
    sensor_faults: Signals = field(default_factory=dict)
    A: Array
    B: Array | None = None
    C: Array
    Fa: Array | None = None
    Fs: Array | None = None
    Dd: Array | None = None
    Dw: Array | None = None
    filter_rate: Array = field(default_factory=lambda: np.array(1.0))
    structure: Literal["pd_pi", "pi"] = "pd_pi"
    factor: float = 1.05
    decay: float | None = None
    bound: float | None = None
    radius: float = 3000.0
    solver: str = "CLARABEL"

    def __post_init__(self) -> None:
        n = len(self.states) or (len(self.A) if self.A.ndim else 0)
        p = len(self.measurements) or (len(self.C) if self.C.ndim else 0)
        check_shape("A", self.A, (n, n))
        check_shape("C", self.C, (p, n))
        for name, rows, signals in (
            ("B", n, self.inputs), ("Fa", n, self.actuator_faults), ("Fs", p, self.sensor_faults),
        ):  # fmt: skip
            value, shape = getattr(self, name), (rows, len(signals))
            if signals:
                check_shape(name, value, shape)
            if value is None and signals:
                raise InputError(name, f"is missing, must have shape {shape}, as the signals say")
        if self.decay is not None and (self.bound is not None or self.structure != "pi"):
            problem = "is a criterion of its own, for the structure pi, and goes without bound"
            raise InputError("decay", problem)
        if self.initial_state is not None:
            as_vector("initial_state", self.initial_state, n)

    @cached_property
    def augmented(self) -> AugmentedSystem:
        """The system with filter and faults, or `InputError` if faults cannot be distinguished."""
        rows = {"B": self.A, "Fa": self.A, "Fs": self.C, "Dd": self.A, "Dw": self.C}
        matrices = {
            name: np.zeros((len(like), 0)) if (value := getattr(self, name)) is None else value
            for name, like in rows.items()
        }
        return AugmentedSystem(self.A, C=self.C, Az=self.filter_rate, **matrices)


@dataclass(frozen=True, eq=False)
class EsoGains:
    """L and Ld, rows of states, filter and faults. ``gamma`` is the promised bound of the norm.

    Without Ld it is the PI observer.
    """

    L: Array
    Ld: Array | None = None
    method: str = "given gains"
    gamma: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class EsoDesign(Design):
    """An extended state observer."""

    system: FaultySystem
    gains: EsoGains

    programs: ClassVar = {ExtendedStateObserver: "integrating:extended_state_observer"}
    records: ClassVar = {"eso": Example("faulty_motor", _RECORD, _ALARM, _GAINS)}

    @classmethod
    def find_gains(cls, system: FaultySystem) -> EsoGains:
        """Gains by linear matrix inequalities."""
        solution: CertifiedGains
        augmented, derivative = system.augmented, system.structure == "pd_pi"
        if system.decay is not None:
            solution = pi.design_feasible(augmented, system.decay, system.solver)
        elif system.bound is not None:
            solution = pd_pi.design_minimum_gamma(
                augmented, 0.0, system.bound, system.radius, system.solver, derivative=derivative
            )
        else:
            solution = pd_pi.design(
                augmented, system.factor, solver=system.solver, derivative=derivative
            )
        return EsoGains(solution.gains.L, solution.gains.Ld, solution.method, solution.gamma)

    @cached_property
    def observer(self) -> ExtendedStateObserver:
        """The observer."""
        L, Ld = self.gains.L, self.gains.Ld
        gains = Gains(L, np.zeros_like(L) if Ld is None else Ld)
        return ExtendedStateObserver(
            self.system.augmented, gains=gains, sampling_period=self.system.sampling_period
        )

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The state and the faults."""
        system = self.system
        return {
            "state": self.states,
            "actuator_fault": listed(system.actuator_faults)
            or numbered("actuator_fault", system.augmented.Fa.shape[1]),
            "sensor_fault": listed(system.sensor_faults)
            or numbered("sensor_fault", system.augmented.Fs.shape[1]),
        }

    def start(self) -> EsoState | None:
        """The initial state without faults, the filter at rest at what it measures."""
        initial = self.system.initial_state
        if initial is None:
            return None
        x = np.asarray(initial, dtype=np.float64)
        filtered = self.system.C @ x
        faults = np.zeros(self.system.augmented.faults)
        return self.observer.init(np.concatenate([x, filtered, faults]), filtered=filtered)

    def residual(self, y: Array, estimates: Estimates) -> Array:
        """The part of y that neither the state nor the sensor fault explains."""
        system = self.system.augmented
        residual: Array = y.copy()  # column by column: bitwise the same for a row and for many
        # r = y - C x - Fs fs
        for matrix, values in (
            (system.C, estimates["state"]), (system.Fs, estimates["sensor_fault"]),
        ):  # fmt: skip
            for column in range(matrix.shape[1]):
                residual -= values[:, column, None] * matrix[:, column]
        return residual

    def certify(self) -> Certificate:
        """Poles, and bounds of the H-infinity norm, proved."""
        gains = self.observer.gains
        certificate = certify(self.system.augmented, gains, self.gains.gamma)
        if not certificate.holds:
            raise InputError("L", f"and Ld do not hold what they promise: {certificate.reason}")
        return {
            "poles": pairs(self.observer.poles),
            "norm_lower": certificate.norm_lower,
            "norm_upper": certificate.norm_upper,
            "floor": certificate.floor,
        }

    def summary(self) -> list[str]:
        """Poles and norm."""
        known = self.certificate
        return [
            f"extended state observer, {self.gains.method}",
            f"poles: {pole_text(known['poles'])} 1/s",
            f"H-infinity norm from disturbances, noise and changes of faults to errors: at most "
            f"{known['norm_upper']:.6g}, proved; no gains get below {known['floor']:.6g}",
        ]

"""Design of an extended state observer, PI or PD/PI, with a proved H-infinity norm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.core.validation import parse
from reobserve.estimation.designs.design import Certificate, Design, pairs, told
from reobserve.estimation.designs.linear_system import Period, check_shape
from reobserve.estimation.designs.signals import Signal, Signals, listed
from reobserve.observers.extended_state import ExtendedStateObserver, State
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.design import Design as Found
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

Array = FloatArray

EXAMPLE = """\
# A motor: its voltage may be off by actuator, its measured speed by sensor.
sampling_period: 0.01       # [s]
states: {speed: rad/s, current: A}
inputs: {voltage: V}
measurements: {speed: rad/s, current: A}
actuator_faults: {actuator: V}
sensor_faults: {sensor: rad/s}
A: [[-10, 1], [-0.02, -2]]
B: [[0], [2]]
C: [[1, 0], [0, 1]]
Fa: [[0], [2]]              # how faults enter: states by actuator, measurements by sensor
Fs: [[1], [0]]
Dd: [[1, 0], [0, 2]]        # how disturbances enter the states, as many columns as there are
Dw: [[1], [0]]              # and noise the measurements
filter_rate: 1              # [1/s] of the filter of the measurements
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class FaultySystem:
    """x' = A x + B u + Dd d + Fa fa,  y = C x + Dw w + Fs fs."""

    sampling_period: Period
    states: Signals
    inputs: Signals = field(default_factory=dict)
    measurements: Signals
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
    initial_state: list[float] | None = None

    def __post_init__(self) -> None:
        n, p, m = len(self.states), len(self.measurements), len(self.inputs)
        columns = {"B": (n, m), "Fa": (n, len(self.actuator_faults))}
        shapes = {"A": (n, n), "C": (p, n), "Fs": (p, len(self.sensor_faults)), **columns}
        for name, shape in shapes.items():
            value = getattr(self, name)
            check_shape(name, value, shape)
            if value is None and shape[1]:
                raise InputError(name, f"is missing, must have shape {shape}, as the signals say")
        if self.initial_state is not None:
            as_vector("initial_state", self.initial_state, n)

    @cached_property
    def augmented(self) -> AugmentedSystem:
        """The system with filter and faults; `InputError` if faults cannot be told apart."""
        rows = {"B": self.A, "Fa": self.A, "Fs": self.C, "Dd": self.A, "Dw": self.C}
        given = {
            name: np.zeros((len(like), 0)) if (value := getattr(self, name)) is None else value
            for name, like in rows.items()
        }
        return AugmentedSystem(self.A, C=self.C, Az=self.filter_rate, **given)


@dataclass(frozen=True, eq=False)
class EsoGains:
    """L and Ld, rows of states, filter and faults; ``gamma`` is the promised bound of the norm."""

    L: Array
    Ld: Array
    method: str
    gamma: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class EsoDesign(Design):
    """An extended state observer."""

    system: FaultySystem
    gains: EsoGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @classmethod
    def designed(cls, model: Tree, *, kind: str = "pd_pi", **criterion: Any) -> Self:
        """The observer of a model's file; raises as `of`, and for wrong keys."""
        return cls.of(parse(FaultySystem, model), derivative=kind == "pd_pi", **criterion)

    @classmethod
    def of(
        cls,
        system: FaultySystem,
        *,
        derivative: bool = True,
        factor: float = 1.05,
        decay: float | None = None,
        bound: float | None = None,
        radius: float = 3000.0,
        solver: str = "CLARABEL",
    ) -> Self:
        """Gains by linear matrix inequalities; the criterion is told by what is given.

        Parameters
        ----------
        derivative
            PD/PI, or PI with Ld = 0.
        factor
            gamma over its floor, with the smallest matrices: the usual criterion.
        decay
            Instead, for PI: any gains with all poles left of -``decay`` [1/s].
        bound, radius
            Instead: the least gamma with all poles right of -``bound`` [1/s] and matrices of a norm
            within ``radius``.

        Raises
        ------
        InputError
            If two criteria are given, the solver fails, or the certificate does not hold.
        """
        if decay is not None and (bound is not None or derivative):
            raise InputError("decay", "is a criterion of its own, for PI, and goes without bound")
        found: Found
        augmented = system.augmented
        if decay is not None:
            found = pi.design_feasible(augmented, decay, solver)
        elif bound is not None:
            found = pd_pi.design_least_gamma(
                augmented, 0.0, bound, radius, solver, derivative=derivative
            )
        else:
            found = pd_pi.design(augmented, factor, solver=solver, derivative=derivative)
        gains = EsoGains(found.gains.L, found.gains.Ld, found.method, found.gamma)
        return cls(system=system, gains=gains)

    @cached_property
    def observer(self) -> ExtendedStateObserver:
        """The observer."""
        gains = Gains(self.gains.L, self.gains.Ld)
        return ExtendedStateObserver(
            self.system.augmented, gains, sampling_period=self.system.sampling_period
        )

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """The state and the faults."""
        return {
            "state": self.states,
            "actuator_fault": listed(self.system.actuator_faults),
            "sensor_fault": listed(self.system.sensor_faults),
        }

    def start(self) -> State | None:
        """The initial state without faults, the filter at rest at what it measures."""
        stated = self.system.initial_state
        if stated is None:
            return None
        x = np.asarray(stated, dtype=np.float64)
        filtered = self.system.C @ x
        faults = np.zeros(self.system.augmented.faults)
        return self.observer.init(np.concatenate([x, filtered, faults]), filtered)

    def certify(self) -> Certificate:
        """Poles, and bounds of the H-infinity norm, proved.

        Raises
        ------
        InputError
            If the observer is not stable, or its norm not below the promised gamma.
        """
        gains = self.observer.gains
        found = certify(self.system.augmented, gains, self.gains.gamma)
        if not found.holds:
            raise InputError("L", f"and Ld do not hold what they promise: {found.reason}")
        return {
            "poles": pairs(self.observer.poles),
            "norm_lower": found.norm_lower,
            "norm_upper": found.norm_upper,
            "floor": found.floor,
        }

    def summary(self) -> list[str]:
        """Poles and norm."""
        known = self.certificate
        return [
            f"extended state observer, {self.gains.method}",
            f"poles: {told(known['poles'])} 1/s",
            f"H-infinity norm from disturbances, noise and changes of faults to errors: at most "
            f"{known['norm_upper']:.6g}, proved; no gains get below {known['floor']:.6g}",
        ]

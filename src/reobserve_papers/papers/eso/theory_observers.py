"""Numbers of an observer from its error system (10), without a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.design import CertifiedGains
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso.deviation import held_deviation

Array = NDArray[np.float64]


class Design(Protocol):
    """A holder of the gains of an observer."""

    @property
    def gains(self) -> Gains:
        """The gains."""


Observers = Mapping[str, tuple[AugmentedSystem, Design]]  # systems and designs by name
Certified = Mapping[str, tuple[AugmentedSystem, CertifiedGains]]

_FAULTS = (("actuator", "V"), ("sensor", "rad/s"))
_SOURCES = {"disturbances": 2, "noise_too": 3, "all": 5}  # the first columns of Bo
_DURATION, _SAMPLE = 4.0, 0.01  # of the error after a jump [s]


@part
def certified(observers: Certified) -> Iterator[Metric]:
    """Norm, gamma and slowest pole of the certificates, and impulsive modes (Eo without rank)."""
    for name, (system, design) in observers.items():
        gamma = float("nan") if design.gamma is None else design.gamma
        slowest = -design.certificate.poles[0][0]
        yield Metric(name, "norm", design.certificate.norm_upper, "1")
        yield Metric(name, "gamma", gamma, "1")
        yield Metric(name, "slowest_pole", slowest, "1/s")
        impulsive = system.size - len(design.certificate.poles)
        yield Metric(name, "impulsive_modes", float(impulsive), "1")


@part
def missed(observers: Observers, frequency: float) -> Iterator[Metric]:
    """Share of a steady sinusoidal fault of this frequency [rad/s] that the estimate misses.

    By (10) with the input f' its error e is j w times a diagonal entry of (j w Eo - Ao)^-1 Bo. Of a
    fault of 1 the share is |e|. The estimate is 1 - e, so that without its lag | 1 - |1 - e| | is
    left.
    """
    s = 1j * frequency
    for name, (system, design) in observers.items():
        Ao, Eo = error_system(system, design.gains)
        errors = s * np.linalg.solve(s * Eo - Ao, system.Bo)
        for row, (fault, _) in enumerate(_FAULTS, start=-2):
            error = errors[row, row]
            for lag, share in (("counted", abs(error)), ("removed", abs(1.0 - abs(1.0 - error)))):
                score = f"missed_fast_{fault}_fault", float(share), "1"
                yield Metric.at(name, score, lag=lag)


@part
def left_of_jumps(observers: Observers, after: float) -> Iterator[Metric]:
    """Largest error from ``after`` [s] on, for a fault that jumps by one at zero.

    By (9) the initial error is the jump itself, and then e' = Eo^-1 Ao e.
    """
    from scipy.linalg import expm

    for name, (system, design) in observers.items():
        Ao, Eo = error_system(system, design.gains)
        A = np.linalg.solve(Eo, Ao)
        errors, step = np.eye(system.size)[:, -2:], expm(A * _SAMPLE)
        errors = expm(A * after) @ errors
        largest = np.abs(errors)
        for _ in range(round(_DURATION / _SAMPLE)):
            errors = step @ errors
            largest = np.maximum(largest, np.abs(errors))
        for row, (fault, _) in enumerate(_FAULTS, start=-2):
            yield Metric(name, f"left_of_{fault}_jump", float(largest[row, row]), "1")


@part
def held(
    observers: Observers, theory: keys.Theory, period: float, noise: float
) -> Iterator[Metric]:
    """Standard deviations of the estimates due to held noise and disturbances.

    Also computed is the share of each disturbance that is left. A constant disturbance of the speed
    gives a constant error of the sensor fault, one of the current an error of the actuator fault.
    The share is the standard deviation due to a random disturbance over that error. ``noise`` is
    the standard deviation of the noise [rad/s]. Each is taken at the ends of the holds, and as the
    mean over time.
    """
    low, high = np.array(theory.disturbance, dtype=float).T
    for name, (system, design) in observers.items():
        gains, (Ao, _) = design.gains, error_system(system, design.gains)
        for source, sizes in (
            ("noise", [0.0, 0.0, noise]),
            ("disturbance", [*(high - low) / np.sqrt(12.0), 0.0]),
        ):
            spread = held_deviation(system, gains, sizes, period)
            for at, values in spread._asdict().items():
                for (fault, unit), value in zip(_FAULTS, values[-2:], strict=True):
                    score = f"{source}_in_{fault}_fault", float(value), unit
                    yield Metric.at(name, score, at=at)
        at_rest = np.linalg.solve(Ao, system.Bo)
        for column, (source, row) in enumerate((("speed", -1), ("current", -2))):
            size = np.eye(3)[column]
            left = held_deviation(system, gains, size, period)
            for at, values in left._asdict().items():
                share = float(values[row] / abs(at_rest[row, column]))
                yield Metric.at(name, (f"{source}_disturbance_left", share, "1"), at=at)


@part
def norms(observers: Observers) -> Iterator[Metric]:
    """Norms of (10) from some of its inputs d, w and f' to all errors or those of the faults."""
    for name, (system, design) in observers.items():
        Ao, Eo = error_system(system, design.gains)
        for source, columns in _SOURCES.items():
            for to, errors in (("errors", system.size), ("faults", system.faults)):
                rows = np.eye(system.size)[-errors:]
                norm = h_infinity_norm(Ao, system.Bo[:, :columns], rows, E=Eo, tolerance=1e-9)
                yield Metric.at(name, ("norm", norm.upper, "1"), **{"from": source, "to": to})

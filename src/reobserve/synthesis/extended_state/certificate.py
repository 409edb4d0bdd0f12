"""Certificates of a design that owe nothing to the solver.

A solver's "optimal" may come with gains that make the observer unstable, or with a gamma that no
observer has. So all is computed again from the gains, as they are stored:

- the poles, the eigenvalues of Eo^-1 Ao, where they were asked to be;
- bounds of the H-infinity norm from dD to e, proved by Hamiltonian matrices of balls;
- the matrix inequality and P1 > 0, proved in balls, with Y formed from the gains: that alone proves
  that (10) is admissible, stable and has a norm below gamma;
- gamma not below the lower bound.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.matrices import Matrix, as_floats, as_positive, as_scalar
from reobserve.synthesis.definiteness import prove_negative_definite
from reobserve.synthesis.extended_state.gamma_bound import gamma_lower_bound
from reobserve.synthesis.extended_state.inequality import (
    PdPiVariables,
    PiVariables,
    in_balls,
    mapped,
)
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm

_BITS = 400  # leaves the radii negligible where the blocks are formed
_SLACK = 1e-12  # of the lower bound, its rounding


@dataclass(frozen=True)
class Certificate:
    """Certificate of an observer: its poles, its norm, and what fails.

    ``poles`` [1/s] are pairs of real and imaginary part, the slowest first. The norm from dD to e
    is between ``norm_lower`` and ``norm_upper``, and no gains have one below ``floor``. ``reason``
    says what fails, and is empty if nothing does.
    """

    poles: tuple[tuple[float, float], ...]
    norm_lower: float
    norm_upper: float
    floor: float
    reason: str

    @property
    def holds(self) -> bool:
        """True if nothing fails."""
        return not self.reason

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "poles": [list(pole) for pole in self.poles]}


def error_system(system: AugmentedSystem, gains: Gains) -> tuple[Matrix, Matrix]:
    """Ao = A~ - L C~ and Eo = I + Ld C~.

    Indriawati, Agustinah & Jazidie, (9) to (11), (15) and (20).
    """
    as_kind("system", system, AugmentedSystem)
    as_kind("gains", gains, Gains)
    shape = (system.size, system.outputs)
    for name in ("L", "Ld"):
        if (actual := as_floats(name, getattr(gains, name)).shape) != shape:
            raise InputError(name, f"has shape {actual}, must be {shape}")
    Ao = system.A_tilde - gains.L @ system.C_tilde
    return Ao, np.eye(system.size) + gains.Ld @ system.C_tilde


def certify(
    system: AugmentedSystem,
    gains: Gains,
    gamma: float | None = None,
    variables: PdPiVariables | PiVariables | None = None,
    decay: float = 0.0,
    bound: float = inf,
) -> Certificate:
    """Prove, or refute, what is promised of an observer.

    Parameters
    ----------
    system, gains
        The plant and the gains, which are taken as exact.
    gamma
        The promised bound of the norm; none is promised if left out.
    variables
        What a solver returned, of which P1 (its symmetric part), P2 and P3 are taken; left out,
        the promises are checked from the poles and the Hamiltonian alone.
    decay, bound
        Promised -``bound`` < Re s < -``decay`` of all poles [1/s].

    Raises
    ------
    InputError
        If there is no ``gamma`` for the inequality (19).
    """
    package("flint", "prove what an observer promises")
    gamma = gamma if gamma is None else as_positive("gamma", gamma)
    decay, bound = as_strip(decay, bound)
    if gamma is None and isinstance(variables, PdPiVariables):
        raise InputError("gamma", "must be given: (19) has one")
    floor = gamma_lower_bound(system)
    poles = _poles(system, gains)
    reasons = [
        _bound_reason(gamma, floor),
        _pole_reason(poles, decay, bound),
    ]
    if variables is not None:
        reasons.append(_prove(system, gains, gamma, variables, decay, bound))
    lower, upper, reason = _norm(system, gains)
    reasons.append(reason)
    if gamma is not None and upper > gamma:
        reasons.append(
            f"the H-infinity norm, {lower:.9g} to {upper:.9g}, is not proved to be below gamma "
            f"{gamma:.9g}"
        )
    pairs = tuple((float(pole.real), float(pole.imag)) for pole in poles)
    reason = next(filter(None, reasons), "")
    return Certificate(pairs, lower, upper, floor, reason)


def as_strip(decay: Any, bound: Any) -> tuple[float, float]:
    """The strip for poles, -``bound`` < Re s < -``decay`` [1/s]: 0 or more, and inf for any."""
    least = as_scalar("decay", decay)
    most = inf if isinstance(bound, float) and bound == inf else as_scalar("bound", bound)
    if 1e150 < most < inf:  # whose square is no float
        raise InputError("bound", f"{most:g} must be below 1e+150, or inf")
    if not 0 <= least < min(most, 1e150):
        raise InputError("decay", f"{least:g} must be at least zero and below the bound {most:g}")
    return least, most


def _poles(system: AugmentedSystem, gains: Gains) -> NDArray[np.complex128]:
    """The eigenvalues of Eo^-1 Ao, the slowest first, or none if Eo has no inverse."""
    Ao, Eo = error_system(system, gains)
    try:
        poles = np.linalg.eigvals(np.linalg.solve(Eo, Ao))
    except np.linalg.LinAlgError:
        return np.empty(0, complex)
    return np.asarray(poles[np.lexsort((poles.imag, -poles.real))], complex)


def _bound_reason(gamma: float | None, floor: float) -> str:
    if gamma is None or gamma >= floor * (1.0 - _SLACK):
        return ""
    return f"gamma {gamma:.9g} is below {floor:.9g}, which no gains get below"


def _pole_reason(poles: NDArray[np.complex128], decay: float, bound: float) -> str:
    if poles.size == 0:
        return "Eo = I + Ld C~ has no inverse"
    slowest, fastest = poles.real.max(), poles.real.min()
    if not slowest < -decay:
        return f"the pole {poles[0]:.6g} is not left of {0.0 - decay:g}"
    if not fastest > -bound:
        return f"a pole has real part {fastest:.6g}, not right of {-bound:g}"
    return ""


def _norm(system: AugmentedSystem, gains: Gains) -> tuple[float, float, str]:
    Ao, Eo = error_system(system, gains)
    try:
        norm = h_infinity_norm(Ao, system.Bo, np.eye(system.size), E=Eo)
    except InputError as error:
        return 0.0, inf, f"the error system (10) has no H-infinity norm: {error}"
    return norm.lower, norm.upper, ""


def _prove(
    system: AugmentedSystem,
    gains: Gains,
    gamma: float | None,
    variables: PdPiVariables | PiVariables,
    decay: float,
    bound: float,
) -> str:
    """The part of the inequality, or P1, that is not proved, or nothing."""
    from flint import arb_mat, ctx

    variables = replace(variables, P1=(variables.P1 + variables.P1.T) / 2.0)
    if not prove_negative_definite(-variables.P1):
        return "P1 is not proved to be positive definite"
    with ctx.workprec(_BITS):
        exact = mapped(variables, in_balls).with_gains(Gains(in_balls(gains.L), in_balls(gains.Ld)))
        sides = [
            arb_mat(np.block(rows).tolist())
            for rows in exact.inequalities(system, gamma, decay, bound)
        ]
    proofs = [prove_negative_definite(side) for side in sides]
    if all(proofs):
        return ""
    verdict = "refuted" if False in proofs else "not proved"
    return f"the matrix inequality is {verdict} at the returned matrices"

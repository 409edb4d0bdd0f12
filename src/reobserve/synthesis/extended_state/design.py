"""Designs: gains with their certificate, the distance of an optimum from the best, and files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.synthesis.extended_state.central_path import Problem, minimiser
from reobserve.synthesis.extended_state.certificate import Certificate, certify
from reobserve.synthesis.extended_state.feasible_point import SOLVERS, strictly_feasible
from reobserve.synthesis.extended_state.inequality import Variables
from reobserve.synthesis.extended_state.matrix_terms import Units
from reobserve.synthesis.extended_state.polishing import polished
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains


@dataclass(frozen=True, eq=False)
class CertifiedGains:
    """Gains that a certificate holds for, and how they were found.

    ``gamma`` is the proved bound of the norm from dD to e, or none if none was asked for;
    ``objective`` is what was minimised, from matrices that ``solver`` ended at with ``status``. No
    matrices that meet the inequalities have an objective below ``lower``, which is proved; where
    there is a ``radius``, no matrices whose Frobenius norm is within it. Both are none if nothing
    was minimised or bounded.
    """

    method: str
    gains: Gains
    gamma: float | None
    solver: str
    status: str
    objective: float
    certificate: Certificate
    lower: float | None = None
    radius: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "method": self.method,
            "L": self.gains.L.tolist(),
            "Ld": self.gains.Ld.tolist(),
            "gamma": self.gamma,
            "solver": self.solver,
            "status": self.status,
            "objective": self.objective,
            "lower": self.lower,
            "radius": self.radius,
            "certificate": self.certificate.to_dict(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> CertifiedGains:
        """The design that `to_dict` was called on, or `InputError` if it is none of that kind."""
        from reobserve.core.validation import parse

        rest = {name: value for name, value in values.items() if name not in {"L", "Ld"}}
        gains = {name: values[name] for name in ("L", "Ld") if name in values}
        return parse(cls, {**rest, "gains": gains}, "design")


def accepted(
    method: str,
    system: AugmentedSystem,
    variables: Variables,
    gamma: float | None,
    solver: str,
    status: str,
    objective: float,
    decay: float = 0.0,
    bound: float = inf,
) -> CertifiedGains:
    """The design of what a solver returned, arrays of floats, if its certificate holds."""
    package("flint", "prove a design")
    try:
        gains = variables.gains()
    except np.linalg.LinAlgError:
        raise InputError("solver", f"{solver} said {status}, but P has no inverse") from None
    certificate = certify(system, gains, gamma, variables, decay, bound)
    if not certificate.holds:
        raise InputError("solver", f"{solver} said {status}, but {certificate.reason}")
    return CertifiedGains(method, gains, gamma, solver, status, objective, certificate)


def in_some_units(
    attempt: Callable[[Units | None], CertifiedGains],
    even: Callable[[], Units],
    solver: str,
    advice: str,
) -> CertifiedGains:
    """The design in the units of the system or, if a solver finds none, in even ones.

    Raises
    ------
    InputError
        As `optimised` in the units of the system, with what else might help.
    """
    try:
        return attempt(None)
    except InputError as error:
        if error.parameter != "solver" or not isinstance(solver, str) or solver not in SOLVERS:
            raise
        said = str(error).removeprefix("solver: ")
    try:
        return attempt(even())
    except InputError:
        raise InputError("solver", f"{said}; {advice}") from None


def optimised(
    method: str,
    system: AugmentedSystem,
    problem: Problem,
    kind: type[Variables],
    gamma: float | None,
    solver: str,
    decay: float = 0.0,
    bound: float = inf,
    units: Units | None = None,
) -> CertifiedGains:
    """The design at the minimiser of ``problem``, if its certificate holds.

    A solver finds where to begin, Newton's method the minimiser, and polishing all its digits.

    Parameters
    ----------
    kind
        Of the matrices; one that the problem does not have is zero.
    gamma
        The promised bound of the norm, none if there is none or if the problem finds it.
    units
        That the problem is stated in, those of the system if left out. The certificate is in the
        units of the system in any case.

    Raises
    ------
    InputError
        If the solver is unknown, fails or ends with another status than "optimal", the radius
        leaves nothing feasible, no minimiser is found from there, or the certificate does not hold.
    """
    package("flint", "prove a design")  # refuse before the solver runs
    start, status = strictly_feasible(problem, solver)
    minimum = polished(problem, minimiser(problem, start))
    x = np.array([float(entry) for entry in minimum.x])
    objective = float(problem.weights @ x**2)
    if problem.radius is not None:
        objective = gamma = float(x[-1])
    matrices = problem.matrices(x)
    matrices = matrices if units is None else units.original(matrices)
    nothing = np.zeros((system.outputs, system.size))
    variables = kind(*(matrices.get(field.name, nothing) for field in fields(kind)))
    design = accepted(method, system, variables, gamma, solver, status, objective, decay, bound)
    return replace(design, lower=minimum.lower, radius=problem.radius)

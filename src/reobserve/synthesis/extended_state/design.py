"""Designs: gains with their certificate, found by a solver of matrix inequalities and stored."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from reobserve.errors import InputError
from reobserve.synthesis.extended_state.certificate import Certificate, certify
from reobserve.synthesis.extended_state.inequality import Variables, mapped
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.typed_data import typed

SOLVERS: dict[str, dict[str, Any]] = {
    "CLARABEL": {},
    "SCS": {"eps": 1e-9, "max_iters": 200_000},
}

# Eigenvalues of the inequalities stay so far below zero: a solver meets them to about 1e-8 times
# the size of its matrices, which is a few units here.
_STRICT = 1e-7


@dataclass(frozen=True, eq=False)
class Design:
    """Gains that a certificate holds for, and how they were found.

    ``gamma`` is the proved bound of the norm from dD to e, or none if none was asked for;
    ``objective`` is what ``solver`` minimised, it ended with ``status``.
    """

    method: str
    gains: Gains
    gamma: float | None
    solver: str
    status: str
    objective: float
    certificate: Certificate

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
            "certificate": self.certificate.to_dict(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], place: str = "design") -> Design:
        """The design that `to_dict` was called on; `InputError` if it is none of that kind."""
        rest = {name: value for name, value in values.items() if name not in {"L", "Ld"}}
        gains = {name: values[name] for name in ("L", "Ld") if name in values}
        return typed(cls, {**rest, "gains": gains}, place)


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
    hamiltonian: bool = True,
) -> Design:
    """The design of what a solver returned, arrays of floats, if its certificate holds.

    Raises
    ------
    InputError
        If it does not, with the reason.
    """
    try:
        gains = variables.gains()
    except np.linalg.LinAlgError:
        raise InputError("solver", f"{solver} said {status}, but P has no inverse") from None
    certificate = certify(system, gains, gamma, variables, decay, bound, hamiltonian)
    if not certificate.holds:
        raise InputError("solver", f"{solver} said {status}, but {certificate.reason}")
    return Design(method, gains, gamma, solver, status, objective, certificate)


def solved(
    method: str,
    system: AugmentedSystem,
    variables: Variables,
    gamma: Any,
    objective: Any,
    constraints: list[Any],
    solver: str,
    decay: float = 0.0,
    bound: float = inf,
    strict: float = _STRICT,
) -> Design:
    """Minimise ``objective`` over cvxpy's ``variables``, and accept what comes out.

    The inequalities of ``variables``, with eigenvalues below -``strict``, are added to
    ``constraints``; ``gamma`` is a number, none or a variable, too.

    Raises
    ------
    InputError
        If the solver is unknown, fails or ends with another status than "optimal", or if the
        certificate of its solution does not hold.
    """
    import cvxpy
    from cvxpy.atoms.affine.bmat import bmat

    if solver not in SOLVERS:
        raise InputError("solver", f"{solver!r} must be one of {', '.join(SOLVERS)}")
    blocks: Any = bmat
    sides = [blocks(rows) for rows in variables.inequalities(system, gamma, decay, bound)]
    negative = [side << -strict * np.eye(side.shape[0]) for side in sides]
    problem: Any = cvxpy.Problem(cvxpy.Minimize(objective), [*constraints, *negative])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccuracy, which the status tells
            problem.solve(solver=solver, **SOLVERS[solver])
    except cvxpy.SolverError as error:
        raise InputError("solver", f"{solver} failed: {str(error).splitlines()[0]}") from None
    if problem.status != "optimal":
        raise InputError("solver", f"{solver} ended with status {problem.status!r}, not 'optimal'")
    value = gamma if gamma is None or isinstance(gamma, float) else float(gamma.value)
    return accepted(
        method,
        system,
        mapped(variables, _value),
        value,
        solver,
        problem.status,
        float(problem.value),
        decay,
        bound,
    )


def _value(matrix: Any) -> Any:
    """What the solver found for a variable; a matrix that is none stays."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.value

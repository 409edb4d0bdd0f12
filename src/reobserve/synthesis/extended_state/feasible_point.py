"""Matrices that meet the inequalities strictly, from a solver: where Newton's method begins."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.synthesis.extended_state.central_path import Constraint, Problem, Vector

SOLVERS: dict[str, dict[str, Any]] = {
    "CLARABEL": {"tol_gap_abs": 1e-5, "tol_gap_rel": 1e-5},  # nearer would be beyond the minimiser
    "SCS": {"eps": 1e-6, "max_iters": 200_000},
}

# Eigenvalues of all constraints stay above these, a hundred times what each misses inequalities by.
# Where gamma is unknown all of the central path is still to go, and the wider is right.
_STRICT = {"CLARABEL": 1e-6, "SCS": 1e-4}
_WIDE = 1e-4


def strictly_feasible(problem: Problem, solver: str) -> tuple[Vector, str]:
    """The smallest matrices, and gamma if it is unknown, as to the sum of all squares.

    With them comes the status of the solver.

    Raises
    ------
    InputError
        If the solver is unknown, fails or ends with another status than "optimal", or the smallest
        matrices are outside the radius.
    """
    cvxpy = package("cvxpy", "solve matrix inequalities")
    if solver not in SOLVERS:
        raise InputError("solver", f"{solver!r} must be one of {', '.join(SOLVERS)}")
    unknowns = {
        name: cvxpy.Variable(shape, symmetric=name in problem.symmetric)
        for name, shape in problem.shapes.items()
    }
    gamma: Any = cvxpy.Variable()
    squared = [*unknowns.values(), *([] if problem.radius is None else [gamma])]
    constraints = [_expression(constraint, unknowns, gamma) for constraint in problem.constraints]
    strict = _STRICT[solver] if problem.radius is None else _WIDE
    bounds = [constraint >> strict * np.eye(constraint.shape[0]) for constraint in constraints]
    stated: Any = cvxpy.Problem(
        cvxpy.Minimize(sum(cvxpy.sum_squares(each) for each in squared)), bounds
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccuracy, which the status tells
            stated.solve(solver=solver, **SOLVERS[solver])
    except (cvxpy.SolverError, ValueError) as error:  # ValueError: constraints that overflow
        said = str(error).splitlines()[0].rstrip(".")
        raise InputError("solver", f"{solver} failed: {said}") from None
    if stated.status != "optimal":
        raise InputError("solver", f"{solver} ended with status {stated.status!r}, not 'optimal'")
    found = {name: np.array(each.value) for name, each in unknowns.items()}
    start = problem.vector(found, None if problem.radius is None else gamma.value.item())
    size = float(np.sqrt(problem.weights @ start**2))
    if problem.radius is not None and size >= problem.radius:
        raise InputError("radius", f"{problem.radius:g} must be above {size:.6g}: no matrices fit")
    return start, stated.status


def _expression(constraint: Constraint, unknowns: dict[str, Any], gamma: Any) -> Any:
    from scipy.sparse import csr_array

    half = sum(
        csr_array(term.left) @ unknowns[term.name] @ csr_array(term.right)
        for term in constraint.terms
    )
    found = constraint.constant + half + half.T
    return found if constraint.slope is None else found + constraint.slope * gamma

"""Matrices that meet the inequalities strictly, from a solver: where Newton's method begins."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from reobserve.core.arguments import as_word
from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.synthesis.extended_state.central_path import Constraint, Problem, Stack, Vector

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
    """
    cvxpy = package("cvxpy", "solve matrix inequalities")
    as_word("solver", solver, [*SOLVERS])
    # Stated as one vector, which cvxpy compiles in a fifth of the time of the matrices.
    x: Any = cvxpy.Variable(len(problem.weights))
    strict = _STRICT[solver] if problem.radius is None else _WIDE
    bounds = []
    for constraint, stack in zip(problem.constraints, problem.stacks, strict=True):
        rows = len(constraint.constant)
        half = cvxpy.reshape(_derivatives(constraint, stack, x.size) @ x, (rows, rows), order="C")
        bounds.append(constraint.constant + half >> strict * np.eye(rows))
    weights = problem.weights.copy()
    if problem.radius is not None:
        weights[-1] = 1.0
    program: Any = cvxpy.Problem(
        cvxpy.Minimize(cvxpy.sum_squares(cvxpy.multiply(np.sqrt(weights), x))), bounds
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccuracy, which the status tells
            program.solve(solver=solver, **SOLVERS[solver])
    except (cvxpy.SolverError, ValueError) as error:  # ValueError: constraints that overflow
        said = str(error).splitlines()[0].rstrip(".")
        raise InputError("solver", f"{solver} failed: {said}") from None
    if program.status != "optimal":
        raise InputError("solver", f"{solver} ended with status {program.status!r}, not 'optimal'")
    start = np.array(x.value)
    size = float(np.sqrt(problem.weights @ start**2))
    if problem.radius is not None and size >= problem.radius:
        raise InputError("radius", f"{problem.radius:g} must be above {size:.6g}: no matrices fit")
    return start, program.status


def _derivatives(constraint: Constraint, stack: Stack, size: int) -> Any:
    """The derivatives of S by the entries of the vector, a column each, of S by rows."""
    from scipy.sparse import csr_array

    halves = stack.left.T[stack.rows, :, None] * stack.right[stack.columns, None, :]
    derivatives = stack.folded(halves + halves.transpose(0, 2, 1), size)
    if constraint.slope is not None:
        derivatives[-1] = constraint.slope
    return csr_array(derivatives.reshape(size, -1).T)

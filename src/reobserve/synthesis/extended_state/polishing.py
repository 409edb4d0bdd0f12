"""Minimisers of the central path to more digits than floats have, and a proof of how good they are.

Newton's method is repeated with the gradient in balls of 256 bits. The Hessian in floats will do:
it is wrong by a part that makes each step reduce the error by some digits, not by all. What is left
once the steps are below 2^-96 of the unknowns owes nothing to solver, start or processor.

Weak duality: for any Z >= 0, one for each constraint, with sum of tr(Z slope) = 1, and lambda > 0
any matrices inside the radius that meet the inequalities have

    gamma >= - sum of tr(Z constant) - |G|^2 / (4 lambda) - lambda radius^2,

where G is the derivative of the sum of tr(Z S) by the matrices, and the term with it what lambda
times their squares, less tr(G^T X), is at least. A sum of squares is the case without slopes, with
lambda = 1 and radius = 0. Here Z is the multiple of S^-1 that makes the minimiser stationary, and
lambda the same multiple of 1 / (radius^2 - squares), all in balls.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.synthesis.definiteness import ball_matrix, is_negative_definite
from reobserve.synthesis.extended_state.central_path import Problem, Vector, newton_step

if TYPE_CHECKING:
    from flint import arb, arb_mat

_BITS = 256
_SMALL = 2.0**-96  # of the largest unknown: a step that changes no float any more
_STEPS = 60  # at most; each gains three digits or more


class Minimum(NamedTuple):
    """Minimum at ``x``, balls without radius, with no objective (no barrier) below ``lower``."""

    x: Any
    lower: float


class _BallConstraint(NamedTuple):
    constant: arb_mat
    terms: list[tuple[str, arb_mat, arb_mat]]
    slope: arb_mat | None


@np.errstate(all="ignore")  # of what is not finite no step becomes small
def polished(problem: Problem, start: Vector) -> Minimum:
    """The minimiser to all digits of a float and more, from one to some digits."""
    flint = package("flint", "polish a design")
    arb, ctx = flint.arb, flint.ctx
    too_flat = InputError(
        "solver", "found matrices from which rounding forbids to find better ones"
    )
    try:
        step_of = newton_step(problem, start)
    except np.linalg.LinAlgError:
        raise too_flat from None
    with ctx.workprec(_BITS):
        constraints = [_in_balls(constraint) for constraint in problem.constraints]
        x = np.array([arb(value) for value in start.tolist()])
        largest, before = float(np.abs(start).max()), np.inf
        for _ in range(_STEPS):
            gradient = _gradient(problem, constraints, x)
            step = step_of(np.array([float(entry.mid()) for entry in gradient]))
            size = float(np.abs(step).max())
            if not size < before:
                break
            x = np.array([(a + arb(b)).mid() for a, b in zip(x, step.tolist(), strict=True)])
            if size < _SMALL * largest:
                return Minimum(x, _lower(problem, constraints, x))
            before = size
    raise too_flat


def _in_balls(constraint: Any) -> _BallConstraint:
    terms = [
        (term.name, ball_matrix(term.left), ball_matrix(term.right)) for term in constraint.terms
    ]
    slope = None if constraint.slope is None else ball_matrix(constraint.slope)
    return _BallConstraint(ball_matrix(constraint.constant), terms, slope)


def _left(problem: Problem, constraint: _BallConstraint, x: Any) -> arb_mat:
    """S."""
    from flint import arb_mat

    matrices = {name: arb_mat(m.tolist()) for name, m in problem.matrices(x).items()}
    halves = [left * matrices[name] * right for name, left, right in constraint.terms]
    half = sum(halves[1:], halves[0])
    side = constraint.constant + half + half.transpose()
    return side if constraint.slope is None else side + constraint.slope * x[-1]


def _pull(problem: Problem, x: Any) -> arb:
    """The derivative of what is minimised by the sum of squares."""
    from flint import arb

    squares = sum(
        (arb(w) * v * v for w, v in zip(problem.weights.tolist(), x, strict=True)), arb(0)
    )
    if problem.radius is None:
        return problem.slant / squares
    return 1 / (arb(problem.radius) ** 2 - squares)


def _gradient(problem: Problem, constraints: list[_BallConstraint], x: Any) -> Any:
    pull = 2 * _pull(problem, x)
    gradient = np.array([v * w * pull for v, w in zip(x, problem.weights.tolist(), strict=True)])
    if problem.radius is not None:
        gradient[-1] = gradient[-1] + problem.slant
    for constraint in constraints:
        inverse = _left(problem, constraint, x).inv()
        for name, full in _derivatives(constraint, inverse):
            gradient[problem.places[name]] -= problem.fold(name, _array(full))
        if constraint.slope is not None:
            gradient[-1] -= _inner(inverse, constraint.slope)
    return gradient


def _derivatives(constraint: _BallConstraint, Z: arb_mat) -> list[tuple[str, arb_mat]]:
    """Derivatives of tr(Z S), by each matrix."""
    return [
        (name, left.transpose() * Z * right.transpose() * 2)
        for name, left, right in constraint.terms
    ]


def _lower(problem: Problem, constraints: list[_BallConstraint], x: Any) -> float:
    """A proved lower bound of the objective, -inf where a constraint is not proved."""
    from flint import arb, arb_mat

    lefts = [_left(problem, constraint, x) for constraint in constraints]
    if not all(is_negative_definite(-left) for left in lefts):
        return -np.inf
    inverses = [left.inv() for left in lefts]
    pull = _pull(problem, x)
    scale = 1 / pull
    if problem.radius is not None:
        parts = [
            _inner(inverse, constraint.slope)
            for inverse, constraint in zip(inverses, constraints, strict=True)
            if constraint.slope is not None
        ]
        scale = 1 / sum(parts[1:], parts[0])
    bound = arb(0)
    derivatives = {name: arb_mat(*shape) for name, shape in problem.shapes.items()}
    for inverse, constraint in zip(inverses, constraints, strict=True):
        Z = inverse * scale
        bound -= _inner(Z, constraint.constant)
        for name, full in _derivatives(constraint, Z):
            derivatives[name] += full
    weight = pull * scale  # lambda
    for name, full in derivatives.items():
        half = (full + full.transpose()) / 2 if name in problem.symmetric else full
        bound -= _inner(half, half) / (4 * weight)
    if problem.radius is not None:
        bound -= weight * arb(problem.radius) ** 2
    return float(np.nextafter(float(bound.lower()), -np.inf))


def _inner(left: arb_mat, right: arb_mat) -> arb:
    from flint import arb

    return sum((a * b for a, b in zip(left.entries(), right.entries(), strict=True)), arb(0))


def _array(matrix: arb_mat) -> Any:
    return np.array(matrix.entries()).reshape(matrix.nrows(), matrix.ncols())

"""Smooth problems with matrix inequalities: points of the central path, by Newton's method.

Unknown are matrices X, and gamma if a constraint has a slope in it. Of all of them with

    S = constant + gamma slope + sum of (L X R + R^T X^T L^T) > 0

for each constraint, those with the minimum sum of squares of all entries are asked for, or those
with the minimum gamma that have a sum of squares below a radius squared. But the latter need not
exist, and of the former a solver, which finds their squares to 1e-8, finds the entries to 1e-4. So
it is

    (rows / gap) log(squares) - sum of log det S      or
    ((rows + 1) / gap) gamma - log(radius^2 - squares) - sum of log det S

that is minimised, with the number of rows of all S. The minimiser is a point of the central path:
unique, as the second is strictly convex and the first is stationary at one point only (along the
path the squares over the weight of the barrier fall), and it moves smoothly with the data. A
multiple of all S^-1 is feasible for the dual, so that gamma exceeds the optimum by no more than the
gap, and the squares by no more than that part of themselves.

Here the unknowns are one vector, of floats: X1, X2, ... by rows, of a symmetric one the lower
triangle, then gamma. Its last digits depend on the processor; `polishing` removes that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from math import inf, log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix

Vector = NDArray[np.float64]
Places = NDArray[np.intp]

_LARGEST = (1.0, 1e3, 1e8)  # mu, by which the barrier is multiplied, to begin with
_FACTOR = 0.2  # from one mu to the next
_STEPS = 100  # of Newton's method for one mu; some ten are usual
_SHORTEST = 1e-10  # part of a step: less is rounding
_CLOSE = 0.1  # decrement from which on whole steps converge quadratically
_FINEST = 1e-12  # decrement that `polishing` may start from


@dataclass(frozen=True, eq=False)
class MatrixTerm:
    """L X R of the matrix called ``name``."""

    name: str
    left: Matrix
    right: Matrix


@dataclass(frozen=True, eq=False)
class Constraint:
    """A symmetric matrix S that must be positive definite, without gamma if it has no slope."""

    constant: Matrix
    terms: tuple[MatrixTerm, ...]
    slope: Matrix | None = None


class Stack(NamedTuple):
    """The terms of a constraint as one, with all L side by side and all R below each other.

    Entry e of their matrices stands between column ``rows[e]`` of L and row ``columns[e]`` of R.
    Each of ``layers`` has places in the vector, and an entry that is at each of them.
    """

    left: Matrix
    right: Matrix
    rows: Places
    columns: Places
    layers: list[tuple[Places, Places]]

    def folded(self, full: Matrix, size: int) -> Matrix:
        """Derivatives by the entries as derivatives by a vector, along the first axis."""
        derivatives = np.zeros((size, *full.shape[1:]))
        for places, entries in self.layers:
            derivatives[places] += full[entries]
        return derivatives


@dataclass(frozen=True, eq=False)
class Problem:
    """The problem of this module, with matrices of the ``shapes``, some of them ``symmetric``.

    ``gap`` is a part of the squares, or of gamma itself; ``radius`` is none if the squares are
    minimised, and then gamma is not unknown.
    """

    shapes: dict[str, tuple[int, int]]
    symmetric: frozenset[str]
    constraints: tuple[Constraint, ...]
    gap: float
    radius: float | None = None

    @cached_property
    def slant(self) -> float:
        """The factor of gamma, or of the logarithm of the squares."""
        rows = sum(len(constraint.constant) for constraint in self.constraints)
        return (rows + (self.radius is not None)) / self.gap

    @cached_property
    def places(self) -> dict[str, slice]:
        """The place of each matrix in the vector."""
        places, first = {}, 0
        for name, (rows, columns) in self.shapes.items():
            size = rows * (rows + 1) // 2 if name in self.symmetric else rows * columns
            places[name] = slice(first, first + size)
            first += size
        return places

    @cached_property
    def weights(self) -> Vector:
        """The number of times that each entry of the vector counts among the squares."""
        ones = [self.fold(name, np.ones(shape)) for name, shape in self.shapes.items()]
        return np.concatenate([*ones, np.zeros(0 if self.radius is None else 1)])

    @cached_property
    def stacks(self) -> list[Stack]:
        """The stacked terms of each constraint."""
        size = sum(part.stop - part.start for part in self.places.values())
        place_of = self.matrices(np.arange(size))
        stacks = []
        for constraint in self.constraints:
            names = [term.name for term in constraint.terms]
            ends = np.cumsum([(0, 0), *(self.shapes[name] for name in names)], axis=0)
            entries = [np.indices(self.shapes[name]).reshape(2, -1) for name in names]
            moved = [entry + end[:, None] for entry, end in zip(entries, ends[:-1], strict=True)]
            (i, j), vector = np.hstack(moved), np.hstack([place_of[name].ravel() for name in names])
            layers = []
            rest = np.arange(len(vector))
            while len(rest):
                places, first = np.unique(vector[rest], return_index=True)
                layers.append((places, rest[first]))
                rest = np.delete(rest, first)
            left = np.hstack([term.left for term in constraint.terms])
            right = np.vstack([term.right for term in constraint.terms])
            stacks.append(Stack(left, right, i, j, layers))
        return stacks

    def matrices(self, x: Any) -> dict[str, Any]:
        """The vector, of floats or balls, as matrices."""
        matrices = {}
        for name, shape in self.shapes.items():
            part, matrix = x[self.places[name]], np.empty(shape, x.dtype)
            if name in self.symmetric:
                rows, columns = _lower(shape[0])
                matrix[rows, columns] = matrix[columns, rows] = part
            else:
                matrix[:] = part.reshape(shape)
            matrices[name] = matrix
        return matrices

    def fold(self, name: str, full: Any) -> Any:
        """A derivative by each entry of a matrix as one by those entries that are in the vector."""
        if name not in self.symmetric:
            return full.reshape(-1, *full.shape[2:])
        rows, columns = _lower(len(full))
        derivatives = full[rows, columns]
        off = rows != columns
        derivatives[off] += full[columns[off], rows[off]]
        return derivatives


@cache
def _lower(size: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of a lower triangle, which Newton's method asks some thousand times."""
    rows, columns = np.tril_indices(size)
    return rows, columns


def minimiser(problem: Problem, start: Vector) -> Vector:
    """The minimiser up to rounding, by Newton's method.

    Parameters
    ----------
    problem, start
        All constraints must be positive definite at the start, and the squares below the radius.
    """
    if not np.isfinite(_value(problem, start, 1.0)):
        raise InputError("solver", "found matrices that do not meet the inequalities strictly")
    # The straight way is the shortest, one along the central path leads there from farther away.
    for largest in _LARGEST:
        mu, point = largest, _centred(problem, start, largest)
        while point is not None and mu > 1.0:
            mu = max(_FACTOR * mu, 1.0)
            point = _centred(problem, point, mu)
        if point is not None:
            return point
    if problem.radius is not None:
        raise InputError("gap", f"{problem.gap:g} is not reached by Newton's method: raise it")
    raise InputError("solver", "found matrices from which Newton's method does not converge")


def newton_step(problem: Problem, x: Vector, mu: float = 1.0) -> Callable[[Vector], Vector]:
    """The map from a gradient to Newton's step, with the Hessian at ``x`` factored once."""
    from scipy.linalg import cho_factor, cho_solve

    hessian = _hessian(problem, x, mu)
    scale = 1.0 / np.sqrt(np.diag(hessian))
    hessian *= scale
    hessian *= scale[:, None]
    # Fortran's order of a symmetric matrix, which is not copied then.
    factor = cho_factor(hessian.T, overwrite_a=True, check_finite=False)
    return lambda gradient: -scale * cho_solve(factor, scale * gradient, check_finite=False)


def _centred(problem: Problem, x: Vector, mu: float) -> Vector | None:
    """The point where the decrement is small or, for the last mu, falls no more, or none."""
    finest = _FINEST if mu == 1.0 else _CLOSE
    before = inf
    for _ in range(_STEPS):
        gradient = _gradient(problem, x, mu)
        try:
            step = newton_step(problem, x, mu)(gradient)
        except np.linalg.LinAlgError:
            break
        decrement = -float(gradient @ step) / mu
        if decrement < finest or (before < _CLOSE and decrement > before / 2.0):
            return x
        size = 1.0
        if decrement > _CLOSE:
            value = _value(problem, x, mu)
            while _value(problem, x + size * step, mu) > value - 0.1 * size * decrement * mu:
                size /= 2.0
                if size < _SHORTEST:
                    return None
        x, before = x + size * step, decrement
    return x if before < _CLOSE else None


def _value(problem: Problem, x: Vector, mu: float) -> float:
    squares = float(problem.weights @ x**2)
    if problem.radius is None:
        value = problem.slant * log(squares)
    elif (interior := problem.radius**2 - squares) > 0:
        value = problem.slant * float(x[-1]) - mu * log(interior)
    else:
        return inf
    for left in _left_sides(problem, x):
        try:
            factor = np.linalg.cholesky(left)
        except np.linalg.LinAlgError:
            return inf
        value -= 2.0 * mu * float(np.log(np.diag(factor)).sum())
    return value


def _left_sides(problem: Problem, x: Vector) -> list[Matrix]:
    matrices = problem.matrices(x)
    sides = []
    for constraint in problem.constraints:
        half = sum(term.left @ matrices[term.name] @ term.right for term in constraint.terms)
        left = constraint.constant + half + half.T
        sides.append(left if constraint.slope is None else left + x[-1] * constraint.slope)
    return sides


def _pull(problem: Problem, x: Vector, mu: float) -> tuple[float, float]:
    """First and second derivative by the sum of squares.

    The second one of the logarithm is left out, which would make the Hessian indefinite afar: it is
    but the part ``gap`` of what the constraints give, and Newton's steps err by no more.
    """
    squares = float(problem.weights @ x**2)
    if problem.radius is None:
        return problem.slant / squares, 0.0
    interior = problem.radius**2 - squares
    return mu / interior, mu / interior**2


def _gradient(problem: Problem, x: Vector, mu: float) -> Vector:
    gradient = 2.0 * _pull(problem, x, mu)[0] * problem.weights * x
    if problem.radius is not None:
        gradient[-1] = problem.slant
    for constraint, left, stack in _with_stacks(problem, x):
        inverse = np.linalg.inv(left)
        full = 2.0 * stack.left.T @ inverse @ stack.right.T
        gradient -= mu * stack.folded(full[stack.rows, stack.columns], len(x))
        if constraint.slope is not None:
            gradient[-1] -= mu * float(np.sum(inverse * constraint.slope))
    return gradient


def _hessian(problem: Problem, x: Vector, mu: float) -> Matrix:
    pull, curvature = _pull(problem, x, mu)
    outer = 2.0 * problem.weights * x
    hessian = np.diag(2.0 * pull * problem.weights)
    if curvature:
        hessian += curvature * np.outer(outer, outer)
    for constraint, left, stack in _with_stacks(problem, x):
        inverse = np.linalg.inv(left)
        inverse = (inverse + inverse.T) / 2.0
        hessian += mu * _mixed(inverse, stack, len(x))
        if constraint.slope is not None:
            turned = inverse @ constraint.slope @ inverse
            full = 2.0 * mu * stack.left.T @ turned @ stack.right.T
            hessian[:, -1] += stack.folded(full[stack.rows, stack.columns], len(x))
            hessian[-1, -1] += mu * float(np.sum(turned * constraint.slope))
    if problem.radius is not None:
        hessian[-1, :-1] = hessian[:-1, -1]
    return hessian


def _with_stacks(problem: Problem, x: Vector) -> Iterator[tuple[Constraint, Matrix, Stack]]:
    """The constraints with S and the stacked terms of each."""
    return zip(problem.constraints, _left_sides(problem, x), problem.stacks, strict=True)


def _mixed(inverse: Matrix, stack: Stack, size: int) -> Matrix:
    """Derivatives of -log det S by two entries of the vector: tr(S^-1 dS S^-1 dS')."""
    i, j, left, right = stack.rows, stack.columns, stack.left, stack.right
    turned = left.T @ inverse
    crossed = turned @ right.T
    full = (turned @ left)[i][:, i] * (right @ inverse @ right.T)[j][:, j]
    full += crossed[i][:, j] * crossed.T[j][:, i]
    full *= 2.0
    return stack.folded(np.ascontiguousarray(stack.folded(full, size).T), size)

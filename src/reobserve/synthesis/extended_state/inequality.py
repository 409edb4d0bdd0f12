"""The matrix inequality (19) of the PD/PI observer, and that of the PI observer.

The paper's page with (25) to (37) is derived again. The error (10) with output e has the transfer
matrix G(s) = (s Eo - Ao)^-1 Bo. Its dual Eo^T z' = Ao^T z + v, yz = Bo^T z has G^T, thus the same
norm; its input v has N entries, not those of dD as (22) and (24) print. With za = z' as a second
half of the state, and S = Eo^T = I + C~^T Ld^T and M = Ao^T = A~^T - C~^T L^T, it is

    [ I  0 ] [ z'  ]   [ 0   I ] [ z  ]   [ 0 ]             [ z  ]
    [ 0  0 ] [ za' ] = [ M  -S ] [ za ] + [ I ] v,   [Bo^T 0] [ za ].

E P = P^T E^T >= 0 of Lemma 1 leaves P = [P1 0; P2 P3] with P1 = P1^T >= 0 and any P2, P3. Then

    A P + P^T A^T = [ P2 + P2^T    P3 + P1 M^T - P2^T S^T ]      B = [ 0 ],    P^T C^T = [ P1 Bo ].
                    [    *          -S P3 - P3^T S^T      ],         [ I ]               [   0   ]

The gains stand in products with P only: with Lea = [L^T Ld^T] and Y = [Y1 Y2] = Lea P,

    P1 L + P2^T Ld = Y1^T,    P3^T Ld = Y2^T,

and (18) becomes (19), linear in P1, P2, P3, Y1, Y2 and gamma. The second diagonal block can be
negative only if P3 and Eo have inverses; hence P has one, too, and [L; Ld] = (Y P^-1)^T.

Poles. For a decay alpha, (E, A + alpha E) stands for (E, A), which adds 2 alpha P1 to the first
block: all poles then have Re s < -alpha. For Re s > -beta, (E, -A - beta E) must be admissible.
With [P1 0; P2 -P3] for P its inequality has the same Y1 and Y2, as -A P - P^T A^T is

    [ -P2 - P2^T - 2 beta P1    P3 - P1 M^T + P2^T S^T ]
    [            *                -S P3 - P3^T S^T     ].

The PI observer has Ld = 0, and the bounded real lemma for e' = Ao e + Bo dD needs P1 only:

    [ P1 Ao + Ao^T P1    I       P1 Bo    ]
    [      *          -gamma I     0      ]  < 0,      P1 L = Y^T,    P1 Ao = P1 A~ - Y^T C~,
    [      *             *      -gamma I  ]

or gamma (P1 Ao + Ao^T P1) + I + P1 Bo Bo^T P1 < 0 with the Schur complement of the last two blocks.
Nothing is lost against (19): P2 = Ao^T P1, P3 = I / gamma turn this inequality into that one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from math import inf, isfinite
from typing import Any, TypeVar

import numpy as np

from reobserve.core.matrices import Matrix
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

Rows = list[list[Any]]

_BITS = 256  # of the gains, before they are rounded


@dataclass(frozen=True, eq=False)
class PdPiVariables:
    """Unknowns of the inequalities: P1, P2, P3, shape (N, N), and Y1, Y2, shape (p, N).

    Indriawati, Agustinah & Jazidie, Lemma 1 and (17).

    They may be arrays of floats, arrays of balls (of dtype object) or expressions of cvxpy: the
    blocks are formed from any of them.
    """

    P1: Any
    P2: Any
    P3: Any
    Y1: Any
    Y2: Any

    def gains(self) -> Gains:
        """(Y P^-1)^T, of floats (Indriawati, Agustinah & Jazidie, (31) to (33))."""
        P = np.block([[self.P1, np.zeros(self.P1.shape)], [self.P2, self.P3]])
        both = _solved(P.T, np.hstack([self.Y1, self.Y2]).T)
        return Gains(*np.split(both, 2))

    def with_gains(self, gains: Gains) -> PdPiVariables:
        """The same P with Y = Lea P."""
        Y1 = gains.L.T @ self.P1 + gains.Ld.T @ self.P2
        return PdPiVariables(self.P1, self.P2, self.P3, Y1, gains.Ld.T @ self.P3)

    def inequalities(
        self, system: AugmentedSystem, gamma: Any, decay: float = 0.0, bound: float = inf
    ) -> list[Rows]:
        """The blocks of all that must be negative definite, by alpha and beta [1/s]."""
        blocks = [self.blocks(system, gamma, decay)]
        return [*blocks, self.bound_blocks(system, bound)] if isfinite(bound) else blocks

    def blocks(self, system: AugmentedSystem, gamma: Any, decay: float = 0.0) -> Rows:
        """The left side of the inequality, 4 x 4 blocks, with alpha as ``decay`` [1/s].

        Indriawati, Agustinah & Jazidie, (18), (19), (22), (23) and (24).
        """
        top = self.P2 + self.P2.T + 2.0 * decay * self.P1
        side, below = self._side(system), self._below(system)
        entry, output = np.eye(system.size), self.P1 @ system.Bo
        none, nothing = np.zeros(entry.shape), np.zeros(system.Bo.shape)
        last = np.eye(system.Bo.shape[1])
        return [
            [top, side, none, output],
            [side.T, below, entry, nothing],
            [none, entry, -entry * gamma, nothing],
            [output.T, nothing.T, nothing.T, -last * gamma],
        ]

    def bound_blocks(self, system: AugmentedSystem, bound: float) -> Rows:
        """The blocks that must be negative for Re s > -``bound`` [1/s], 2 x 2."""
        top = -self.P2 - self.P2.T - 2.0 * bound * self.P1
        side = 2.0 * self.P3 - self._side(system)
        return [[top, side], [side.T, self._below(system)]]

    def _side(self, system: AugmentedSystem) -> Any:
        """P3 + P1 M^T - P2^T S^T."""
        return self.P1 @ system.A_tilde - self.P2.T - self.Y1.T @ system.C_tilde + self.P3

    def _below(self, system: AugmentedSystem) -> Any:
        """-S P3 - P3^T S^T."""
        return -self.P3 - self.P3.T - self.Y2.T @ system.C_tilde - system.C_tilde.T @ self.Y2


@dataclass(frozen=True, eq=False)
class PiVariables:
    """Unknowns of the inequalities of the PI observer: P1, shape (N, N), and Y, (p, N)."""

    P1: Any
    Y: Any

    def gains(self) -> Gains:
        """P1^-1 Y^T and zero, of floats."""
        L = _solved(self.P1, self.Y.T)
        return Gains(L, np.zeros(L.shape))

    def with_gains(self, gains: Gains) -> PiVariables:
        """The same P1 with Y = L^T P1."""
        return PiVariables(self.P1, gains.L.T @ self.P1)

    def inequalities(
        self, system: AugmentedSystem, gamma: Any, decay: float = 0.0, bound: float = inf
    ) -> list[Rows]:
        """The blocks of all that must be negative definite, of poles only without ``gamma``.

        With a ``gamma`` they are linear no more: they serve to check, not to solve.
        """
        left = self._lyapunov(system, decay)
        if gamma is not None:
            output = self.P1 @ system.Bo
            left = gamma * left + np.eye(system.size) + output @ output.T
        blocks: list[Rows] = [[[left]]]
        return [*blocks, [[-self._lyapunov(system, bound)]]] if isfinite(bound) else blocks

    def _lyapunov(self, system: AugmentedSystem, decay: float) -> Any:
        """P1 Ao + Ao^T P1 + 2 alpha P1."""
        half = self.P1 @ system.A_tilde - self.Y.T @ system.C_tilde + decay * self.P1
        return half + half.T


Variables = TypeVar("Variables", bound=PdPiVariables | PiVariables)


def _solved(matrix: Matrix, right: Matrix) -> Matrix:
    """matrix^-1 right in balls, rounded once: the same on every processor."""
    from flint import arb_mat, ctx

    with ctx.workprec(_BITS):
        solution = arb_mat(matrix.tolist()).solve(arb_mat(right.tolist()), nonstop=True)
        values = [float(entry.mid()) for entry in solution.entries()]
    if not all(entry.is_finite() for entry in solution.entries()):
        raise np.linalg.LinAlgError("Singular matrix")
    return np.array(values).reshape(right.shape)


def in_balls(values: Matrix) -> Any:
    """Floats as balls of radius zero, an array of dtype object."""
    from flint import arb

    return np.array([arb(float(value)) for value in values.flat]).reshape(values.shape)


def mapped(variables: Variables, function: Callable[[Any], Any]) -> Variables:
    """The same with ``function`` applied to each matrix."""
    matrices = (function(getattr(variables, field.name)) for field in fields(variables))
    return type(variables)(*matrices)

"""The problem that all methods to a normal form solve, and what must hold for it.

With the output injection l, whose linear part is L0, an observer

    z' = A z - l(y),    x^ = T(z),    A = F + L0 H                                (9), (10), (12)

has the exact linear error dynamics (S(x) - S(x^))' = A (S(x) - S(x^)) if z = S(x) obeys

    S'(x) f(x) = A S(x) - l(h(x)),

which for x = T(z) reads T'(z) (A z - l(h(T(z)))) = f(T(z)). Both linear parts are the identity,
and both equations lead at each degree to the same linear one, with another right-hand side:

    P'(x) F x - A P(x) = R(x).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reobserve.core.arguments import as_kind, as_whole
from reobserve.core.errors import InputError
from reobserve.core.matrices import spectral_radius
from reobserve.polynomials.arithmetic import Coefficients
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import Monomials, monomials
from reobserve.synthesis.linear_gain import unobservable_modes
from reobserve.systems.polynomial import PolynomialSystem


@dataclass(frozen=True, eq=False)
class NormalFormProblem:
    """A system, the output injection chosen for it, and the degree of the series.

    Thomas, Kwatny & Chang, (12) and (13).

    Parameters
    ----------
    system
        f and h.
    injection
        l, n components in p variables; `PolynomialMap.linear` of L0 for a linear one.
    degree
        The highest degree of S and T.
    """

    system: PolynomialSystem
    injection: PolynomialMap
    degree: int

    def __post_init__(self) -> None:
        as_kind("system", self.system, PolynomialSystem)
        as_kind("injection", self.injection, PolynomialMap)
        object.__setattr__(self, "degree", as_whole("degree", self.degree, 1))
        n, p = self.system.states, self.system.outputs
        if (self.injection.components, self.injection.variables) != (n, p):
            raise InputError(
                "injection",
                f"takes {self.injection.variables} outputs to {self.injection.components} "
                f"states, must take {p} to {n}",
            )
        if np.any(self.injection.coefficients[:, 0] != 0):
            raise InputError("injection", "must be zero for the output zero")
        if self.injection.exact != self.system.dynamics.exact:
            raise InputError("injection", "must be exact if the system is, and only then")
        eigenvalues = np.linalg.eigvals(self.A.astype(np.float64))
        if not np.max(eigenvalues.real) < 0:
            refuse_undetectable(self.system)  # where no gain could make it stable
            listed = ", ".join(f"{value:.6g}" for value in eigenvalues)
            problem = f"makes A = F + L0 H with the eigenvalues {listed}; all real parts must be "
            raise InputError("injection", f"{problem}negative")
        _ = self.basis

    @cached_property
    def basis(self) -> Monomials:
        """The monomials of S and T."""
        return monomials(self.system.states, self.degree)

    @property
    def F(self) -> Coefficients:
        """df/dx at the origin."""
        return self.system.F

    @cached_property
    def A(self) -> Coefficients:
        """F + L0 H, the matrix of the error dynamics (Thomas, Kwatny & Chang, after (8))."""
        matrix: Coefficients = self.F + self.injection.matrix @ self.system.H
        return matrix

    @cached_property
    def dynamics(self) -> Coefficients:
        """The series of f up to the degree, shape (n, N)."""
        return self.system.dynamics.upto(self.degree).coefficients

    @cached_property
    def injected(self) -> Coefficients:
        """l(h(x)) up to the degree, shape (n, N)."""
        return self.injection.after(self.system.output, self.degree).coefficients


def refuse_undetectable(system: PolynomialSystem) -> None:
    """Refuse a system with a mode that does not decay and that the output does not show.

    Thomas, Kwatny & Chang, Remark 3.11.
    """
    F, H = system.F.astype(np.float64), system.H.astype(np.float64)
    rounding = 1e-12 * max(1.0, spectral_radius(F))
    for mode in unobservable_modes(F, H):
        if mode.real >= -rounding:
            raise InputError(
                "output",
                f"does not show the mode {mode:.6g} of the linear part, which does not decay: "
                "the pair (F, H) is not detectable, and no injection makes the error decay",
            )

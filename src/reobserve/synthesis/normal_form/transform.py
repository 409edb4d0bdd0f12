"""Design of a normal form, checked, from a system and the wanted error dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.identity_gain import gain_series
from reobserve.synthesis.normal_form.known_inputs import input_injection, joined
from reobserve.synthesis.normal_form.placement import injection_for
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.resonance import Resonance, check_nonresonant
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.systems.polynomial import PolynomialSystem


@dataclass(frozen=True, eq=False)
class NormalForm:
    """The series of a problem.

    ``S`` and ``T`` are z = S(x) and x = T(z) up to the degree of the problem; ``gain`` is L(x),
    dT/dz at z = S(x), with n n components by rows and one degree less. ``resonance`` is the
    smallest divisor behind them; None for degree 1, which has none. ``known`` is beta(y, u) of
    `reobserve.synthesis.normal_form.known_inputs`; None for a system without inputs.
    """

    problem: NormalFormProblem
    resonance: Resonance | None
    S: PolynomialMap
    T: PolynomialMap
    gain: PolynomialMap
    known: PolynomialMap | None = None

    @property
    def inputs(self) -> int:
        """m, the number of known inputs."""
        return 0 if self.known is None else self.known.variables - self.problem.system.outputs

    @property
    def injected(self) -> PolynomialMap:
        """The injection of an observer: l(y), or l(y) - beta(y, u) in p + m variables."""
        injection = self.problem.injection
        return injection if self.known is None else joined(injection, self.known)


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def normal_form(
    system: PolynomialSystem,
    degree: int,
    *,
    injection: PolynomialMap | None = None,
    poles: Sequence[complex] | None = None,
    higher: PolynomialMap | None = None,
    effect: PolynomialMap | None = None,
    names: Sequence[str] = (),
) -> NormalForm:
    """The normal form of a system up to a degree.

    Parameters
    ----------
    system
        x' = f(x), y = h(x) with an equilibrium at the origin.
    degree
        The highest degree of S and T; the gain has one less.
    injection
        l(y), whose linear part L0 makes A = F + L0 H stable.
    poles
        Instead of it: the eigenvalues [1/s] that A is to have.
    higher
        Terms of l(y) that come on top of these, beyond the linear ones.
    effect
        b(x, u), in n + m variables, of known inputs; ``names`` are those of all variables.

    Raises
    ------
    InputError
        If both or none of ``injection`` and ``poles`` are given, A is unstable or resonant, the
        pair (F, H) is not detectable, the inputs leave no linear error dynamics, or the series
        would not fit into memory or are not finite.
    """
    if (injection is None) == (poles is None):
        raise InputError("injection, poles", "one of them must be given, and not both")
    if injection is None:
        assert poles is not None
        if as_kind("system", system, PolynomialSystem).dynamics.exact:
            raise InputError("poles", "give no exact injection; give the injection itself")
        injection = PolynomialMap.linear(np.asarray(injection_for(system, poles)))
    if higher is not None:
        degree = max(injection.degree, higher.degree)
        linear = injection.upto(degree)
        both = linear.coefficients + higher.upto(degree).coefficients
        injection = PolynomialMap(linear.basis, both)
    problem = NormalFormProblem(system, injection, degree)
    smallest = check_nonresonant(problem)
    solver = solver_for(problem)
    S = PolynomialMap(problem.basis, solve_s(problem, solver))
    T = PolynomialMap(problem.basis, solve_t(problem, solver))
    known = None if effect is None else input_injection(S, system.output, effect, names)
    form = NormalForm(problem, smallest, S, T, gain_series(S), known)
    for series in (S, T, form.gain, known):
        if series is not None and not series.exact and not np.isfinite(series.coefficients).all():
            raise InputError("degree", f"{degree} gives series beyond floating-point numbers")
    return form

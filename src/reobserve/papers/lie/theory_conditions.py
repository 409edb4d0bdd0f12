"""Section 3 and Remark 3.7 in numbers: which conditions let the series exist, and converge."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reobserve.core.matrices import as_vector
from reobserve.core.random_streams import random_stream
from reobserve.papers.lie import keys
from reobserve.papers.lie.theory_series import solvable, sums_of_eigenvalues
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.synthesis.normal_form.convergence import convergence
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.resonance import in_poincare_domain, resonance
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.systems.polynomial import PolynomialSystem

Array = NDArray[np.float64]


@part
def measure(theory: keys.Theory) -> Iterator[Metric]:
    """The numbers of the conditions; `InputError` if a value of the ledger cannot be used."""
    problem = scalar(theory)
    A = problem.A.astype(np.float64)
    degrees = range(2, problem.degree + 1)
    sums = [np.min(np.abs(sums_of_eigenvalues(A, degree))) for degree in degrees]
    yield Metric("scalar", "smallest_eigenvalue", float(min(sums)), "1/s")
    yield Metric("scalar", "solvable", float(solvable(problem)), "1")
    yield Metric("nonresonant", "share", _share_nonresonant(theory), "1")
    yield from _siegel(theory)


def scalar(theory: keys.Theory) -> NormalFormProblem:
    """The system of one state, y = x, that has no series; `InputError` for terms that are none.

    Thomas, Kwatny & Chang, Remark 3.7.
    """
    dynamics, injection = (
        PolynomialMap.from_terms(name, terms, 1, 1, exact=True)
        for name, terms in (
            ("scalar_dynamics", theory.scalar_dynamics),
            ("scalar_injection", theory.scalar_injection),
        )
    )
    system = PolynomialSystem(dynamics, PolynomialMap.linear(np.array([[1]], dtype=object)))
    return NormalFormProblem(system, injection, theory.case_degree)


def siegel(theory: keys.Theory) -> NormalFormProblem:
    """The system of two states, y = x1, of the Siegel domain; `InputError` for terms of none.

    Thomas, Kwatny & Chang, Proposition 3.9.
    """
    dynamics = PolynomialMap.from_terms("siegel_dynamics", theory.siegel_dynamics, 2, 2)
    injection = PolynomialMap.from_terms("siegel_injection", theory.siegel_injection, 2, 1)
    system = PolynomialSystem(dynamics, PolynomialMap.linear([[1.0, 0.0]]))
    return NormalFormProblem(system, injection, theory.siegel_degree)


def _siegel(theory: keys.Theory) -> Iterator[Metric]:
    """Proposition 3.9 on a system of the Siegel domain: its divisors, and the radius of S."""
    problem = siegel(theory)
    S = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))
    inside = not in_poincare_domain(np.linalg.eigvals(problem.F))
    yield Metric("siegel", "share_siegel", float(inside), "1")
    smallest = resonance(problem.F, problem.A, problem.basis).distance
    yield Metric("siegel", "smallest_divisor", smallest, "1/s")
    for degree in (problem.degree // 2 + 1, problem.degree):
        radius = convergence(S.upto(degree)).radius
        yield Metric.at("siegel", ("radius", radius, "1"), degree=degree)


def _share_nonresonant(theory: keys.Theory) -> float:
    """Of random linear parts of two states, with a pair of real poles that keeps divisors large.

    So many pairs are tried for each.
    """
    stream = random_stream(theory.seed, "lie", "poles")
    basis = monomials(2, theory.printed_degree)
    slowest, fastest = sorted(as_vector("poles", theory.poles, 2))

    def far(F: Array) -> bool:
        found = resonance(F, np.diag(stream.uniform(slowest, fastest, 2)), basis)
        return found.distance >= theory.margin * found.size

    parts = (stream.standard_normal((2, 2)) for _ in range(theory.choices))
    return sum(any(far(F) for _ in range(theory.tries)) for F in parts) / theory.choices

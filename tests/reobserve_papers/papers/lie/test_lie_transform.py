"""The Lie transform gives the same S, T and gain as the direct methods."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.identity_gain import gain_series
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.papers.lie.lie_transform import lie_transform
from tests.reobserve.synthesis.normal_form import test_known_series as known
from tests.reobserve.synthesis.normal_form.systems import (
    Case,
    built_from,
    parts,
    random_case,
    to_polynomials,
    van_der_pol,
)
from tests.reobserve.synthesis.normal_form.test_methods import (
    CASES,
    DEFECTIVE,
    DEFECTIVE_EXACT,
    RANDOM,
    direct,
    entries,
    float_error,
)

KNOWN = [
    *((known.scalar(*one), 14) for one in known.SCALAR),
    *((built_from(*one[:2], known.A2, *one[2:]), 8) for one in known.PLANE.values()),
    (known.of_three_states()[0], 5), (known.LIENARD, 9), (known.DIAGONAL, 8), (known.TURNED, 6),
    *((known.backwards(*poles), degree - 1) for poles, degree in known.RESONANT),
    *DEFECTIVE_EXACT.values(),
]  # fmt: skip


@pytest.mark.nightly_cases("n4-p1", "n4-p2", "case26-3")
@pytest.mark.parametrize(("case", "degree"), [*CASES, *KNOWN])
def test_lie_transform_agrees_exactly_with_the_direct_methods(case: Case, degree: int) -> None:
    problem = case.problem(degree)
    solver = solver_for(problem)
    lie = lie_transform(problem, solver)
    S, T = direct(problem, solver)
    assert np.array_equal(lie.S, S)
    assert np.array_equal(lie.T, T)
    gain = [parts(p, 0, degree - 1) for p in entries(problem, lie.L)]
    assert gain == to_polynomials(gain_series(PolynomialMap(problem.basis, S)))


@pytest.mark.nightly_cases("case21-4-1e-11", "case14-3-1e-12")
@pytest.mark.parametrize(
    ("case", "degree", "bound"),
    [
        *((van_der_pol(), degree, 1e-14) for degree in range(2, 12)),
        *((random_case(seed, n, p), degree, 1e-12) for n, p, degree, seed in RANDOM),
        *((case, degree, 1e-11) for case, degree in DEFECTIVE.values()),
    ],
)
def test_lie_transform_in_floats_agrees_with_exact_series(
    case: Case, degree: int, bound: float
) -> None:
    def method(problem: NormalFormProblem, solver: Any) -> tuple[Any, Any]:
        lie = lie_transform(problem, solver)
        return lie.S, lie.T

    error, imaginary = float_error(case, degree, method)
    assert error < bound
    assert imaginary < 1e-12


def test_lie_transform_of_exact_input_is_exact() -> None:
    problem = van_der_pol().problem(4)
    for table in lie_transform(problem, solver_for(problem)):
        assert all(isinstance(value, (int, Fraction)) for value in table.ravel())

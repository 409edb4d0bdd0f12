"""Distance of eigenvalues from resonance, where a term of the series is undefined.

Proposition 3.10 asks for lambda != m1 alpha1 + ... + mn alphan with the eigenvalues alpha of F and
lambda of A. The divisors of the series are these differences: a small one makes all coefficients
from its degree on large, and costs as many digits as it is small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.polynomials.monomials import Monomials
from reobserve.synthesis.normal_form.problem import NormalFormProblem

# Relative to the larger of |m.alpha| and |lambda|: half of all digits are lost.
LEAST_DISTANCE = 1e-8


@dataclass(frozen=True)
class Resonance:
    """The smallest divisor of a series: |m.alpha - lambda| over 2 <= |m| <= the degree.

    ``distance`` [1/s], the ``powers`` m and the ``eigenvalue`` lambda where it is found; ``size``
    is the larger of |m.alpha| and |lambda| there.
    """

    distance: float
    powers: tuple[int, ...]
    eigenvalue: complex
    size: float


def resonance(F: NDArray[np.float64], A: NDArray[np.float64], basis: Monomials) -> Resonance:
    """The smallest divisor for eigenvalues of F and A up to the degree of the basis (2 or more).

    Thomas, Kwatny & Chang, Proposition 3.10.
    """
    alpha, lambdas = np.linalg.eigvals(F), np.linalg.eigvals(A)
    powers = basis.exponents[basis.first[2] :]
    sums = powers @ alpha
    distances = np.abs(sums[:, None] - lambdas)
    row, column = np.unravel_index(int(np.argmin(distances)), distances.shape)
    return Resonance(
        float(distances[row, column]),
        tuple(int(power) for power in powers[row]),
        complex(lambdas[column]),
        float(max(abs(sums[row]), abs(lambdas[column]))),
    )


def check_nonresonant(problem: NormalFormProblem) -> Resonance | None:
    """`resonance` of a problem, or None for degree 1, which has no divisors.

    Thomas, Kwatny & Chang, Proposition 3.10.
    """
    if problem.degree < 2:
        return None
    F, A = (matrix.astype(np.float64) for matrix in (problem.F, problem.A))
    closest = resonance(F, A, problem.basis)
    if closest.distance <= LEAST_DISTANCE * closest.size:
        alpha = ", ".join(f"{value:.6g}" for value in np.linalg.eigvals(F))
        raise InputError(
            "injection",
            f"puts the eigenvalue {closest.eigenvalue:.6g} of A at a distance of "
            f"{closest.distance:.2g} from m.alpha with m = {closest.powers} and the eigenvalues "
            f"alpha = {alpha} of F: resonance; choose other poles, or a degree below "
            f"{sum(closest.powers)}",
        )
    return closest

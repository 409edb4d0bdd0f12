"""Exact rational matrices, eigenvalues in 60 digits, errors of floats; invalid input."""

from __future__ import annotations

from fractions import Fraction
from itertools import permutations
from time import perf_counter
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
from flint import arb, arb_mat, fmpq

from reobserve.core.errors import InputError
from reobserve.synthesis.definiteness import ball_matrix, prove_negative_definite

Rows = list[list[Fraction]]

TINY = Fraction(1, 10**30)


def with_eigenvalues(*eigenvalues: Fraction | int) -> Rows:
    """Q diag(eigenvalues) Q with the reflection Q = I - 2 v v^T / (v^T v), v = (1, 2, 3, ...)."""
    n = len(eigenvalues)
    v = [Fraction(k + 1) for k in range(n)]
    length = sum(entry**2 for entry in v)
    Q = [[(i == j) - 2 * v[i] * v[j] / length for j in range(n)] for i in range(n)]
    return [
        [sum((Q[i][k] * eigenvalues[k] * Q[k][j] for k in range(n)), Fraction(0)) for j in range(n)]
        for i in range(n)
    ]


def balls(rows: Rows, bits: int = 500) -> arb_mat:
    with flint.ctx.workprec(bits):
        return arb_mat([[arb(fmpq(x.numerator, x.denominator)) for x in row] for row in rows])


def largest(matrix: np.ndarray | Rows) -> float:
    """The largest eigenvalue, in 60 digits."""
    with mpmath.workdps(60):
        rows = [
            [mpmath.mpf(Fraction(x).numerator) / Fraction(x).denominator for x in row]
            for row in matrix
        ]
        return float(max(mpmath.eigsy(mpmath.matrix(rows), eigvals_only=True)))


def random_definite(size: int) -> np.ndarray:
    factor = np.random.default_rng(size).normal(size=(size, size))
    product = factor @ factor.T
    return -(product + product.T) / 2


# --- Both answers are proofs --------------------------------------------------------------------


def test_definiteness_below_float_resolution_is_proved() -> None:
    proof = prove_negative_definite(balls(with_eigenvalues(-3, -TINY, -1, -2)))
    assert proof is True


@pytest.mark.parametrize("others", [(-3, -1, -2), (-1, -5, -7), (-2, -2, -2, -2, -2)])
def test_indefiniteness_below_float_resolution_is_proved(others: tuple[int, ...]) -> None:
    proof = prove_negative_definite(balls(with_eigenvalues(*others, TINY)))
    assert proof is False


def test_numpy_errs_in_both_directions() -> None:
    found = {TINY: set(), -TINY: set()}
    for eigenvalue, signs in found.items():
        for others in permutations((-3, -1, -5, -7)):
            matrix = with_eigenvalues(*others, eigenvalue)
            signs.add(np.sign(np.linalg.eigvalsh(np.array(matrix, dtype=np.float64))[-1]))
            proof = prove_negative_definite(balls(matrix))
            assert proof is (eigenvalue < 0 if eigenvalue else None)
    assert -1.0 in found[TINY]
    assert 1.0 in found[-TINY]


@pytest.mark.parametrize("others", [(-3, -1, -2), (-1, 0, -2)])
def test_singular_matrix_is_undecided(others: tuple[int, ...]) -> None:
    assert prove_negative_definite(balls(with_eigenvalues(*others, 0))) is None
    assert prove_negative_definite([[-1.0, 1.0], [1.0, -1.0]]) is None
    assert prove_negative_definite([[0.0]]) is None


def test_positive_eigenvalue_is_found_beside_a_singular_block() -> None:
    assert prove_negative_definite([[0.0, 0.0], [0.0, 5.0]]) is False
    assert prove_negative_definite([[0.0, 1.0], [1.0, 0.0]]) is False


def test_too_wide_intervals_are_undecided() -> None:
    assert prove_negative_definite(arb_mat([[arb(-1, 2)]])) is None
    wide = arb_mat([[-1, arb(0, 1.5)], [arb(0, 1.5), -1]])
    assert prove_negative_definite(wide) is None
    narrow = arb_mat([[-1, arb(0, 0.75)], [arb(0, 0.75), -1]])
    assert prove_negative_definite(narrow) is True  # eigenvalues from -1.75 to -0.25


def test_mirrored_intervals_cover_the_symmetric_part() -> None:
    # One entry is 0.5, its mirror image anything up to 1.5: on average up to 1, singular.
    assert prove_negative_definite(arb_mat([[-1, arb(0, 1.5)], [0.5, -1]])) is None


# --- Difficult matrices -------------------------------------------------------------------------


def test_hilbert_matrices_are_proved_definite() -> None:
    for n in (3, 8, 12):
        exact = [[Fraction(-1, i + j + 1) for j in range(n)] for i in range(n)]
        assert prove_negative_definite(balls(exact)) is True
    # Rounded to floats it is another matrix, but still definite.
    assert prove_negative_definite(np.array(exact, dtype=np.float64)) is True


@pytest.mark.parametrize("scale", [2.0**-900, 2.0**-60, 1.0, 2.0**900])
def test_shift_beyond_the_largest_eigenvalue_decides(scale: float) -> None:
    matrix = random_definite(4)
    for part, proved in ((0.999, True), (1.001, False)):
        shifted = (matrix - part * largest(matrix) * np.eye(4)) * scale
        assert prove_negative_definite(shifted) is proved


def test_badly_scaled_diagonal_is_decided() -> None:
    assert prove_negative_definite(np.diag([-1e12, -1e-20, -3.0])) is True
    assert prove_negative_definite(np.diag([-1e12, 1e-20, -3.0])) is False


def test_large_matrices_are_decided_quickly() -> None:
    for size in (24, 48):
        matrix = random_definite(size)
        start = perf_counter()
        proof = prove_negative_definite(matrix)
        assert perf_counter() - start < 2.0  # 0.2 s on a quiet machine
        assert proof is True


# --- Matrices formed in interval arithmetic -----------------------------------------------------


def exact_product(A: Any, B: Any) -> Rows:
    return [
        [
            sum((a * b for a, b in zip(row, column, strict=True)), Fraction(0))
            for column in zip(*B, strict=True)
        ]
        for row in A
    ]


def test_inequality_lost_in_float_rounding_is_decided() -> None:
    # (1 + e)(1 - e) - 1 = -e^2, for P A - Y^T C and its transpose.
    e = 2.0**-30
    P, A, Y = (1 + e) * np.eye(3), (1 - e) * np.eye(3), np.eye(3)
    rounded = P @ A - Y.T @ Y
    assert prove_negative_definite(rounded + rounded.T) is None
    with flint.ctx.workprec(400):
        formed = ball_matrix(P) * ball_matrix(A) - ball_matrix(Y).transpose() * ball_matrix(Y)
        formed += formed.transpose()
    assert prove_negative_definite(formed) is True


def test_intervals_of_products_contain_the_exact_products() -> None:
    rng = np.random.default_rng(3)
    A, P = rng.normal(size=(4, 4)), rng.normal(size=(4, 4))
    exact = exact_product(*([[Fraction(x) for x in row] for row in M.tolist()] for M in (P, A)))
    product = ball_matrix(P) * ball_matrix(A)
    assert product.contains(balls(exact))
    assert not any(entry.is_exact() for entry in product.entries())
    assert all(entry.is_exact() for entry in ball_matrix(A).entries())


def test_precision_of_the_caller_is_unchanged() -> None:
    with flint.ctx.workprec(77):
        prove_negative_definite(np.diag([-1.0, -2.0]))
        assert flint.ctx.prec == 77


# --- Bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        (
            [[-1.0, 0.5], [0.25, -1.0]],
            r"matrix: has 0\.50* at \(0, 1\) and 0\.250* at \(1, 0\), .*",
        ),
        (arb_mat([[-1, arb(0, 1)], [2, -1]]), "matrix: has .* must be symmetric"),
        ([[-1.0, 0.5]], r"matrix: has shape \(1, 2\), must be square"),
        (arb_mat(0, 0), r"matrix: has shape \(0, 0\), must be square"),
        (arb_mat([[arb.nan()]]), "matrix: has an entry that is not finite, or beyond .*"),
        (arb_mat([[arb("-1e400")]]), "matrix: has an entry that is not finite, or beyond .*"),
        ([-1.0, -2.0], r"values: has shape \(2,\), must be \(rows, columns\)"),
    ],
)
def test_wrong_matrices_are_refused(matrix: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        prove_negative_definite(matrix)


@pytest.mark.parametrize("size", [1e-9, 1e-100, 1e200])
def test_small_matrix_is_refuted_like_a_large_one(size: float) -> None:
    """[0 e; e 0] has the eigenvalues e and -e: only the quadratic form shows it, no pivot."""
    proof = prove_negative_definite([[0.0, size], [size, 0.0]])
    assert proof is False

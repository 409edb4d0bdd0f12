"""The arithmetic of truncated series against brute force and against sympy."""

from __future__ import annotations

import random
from fractions import Fraction
from math import comb
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import QQ

from reobserve.core.errors import InputError
from reobserve.polynomials.evaluation_kernels import evaluate, polynomials
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.polynomials.powers import Powers
from tests.reobserve.synthesis.normal_form.systems import (
    Polynomials,
    composed,
    inverted,
    monomial,
    parts,
    powers_of,
    to_map,
    to_polynomials,
    variables,
)

SIZES = [(1, 9), (2, 6), (3, 4), (4, 3)]
more = settings(max_examples=3 * settings.default.max_examples)  # of an inexpensive test


def random_map(seed: int, n: int, components: int, degree: int, lowest: int = 1) -> Polynomials:
    draw = random.Random(seed)
    x = variables(n)
    found = []
    for _ in range(components):
        p = x[0].ring.zero
        for d in range(lowest, degree + 1):
            for m in powers_of(n, d):
                if draw.random() < 0.6 or m[0] == degree:
                    c = QQ(draw.choice([-4, -3, -2, -1, 1, 2, 3]), draw.randint(1, 3))
                    p += c * monomial(x, m)
        found.append(p)
    return found


def near_identity(seed: int, n: int, degree: int) -> Polynomials:
    higher = random_map(seed, n, n, degree, lowest=2)
    return [a + b for a, b in zip(variables(n), higher, strict=True)]


# ------------------------------------------------------------------------------ monomials


@pytest.mark.parametrize(("n", "degree"), [*SIZES, (2, 1), (5, 2)])
def test_monomials_agree_with_brute_force(n: int, degree: int) -> None:
    basis = monomials(n, degree)
    listed = [m for d in range(degree + 1) for m in powers_of(n, d)]
    where = {m: place for place, m in enumerate(listed)}
    assert (basis.variables, basis.degree) == (n, degree)
    assert [tuple(m) for m in basis.exponents.tolist()] == listed
    assert list(basis.first) == [
        sum(comb(n + k - 1, k) for k in range(d)) for d in range(degree + 2)
    ]
    for place, m in enumerate(listed):
        assert basis.place(m) == place
        assert place in range(*basis.part(sum(m)).indices(len(listed)))
        for i in range(n):
            one_more = tuple(e + (j == i) for j, e in enumerate(m))
            one_less = tuple(e - (j == i) for j, e in enumerate(m))
            assert basis.lowered[place, i] == where.get(one_less, -1)
            if sum(m) < degree:
                assert basis.raised[place, i] == where[one_more]
        if place:
            parent = listed[basis.parent[place]]
            i = basis.variable[place]
            assert m == tuple(e + (j == i) for j, e in enumerate(parent))


@pytest.mark.parametrize(("n", "degree"), SIZES)
def test_product_tables_of_monomials_are_correct(n: int, degree: int) -> None:
    basis = monomials(n, degree)
    checked = 0
    for r in range(degree + 1):
        for s in range(degree + 1 - r):
            left, right = powers_of(n, r), powers_of(n, s)
            for a, p in enumerate(left):
                for b, q in enumerate(right):
                    place = basis.products[basis.block[r, s] + a * len(right) + b]
                    assert tuple(basis.exponents[place]) == tuple(np.add(p, q))
                    checked += 1
    # The formula by which the size is checked before the tables are made.
    assert checked == len(basis.products) == comb(2 * n + degree, degree)


def test_too_large_basis_is_refused_with_its_size() -> None:
    # comb(12 + 40, 40) products of 4 bytes each.
    size = comb(52, 40) * 4 / 2**30
    assert 700 < size < 800
    with pytest.raises(
        InputError,
        match=rf"^degree: 40 in 6 variables needs {size:.3g} GiB "
        r"for the products of monomials, must be at most 1 GiB$",
    ):
        monomials(6, 40)
    with pytest.raises(InputError, match=r"^degree: 400 in 60 variables needs more than memory"):
        monomials(60, 400)
    for n, degree in ((0, 3), (3, 0)):
        with pytest.raises(InputError, match=rf"^degree: {degree} in {n} variables; both must be"):
            monomials(n, degree)


def test_too_large_powers_and_compositions_are_refused_with_their_size() -> None:
    basis = monomials(6, 12)
    count = comb(18, 6)
    x = PolynomialMap(basis, np.eye(6, count, 1))
    dense = PolynomialMap(basis, np.ones((6, count)))
    wanted = (
        rf"^degree: 12 in 6 variables needs {count**2 * 8 / 2**30:.3g} GiB for the powers of the "
        r"series, must be at most 1 GiB$"
    )
    with pytest.raises(InputError, match=wanted):
        Powers(basis, x.coefficients, basis, np.arange(count))
    with pytest.raises(InputError, match=wanted):
        dense.after(x, 12)
    with pytest.raises(InputError, match=wanted):
        x.inverse()
    # Unrequested products take no memory.
    assert np.array_equal(x.after(x, 12).coefficients, x.coefficients)


# ------------------------------------------------------------------------------ maps


@pytest.mark.parametrize(("n", "degree"), SIZES)
def test_composition_agrees_with_sympy(n: int, degree: int) -> None:
    outer = random_map(n, n, 2, 3, lowest=0)
    inner = random_map(10 + n, n, n, 3)
    whole = [p.compose(list(zip(p.ring.gens, inner, strict=True))) for p in outer]
    expected = [parts(p, 0, degree) for p in whole]
    assert max(sum(m) for p in whole for m in p.monoms()) >= degree
    found = to_map(outer).after(to_map(inner), degree)
    assert found.degree == degree
    assert to_polynomials(found) == expected
    assert composed(outer, inner, degree) == expected  # the arithmetic of the other tests


def test_composition_with_fewer_and_more_variables_agrees_with_sympy() -> None:
    (y,), (x1, x2) = variables(1), variables(2)
    up = to_map([y**2, y - y**3]).after(to_map([x1 * x2 + x2]), 6)
    inner = x1 * x2 + x2
    assert to_polynomials(up) == [inner**2, inner - inner**3]
    down = to_map([x1 * x2**2]).after(to_map([y**2 + y, 2 * y]), 4)
    assert to_polynomials(down) == [4 * y**4 + 4 * y**3]


@pytest.mark.parametrize(("n", "degree"), SIZES)
def test_jacobian_agrees_with_sympy(n: int, degree: int) -> None:
    p = random_map(20 + n, n, 3, degree, lowest=0)
    found = to_map(p).jacobian()
    assert found.degree == degree - 1
    assert to_polynomials(found) == [c.diff(v) for c in p for v in variables(n)]


@pytest.mark.parametrize(("n", "degree"), SIZES)
def test_inverse_agrees_with_another_method_and_composes_to_identity(n: int, degree: int) -> None:
    T = near_identity(30 + n, n, degree)
    t = to_map(T).upto(degree)
    s = t.inverse()
    assert to_polynomials(s) == inverted(T, degree)
    assert to_polynomials(s.after(t, degree)) == variables(n)
    assert to_polynomials(t.after(s, degree)) == variables(n)
    assert max(abs(c) for _, m, c in s.terms() if sum(m) == degree) > 0


def test_inverse_of_a_known_function_agrees_with_closed_form() -> None:
    # z = x / (1 - x) has the inverse x = z / (1 + z).
    basis = monomials(1, 12)
    table = np.full((1, 13), Fraction(1))
    table[0, 0] = Fraction(0)
    signs = [Fraction((-1) ** (d + 1)) if d else 0 for d in range(13)]
    assert list(PolynomialMap(basis, table).inverse().coefficients[0]) == signs


@pytest.mark.parametrize(("n", "degree"), SIZES)
def test_values_agree_with_sympy(n: int, degree: int) -> None:
    p = random_map(40 + n, n, 2, degree, lowest=0)
    point = [Fraction(2 * i + 1, i + 3) * (-1) ** i for i in range(n)]
    expected = [Fraction(str(c(*[QQ(v.numerator, v.denominator) for v in point]))) for c in p]
    exact = to_map(p)
    assert list(exact(point)) == expected
    assert list(exact.parts(point).sum(axis=0)) == expected
    for d, values in enumerate(exact.parts([2 * v for v in point])):
        assert list(values) == list(2**d * exact.parts(point)[d])
    floats = to_map(p, exact=False)
    points = np.array([[point, [0] * n]], dtype=float)
    wanted = [[[float(v) for v in expected], [float(v) for v in exact([0] * n)]]]
    np.testing.assert_allclose(floats(points), wanted, rtol=1e-13)
    out = np.empty(2)
    compiled = polynomials(floats)
    evaluate(compiled, points[0, 0], np.empty(len(compiled.parent)), out)
    np.testing.assert_allclose(out, wanted[0][0], rtol=1e-13)


def test_truncation_and_padding_keep_the_terms() -> None:
    x1, x2 = variables(2)
    p = to_map([1 + x1 + x1 * x2, x2**3])
    assert to_polynomials(p.upto(2)) == [1 + x1 + x1 * x2, x1 * 0]
    assert to_polynomials(p.upto(1)) == [1 + x1, x1 * 0]
    longer = p.upto(5)
    assert (longer.degree, to_polynomials(longer)) == (5, to_polynomials(p))
    assert p.exact
    assert longer.exact
    assert not p.as_floats().exact
    assert p.matrix.tolist() == [[1, 0], [0, 0]]
    assert to_polynomials(PolynomialMap.linear([[1, 2], [3, 4]])) == [x1 + 2 * x2, 3 * x1 + 4 * x2]


@pytest.mark.parametrize(("n", "degree"), SIZES)
def test_floats_agree_with_fractions(n: int, degree: int) -> None:
    outer, T = random_map(50 + n, n, 2, 3), near_identity(60 + n, n, degree)
    for act in (
        lambda p, t: p.after(t, degree),
        lambda p, t: t.upto(degree).inverse(),
        lambda p, t: t.jacobian(),
    ):
        exact = act(to_map(outer), to_map(T))
        floats = act(to_map(outer, exact=False), to_map(T, exact=False))
        assert not floats.exact
        wanted = exact.as_floats().coefficients
        scale = np.max(np.abs(wanted))
        np.testing.assert_allclose(floats.coefficients, wanted, rtol=0, atol=1e-12 * scale)


# ------------------------------------------------------------------------------ laws

seeds = st.integers(0, 10**6)


@more
@given(seeds, st.sampled_from([(1, 6), (2, 4), (3, 3)]))
def test_composition_is_associative(seed: int, size: tuple[int, int]) -> None:
    n, degree = size
    a, b, c = (to_map(random_map(seed + k, n, n, 2)) for k in range(3))
    left = a.after(b, degree).after(c, degree)
    right = a.after(b.after(c, degree), degree)
    assert np.array_equal(left.coefficients, right.coefficients)


@more
@given(seeds, st.sampled_from([(1, 6), (2, 4), (3, 3)]))
def test_inverse_of_inverse_and_of_composition_are_consistent(
    seed: int, size: tuple[int, int]
) -> None:
    n, degree = size
    a, b = (to_map(near_identity(seed + k, n, degree)).upto(degree) for k in range(2))
    assert np.array_equal(a.inverse().inverse().coefficients, a.coefficients)
    left = a.after(b, degree).inverse()
    right = b.inverse().after(a.inverse(), degree)
    assert np.array_equal(left.coefficients, right.coefficients)


@more
@given(seeds, st.sampled_from([(1, 6), (2, 4), (3, 3)]))
def test_derivative_of_a_composition_obeys_the_chain_rule(seed: int, size: tuple[int, int]) -> None:
    n, degree = size
    a, b = (to_map(random_map(seed + k, n, n, degree)) for k in range(2))
    left = to_polynomials(a.after(b, degree).jacobian())
    outer = to_polynomials(a.jacobian().after(b, degree - 1))
    inner = to_polynomials(b.jacobian())
    for c in range(n):
        for i in range(n):
            row = sum((outer[n * c + k] * inner[n * k + i] for k in range(n)), 0 * left[0])
            assert left[n * c + i] == parts(row, 0, degree - 1)


# ------------------------------------------------------------------------------ errors


GOOD: dict[str, Any] = {"component": 1, "powers": [1, 0], "coefficient": 1}


@pytest.mark.parametrize(
    ("change", "key", "sentence"),
    [
        ({"component": 0}, ".component", "0 must be from 1 to 2"),
        ({"component": 3}, ".component", "3 must be from 1 to 2"),
        ({"component": True}, ".component", "True must be from 1 to 2"),
        ({"component": 1.0}, ".component", "1.0 must be from 1 to 2"),
        ({"powers": [1]}, ".powers", "[1] must be 2 whole numbers, none negative"),
        ({"powers": [1, -1]}, ".powers", "[1, -1] must be 2 whole numbers, none negative"),
        ({"powers": [1, 0.5]}, ".powers", "[1, 0.5] must be 2 whole numbers, none negative"),
        ({"powers": "10"}, ".powers", "'10' must be 2 whole numbers, none negative"),
        ({"powers": 3}, ".powers", "3 must be 2 whole numbers, none negative"),
        *(
            (
                {"coefficient": value},
                ".coefficient",
                f"{value!r} must be a finite number or a fraction such as 1/3",
            )
            for value in ("abc", "1/0", float("nan"), float("inf"), None, [1])
        ),
        ({"extra": 1}, "", " must have the keys component, powers, coefficient and no others"),
    ],
)
@pytest.mark.parametrize("exact", [True, False])
def test_invalid_term_is_named(
    change: dict[str, Any], key: str, sentence: str, exact: bool
) -> None:
    with pytest.raises(InputError) as caught:
        PolynomialMap.from_terms("f", [GOOD, {**GOOD, **change}], 2, 2, exact=exact)
    assert caught.value.parameter == f"f[1]{key}"
    assert str(caught.value).endswith(sentence)


def test_missing_key_and_invalid_term_are_named() -> None:
    for wrong in ({"component": 1, "powers": [1, 0]}, [1, 2], "x1"):
        with pytest.raises(InputError, match=r"^f\[0\]: .* must have the keys component, powers"):
            PolynomialMap.from_terms("f", [wrong], 2, 2)  # type: ignore[list-item]


def test_non_text_key_is_named() -> None:
    wrong = {"component": 1, "powers": [1, 0], 3: 4}
    with pytest.raises(InputError, match=r"^f\[0\]: .* must have the keys component, powers"):
        PolynomialMap.from_terms("f", [wrong], 2, 2)  # type: ignore[list-item]


def test_coefficient_beyond_the_float_range_is_named() -> None:
    with pytest.raises(InputError, match=r"^f\[0\].coefficient: '1e400' must be a finite number"):
        PolynomialMap.from_terms("f", [{**GOOD, "coefficient": "1e400"}], 2, 2)


def test_linear_map_of_integers_has_float_powers() -> None:
    (y,) = variables(1)
    found = to_map([y**4], exact=False).after(PolynomialMap.linear([[10**6]]), 4)
    assert found.coefficients[0, 4] == 1e24


def test_terms_are_parsed_exactly_and_added() -> None:
    terms = [{**GOOD, "coefficient": value} for value in (0.1, "1/3", "-0.25", 2, Fraction(1, 7))]
    exact = PolynomialMap.from_terms("f", terms, 2, 2, exact=True)
    total = Fraction(1, 10) + Fraction(1, 3) - Fraction(1, 4) + 2 + Fraction(1, 7)
    assert list(exact.terms()) == [(0, (1, 0), total)]
    floats = PolynomialMap.from_terms("f", terms, 2, 2)
    assert floats.coefficients[0, 1] == pytest.approx(float(total), rel=1e-15)
    nothing = PolynomialMap.from_terms("f", [], 2, 2, exact=True)
    assert (nothing.degree, list(nothing.terms())) == (1, [])


def test_mismatched_maps_are_refused() -> None:
    x1, x2 = variables(2)
    (y,) = variables(1)
    with pytest.raises(InputError, match="must have 6 columns, one for each monomial in 2 var"):
        PolynomialMap(monomials(2, 2), np.zeros((2, 5)))
    with pytest.raises(InputError, match="inner: has 1 components, must have 2"):
        to_map([x1 + x2]).after(to_map([y]), 3)
    with pytest.raises(InputError, match="inner: has constant terms, must be zero at the origin"):
        to_map([y]).after(to_map([x1 + 1]), 3)
    for wrong in ([x1, 2 * x2], [x1 + x2, x2], [x1 + 1, x2], [x1]):
        with pytest.raises(InputError, match="map: must be the identity up to terms of degree 2"):
            to_map(wrong).inverse()

"""The estimated domain of convergence of series with a known domain."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.observers.normal_form import ConvergenceWarning, IdentityObserver, NormalFormState
from reobserve.observers.run import Run
from reobserve.polynomials.expressions import from_expressions
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.convergence import convergence, part_norms, warning
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve.systems.polynomial import PolynomialSystem
from tests.reobserve.synthesis.normal_form.systems import van_der_pol

NAMES = ("x1", "x2", "x3")


def expanded(text: str, variables: int, degree: int) -> PolynomialMap:
    return from_expressions("f", [text], NAMES[:variables], degree)


def scalar(a: float, b: float, pole: float, degree: int) -> NormalForm:
    """x' = a x + b x^2, y = x: S is x 2F1(1, 1; 2 - pole / a; -b x / a), up to |a / b|."""
    system = PolynomialSystem.from_expressions([f"{a}*x + {b}*x**2"], ["x"], ["x"], 2)
    return normal_form(system, degree, poles=[pole])


@pytest.mark.parametrize(
    ("a", "b", "pole"), [(1, 1, -0.5), (1, 1, -1.37), (-1, 2, -0.5), (-0.3, 1.2, -0.5), (2, 3, -1)]
)
def test_radius_of_a_scalar_system_agrees_with_theory(a: float, b: float, pole: float) -> None:
    form = scalar(a, b, pole, 13)
    coefficient, wanted = 1.0, [0.0]
    for k in range(13):
        wanted.append(coefficient)
        coefficient *= (k + 1) ** 2 / ((2 - pole / a + k) * (k + 1)) * (-b / a)
    np.testing.assert_allclose(form.S.coefficients[0], wanted, rtol=1e-12)
    errors = [
        abs(convergence(scalar(a, b, pole, degree).S).radius * abs(b / a) - 1)
        for degree in (13, 25)
    ]
    assert errors[0] < 0.025
    assert errors[1] < errors[0] / 2


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 10.0, 100.0, 1e4])
@pytest.mark.parametrize("degree", [13, 25])
def test_radius_does_not_depend_on_units(scale: float, degree: int) -> None:
    """In other units of x the radius is the same number in these units."""
    one = convergence(scalar(1, 1, -0.5, degree).S).radius
    other = convergence(scalar(1, 1 / scale, -0.5, degree).S).radius
    assert other == pytest.approx(scale * one, rel=1e-6)


def test_radius_for_distant_poles_is_refused_or_within_a_factor_of_two() -> None:
    """The terms behave asymptotically only from a degree of about |pole / a| on."""
    try:
        found = convergence(scalar(-1, 1, -7.7, 13).S).radius
    except InputError:
        return
    assert 1 / 2 < found < 2


GEOMETRIC = [
    ("1/(1 - x1 - x2)", 2, 9, 1 / np.sqrt(2), 1e-12),
    ("1/(1 - x1 - 2*x2 - 3*x3)", 3, 9, 1 / np.sqrt(14), 1e-12),
    ("1/(1 - x1) + 1/(2 - x2)", 2, 13, 1.0, 1e-4),
    ("1/(1 - x1**2 - x2**2)", 2, 21, 1.0, 2e-3),
    ("1/(1 + x1**2 + 4*x2**2)", 2, 21, 0.5, 2e-3),
    ("log(1 - x1*x2)", 2, 21, np.sqrt(2), 2e-3),
    ("1/(1 - x1*x2*x3)", 3, 21, np.sqrt(3), 2e-3),
    ("sqrt(1 - x1 - x2)", 2, 13, 1 / np.sqrt(2), 1e-2),
    ("1/(1 - x1/3)**3", 2, 13, 3.0, 3e-2),
]


@pytest.mark.parametrize(("text", "variables", "degree", "radius", "within"), GEOMETRIC)
def test_estimated_radii_agree_with_known_ones(
    text: str, variables: int, degree: int, radius: float, within: float
) -> None:
    found = convergence(expanded(text, variables, degree))
    assert found.radius == pytest.approx(radius, rel=within)


def test_growth_along_directions_agrees_with_closed_form() -> None:
    """1 / (1 - x1 - 2 x2) converges on a ray while |x1 + 2 x2| < 1, and everywhere on another."""
    domain = convergence(expanded("1/(1 - x1 - 2*x2)", 2, 13))
    points = np.array([[1.0, 0.0], [0.0, 1.0], [0.3, 0.3], [-0.2, -0.1], [2.0, -1.0], [0.0, 0.0]])
    grown = domain.growth(points)
    along = np.abs(points @ [1.0, 2.0])
    # |P_d| on the sphere is fitted; a direction with a smaller part converges further.
    np.testing.assert_allclose(grown, along, rtol=1e-10, atol=1e-10)
    edge = np.array([[0.93, 0.0], [0.96, 0.0], [1.01, 0.0]])
    assert domain.outside(edge).tolist() == [False, True, True]


def test_part_norms_bound_the_values_on_the_sphere() -> None:
    """The largest value on the complex sphere is at most Bombieri's norm, and close to it."""
    draw = np.random.default_rng(1)
    for variables, degree in ((2, 6), (3, 4)):
        count = len(expanded("x1", variables, degree).basis.exponents)
        table = draw.normal(size=(variables, count))
        series = PolynomialMap(expanded("x1", variables, degree).basis, table)
        norms = part_norms(series)
        points = draw.normal(size=(20_000, 2 * variables)).view(complex)
        points /= np.linalg.norm(points, axis=1)[:, None]
        largest = np.max(np.linalg.norm(series.parts(points), axis=-1), axis=-1)
        dimensions = [len(table[0, series.basis.part(d)]) for d in range(degree + 1)]
        assert (largest <= norms * (1 + 1e-12)).all()
        assert (largest >= 0.8 * norms / np.sqrt(dimensions)).all()


def test_part_norms_agree_with_hand_calculation() -> None:
    norms = part_norms(expanded("3 - 4*x1 + x1**2 + x1*x2 + 2*x2**2", 2, 3))
    np.testing.assert_allclose(norms, [3, 4, np.sqrt(1 + 0.5 + 4), 0], rtol=1e-15)


def test_finite_series_converges_everywhere() -> None:
    domain = convergence(expanded("x1 + x2**3/3", 2, 13))
    assert domain.radius == np.inf
    assert not domain.outside(np.array([[1e6, -1e6]])).any()
    assert warning(domain, np.array([[1e6, -1e6]]), 0.1) is None


def test_finite_series_is_recognised_despite_rounding() -> None:
    """The cubic injection of the example in floats."""
    system = PolynomialSystem.from_expressions(["x2", "(1 - x1**2)*x2 - x1"], ["x1"], NAMES[:2], 3)
    cubic = from_expressions("l", ["-2*y + y**3/3", "-4*y + y**3/3"], ["y"], 3)
    assert convergence(normal_form(system, 13, injection=cubic).S).radius == np.inf


@pytest.mark.parametrize("degree", [3, 5, 11])
def test_too_short_series_is_refused(degree: int) -> None:
    problem = van_der_pol().problem(degree, exact=False)
    S = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))
    with pytest.raises(InputError, match=rf"^degree: {degree} leaves \d parts with terms from"):
        convergence(S)


def test_radius_for_van_der_pol_falls_below_the_cycle_amplitude() -> None:
    """With the degree the estimate falls toward a value below the amplitude of the cycle."""
    problem = van_der_pol().problem(41, exact=False)
    S = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))
    radii = [convergence(S.upto(degree)).radius for degree in (13, 25, 41)]
    assert radii == sorted(radii, reverse=True)
    assert radii[0] / radii[2] - 1 < 0.05
    assert radii[2] == pytest.approx(1.556, abs=2e-3)
    far = convergence(S).outside(np.array([[-1.05, 1.16], [-0.9, 1.0], [1.8, 0.0]]))
    assert far.tolist() == [True, False, False]


def test_domain_warning_states_distance_duration_and_time() -> None:
    domain = convergence(expanded("1/(1 - x1 - x2)", 2, 9))
    states = np.array([[0.0, 0.0], [0.2, 0.2], [0.5, 0.46], [1.0, 1.0]])
    assert warning(domain, states[:2], 0.25) is None
    assert warning(domain, states, 0.25) == (
        "the series converges up to a radius of 0.707 or little beyond; of the samples of the "
        "trajectory 25 % are outside and 25 % within 5 % of the edge, the first at t = 0.5 s, "
        "where a higher order need not be better"
    )


def test_check_domain_warns_and_returns_the_sentence() -> None:
    observer = IdentityObserver(scalar(1, 1, -0.5, 13), order=4, sampling_period=0.1)
    inside, outside = (
        Run(np.arange(2.0), {"state": np.array([[0.0], [top]])}, {}, NormalFormState(np.zeros(1)))
        for top in (0.9, 1.1)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert observer.check_domain(inside) is None
    said = r"50 % are outside and 0 % within .* first at t ="
    with pytest.warns(ConvergenceWarning, match=said) as given:
        sentence = observer.check_domain(outside)
    assert str(given[0].message) == sentence
    assert given[0].filename == __file__


def test_radius_error_is_four_times_the_change_with_fewer_degrees() -> None:
    """1 / (1 - x) + 1 / (3/2 - x)^3, its coefficients by hand and the fits independently."""
    found = convergence(expanded("1/(1 - x1) + 1/(3/2 - x1)**3", 1, 13))
    degrees = np.array(found.degrees)
    sizes = 1 + (degrees + 1) * (degrees + 2) / 2 / 1.5 ** (degrees + 3)

    def radius(keep: slice) -> float:
        d = degrees[keep]
        normal = np.stack([d**0, np.log(d), -d], axis=1)
        return float(np.exp(np.linalg.solve(normal.T @ normal, normal.T @ np.log(sizes[keep]))[2]))

    whole, later, earlier = radius(slice(None)), radius(slice(1, None)), radius(slice(-1))
    assert found.radius == pytest.approx(whole, rel=1e-6)
    assert found.error == pytest.approx(4 * abs(later - earlier) / whole, rel=1e-4)
    assert found.error > 0.1, "more than the least"


def test_radius_error_is_at_least_five_percent() -> None:
    """The parts of 1 / (1 - x) are all one: every fit gives the radius 1."""
    assert convergence(expanded("1/(1 - x1)", 1, 13)).error == 0.05


@pytest.mark.parametrize(("degree", "lowest"), [(11, 6), (12, 6), (13, 7)])
def test_radius_fit_uses_the_upper_half_of_the_degrees(degree: int, lowest: int) -> None:
    found = convergence(expanded("1/(1 - x1)", 1, degree))
    assert found.degrees == tuple(range(lowest, degree + 1))


@pytest.mark.parametrize(
    ("text", "degree", "without"),
    [("1/(1 - x1) + 3/(1 + x1)**2", 13, "0.964"), ("log(1 + x1) + 1/(2 - x1)", 9, "1.21")],
)
def test_radius_is_undefined_if_estimates_differ_by_more_than_five_percent(
    text: str, degree: int, without: str
) -> None:
    """Two singularities at one distance: parts of even and odd degree behave differently."""
    sentence = rf"^degree: {degree} is too low .*: {without} without the lowest part and"
    with pytest.raises(InputError, match=sentence):
        convergence(expanded(text, 1, degree))

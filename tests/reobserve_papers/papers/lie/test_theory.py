"""The numbers of the theory by closed forms and independent computations."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import product
from math import isnan
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import sympy
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.polynomials.arithmetic import add_derivatives_along
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.resonance import resonance
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.metrics.metrics import lookup, read_metrics
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.lie import design as design_stage
from reobserve_papers.papers.lie import metrics as metrics_stage
from reobserve_papers.papers.lie import theory as theory_stage
from reobserve_papers.papers.lie import theory_series
from reobserve_papers.papers.lie.ensemble import EnsembleRecord, RunOutcome
from reobserve_papers.papers.lie.lie_transform import lie_transform
from reobserve_papers.papers.lie.operations import operations
from reobserve_papers.papers.lie.scoring import largest_improvement, share_better
from reobserve_papers.papers.lie.study_rows import KINDS
from reobserve_papers.papers.lie.theory_runs import (
    GROWTH,
    Case,
    decay_rate,
    deviation_from_linear,
    difference_of_forms,
    error_decay,
)
from reobserve_papers.papers.lie.theory_series import (
    Solutions,
    ad_matrix,
    random_problem,
    sums_of_eigenvalues,
)
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series
from tests.reobserve.observers.test_normal_form_observers import form
from tests.reobserve.synthesis.normal_form import systems
from tests.reobserve.synthesis.normal_form.systems import (
    QQ,
    difference,
    to_polynomials,
    van_der_pol,
    variables,
)
from tests.reobserve_papers.pipeline.conftest import Project, as_built

__all__ = ["as_built"]
from tests.reobserve_papers.papers.lie.test_errata_series import matrix_of_ad
from tests.reobserve_papers.papers.lie.test_paper import evaluator, typed

Array = NDArray[np.float64]


@cache
def theory() -> dict[tuple[str, str], float]:
    return {(m.observer, m.metric): m.value for m in evaluator().theory()}


def test_theory_numbers_agree_with_known_values() -> None:
    value = theory()
    # A has the trace -1 and the determinant 3
    error = np.sqrt(11) / 2 - 1.65831
    assert value["linear", "eigenvalue_error"] == pytest.approx(error, abs=1e-14)
    assert value["linear", "coefficients_printed"] == 10
    assert value["linear", "coefficients_agreeing"] == 10
    assert value["nonlinear", "inverse_radius"] == 0


def test_exact_quantities_have_zero_error() -> None:
    value = theory()
    for name in ("linear", "random", "unobservable"):
        assert value[name, "largest_residual"] == 0
    for name in ("linear", "random"):
        assert value[name, "largest_difference"] == 0
    assert value["ad", "off_diagonal"] == 0


def test_printed_eigenvalues_determine_the_output() -> None:
    """Two equations for the two entries of H, whose only solution is y = x1."""
    h1, h2 = sympy.symbols("h1 h2")
    A = sympy.Matrix([[0, 1], [-1, 1]]) + sympy.Matrix([-2, -4]) * sympy.Matrix([[h1, h2]])
    real, imaginary = sympy.Rational(-1, 2), sympy.sqrt(11) / 2
    found = sympy.solve([A.trace() - 2 * real, A.det() - real**2 - imaginary**2], [h1, h2])
    assert found == {h1: 1, h2: 0}
    settings = evaluator().parameters.settings("design", "linear")
    settings["plant"]["output"] = [{"component": 1, "powers": [0, 1], "coefficient": 1}]
    with pytest.raises(InputError, match="all real parts must be negative"):
        design_stage.compute(typed(settings))


def test_compared_errors_are_those_of_the_ensemble(as_built: Project) -> None:
    """The whole state in one, its components in the other, from the same initial states."""
    outcome = RunOutcome((1.0, 2.0), 3.0, False, (4.0, 5.0, 6.0), (7.0, 8.0))
    for measure, sizes in (("square", (3, 1, 2)), ("absolute", (4, 5, 6)), ("settling", (3, 7, 8))):
        assert tuple(outcome.size(error, measure) for error in ("x", "x1", "x2")) == sizes
    assert outcome.ise == 3
    theory, study = (
        lookup(read_metrics(as_built.folder / f"results/lie/{name}.metrics.csv"))
        for name in ("theory", "fig1_ensemble")
    )
    found = tuple(
        theory.at("identity", name, measure="square")
        for name in ("share_better", "largest_improvement")
    )
    least = study.at("series", "minimum_ise_ratio", order=4)
    wanted = study.at("series", "share_better", order=4), 1 - least
    assert found == pytest.approx(wanted, abs=1e-12)
    assert theory["identity", "share_settled"] == 1


def test_measures_of_an_exponential_agree_with_closed_forms() -> None:
    # e = (3, 4) exp(-t) from t = 0 to 10, from a plant at rest
    step = 1e-3
    time = np.arange(0.0, 10.0 + step / 2, step)
    rest = np.zeros((2 * len(time) - 1, 2))
    record = EnsembleRecord(np.zeros(2), rest, rest[:, :1], step)
    found = record.scored(np.exp(-time)[:, None] * [3.0, 4.0], 0.02)
    assert found.sizes == pytest.approx([5, 3, 4], rel=1e-4)
    assert found.squares == pytest.approx([4.5, 8], rel=1e-4)
    wanted = np.log([1, 3 / 5, 4 / 5]) + np.log(50)
    assert (found.settling_time, *found.settling_times) == pytest.approx(wanted, abs=2 * step)


def test_improvements_count_runs_without_an_end() -> None:
    nan = float("nan")
    assert largest_improvement([2.0, 3.0], [4.0, 4.0]) == 0.5
    assert largest_improvement([5.0, nan], [4.0, 4.0]) == 0
    assert largest_improvement([5.0, 3.0], [4.0, nan]) == 1
    assert largest_improvement([nan], [nan]) == 0
    assert share_better([1.0, nan, 3.0, nan], [2.0, 2.0, nan, nan]) == 0.5


def test_a_copy_of_the_plant_never_settles() -> None:
    """It starts at the origin and stays there, so its error is the state itself."""
    value = theory()
    assert value["copy", "share_settled"] == 0
    assert isnan(value["copy", "latest_settling_time"])
    for measure in ("square", "absolute", "settling"):
        assert value["over_copy", f"share_better measure={measure}"] == 1
        assert value["over_copy", f"largest_improvement measure={measure}"] > 0.9
    # Near the origin it grows as e^(t / 2); with z = x the cubic term of f remains.
    assert value["copy", "error_decay"] == pytest.approx(0.5, abs=0.1)
    assert value["copy", "largest_residual"] == 1
    numbers = lookup(evaluator().figure("fig1").numbers)
    # Its errors neither grow nor decay along the cycle.
    assert numbers["copy", "floquet_exponent"] == pytest.approx(0, abs=1e-6)


def test_injection_at_order_0_agrees_with_the_study_of_injections() -> None:
    """The same comparison from fewer initial states, by its own code."""
    job = typed(settings_of_theory())
    terms = [*job.designs["linear"].injection]
    terms += [{"component": k, "powers": [3], "coefficient": -0.5} for k in (1, 2)]
    injection = replace(job.designs["nonlinear"], injection=terms)
    job = replace(
        job,
        designs={**job.designs, "nonlinear": injection},
        theory=replace(job.theory, compared_points=5),
    )
    stored = {
        name: design_stage.compute(replace(job, design=job.designs[name]))
        for name in ("linear", "nonlinear")
    }
    found = lookup(theory_stage._injected(job, stored))
    for measure in ("square", "absolute", "settling"):
        assert found["nonlinear", f"share_better_at_order_0 measure={measure}"] == 1


@pytest.mark.parametrize("degree", [3, 5])
def test_operations_agree_with_another_count(monkeypatch: pytest.MonkeyPatch, degree: int) -> None:
    """The claim `lie_is_faster`, with all fractions counted while the methods run."""
    problem = van_der_pol().problem(degree)
    found, plain, done = operations(problem), solver_for(problem), [0]

    def count(name: str) -> None:
        right = getattr(Fraction, name)

        def counted(self: Fraction, other: Any) -> Any:
            done[0] += self != 0 and other != 0
            return right(self, other)

        monkeypatch.setattr(Fraction, name, counted)

    def solver(*given: Any) -> Any:  # whose own operations do not count
        before, solution = done[0], plain(*given)
        done[0] = before
        return solution

    for name in ("add", "sub", "mul", "truediv"):
        count(f"__{name}__")
        count(f"__r{name}__")
    counts = []
    for solve in (solve_t, lie_transform):
        _ = problem.injected  # computed once per problem
        done[0] = 0
        solve(problem, solver)
        counts.append(done[0])
    of_t, lie = counts

    # By hand: 2 (d + 1) unknowns of each degree, and 4 (d + 1) of the gain. LU takes
    # (4 u^3 - 3 u^2 - u) / 6, a right-hand side 2 u^2 - u.
    def solution(size: int, times: int) -> float:
        return (4 * size**3 - 3 * size**2 - size) / 6 + times * (2 * size**2 - size)

    sizes = [2 * (d + 1) for d in range(2, degree + 1)]
    gains, steps = 4 * sum(range(2, degree + 1)), degree - 1
    linear = sum(solution(size, 1) for size in sizes)
    assert found.brute_force("by_degree", "elimination") == pytest.approx(of_t + linear, abs=2)
    at_once = steps * of_t + solution(sum(sizes), steps)
    assert found.brute_force("all_at_once", "elimination") == pytest.approx(at_once, abs=10)
    dividing = sum(_in_eigenvectors(problem, d)[1] for d in range(2, degree + 1))
    assert found.brute_force("by_degree", "division") == pytest.approx(of_t + dividing, abs=2)
    at_once = steps * (of_t + dividing)
    assert found.brute_force("all_at_once", "division") == pytest.approx(at_once, abs=10)
    for equations, each in (
        ("elimination", linear),
        ("division", dividing),
        ("real_division", 4 * dividing),
    ):
        eliminated = found.lie("eliminated", equations)
        assert eliminated == pytest.approx(lie + each, rel=0.02)
        wanted = (gains + steps) * eliminated + solution(gains, steps)
        assert found.lie("open", equations) == wanted


class _Counting(complex):
    """A complex number that counts the operations done with it."""

    done = 0


def _counted(name: str) -> Any:
    def operation(self: complex, other: complex) -> complex:
        _Counting.done += 1
        return _Counting(getattr(complex, name)(self, other))

    return operation


for _name in ("add", "sub", "mul", "truediv"):
    setattr(_Counting, f"__{_name}__", _counted(f"__{_name}__"))


def _in_eigenvectors(problem: NormalFormProblem, degree: int) -> tuple[Array, int]:
    """A solution by divisions for a full right-hand side, and how many operations it took.

    Monomials change by values at points instead of by a formula: m(Q w) = M m(w).
    """
    basis = problem.basis
    (alpha, Q), (poles, W) = (np.linalg.eig(each.astype(float)) for each in (problem.F, problem.A))
    powers = basis.exponents[basis.part(degree)]
    points = np.random.default_rng(1).standard_normal((2, len(powers)))

    def monomials_at(x: Any) -> Any:
        return np.prod(x[:, None, :] ** powers.T[:, :, None], axis=0)

    M = np.linalg.solve(monomials_at(points).T, monomials_at(Q @ points).T).T

    def counting(values: Any) -> Any:
        return np.vectorize(_Counting, otypes=[object])(values)

    _Counting.done = 0
    right = counting(_right(len(powers)))
    turned = counting(np.linalg.inv(W)) @ right @ counting(M)
    divisors = (powers @ alpha)[None, :] - poles[:, None]
    solution = counting(W) @ (turned / counting(divisors)) @ counting(np.linalg.inv(M))
    return solution.astype(complex), _Counting.done


def _right(width: int) -> Array:
    return np.arange(1.0, 2 * width + 1).reshape(2, width)


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_equations_in_eigenvectors_are_divisions(degree: int) -> None:
    """What `operations` counts as division solves the equation (Remark 4.18, with F as well)."""
    problem = van_der_pol().problem(degree)
    found, _ = _in_eigenvectors(problem, degree)
    exact = solver_for(problem)
    right = np.vectorize(lambda v: Fraction(int(v)), otypes=[object])(_right(degree + 1))
    wanted = exact(problem.basis, right, degree).astype(float)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_newton_steps_make_one_more_degree_exact() -> None:
    """As `operations` states, with the Jacobian of T(z) = z."""
    problem = van_der_pol().problem(5)
    exact, solver = solve_t(problem, solver_for(problem)), solver_for(problem)
    basis = problem.basis
    T = PolynomialMap(basis, exact).upto(1).coefficients
    T = np.hstack([T, np.full((2, exact.shape[1] - T.shape[1]), Fraction(0))])
    outer = PolynomialMap(basis, np.concatenate([problem.dynamics, problem.injected]))
    for step in range(problem.degree - 1):
        assert np.array_equal(T[:, : basis.first[step + 2]], exact[:, : basis.first[step + 2]])
        values = outer.after(PolynomialMap(basis, T), problem.degree).coefficients
        field = -values[2:]
        field[:, basis.part(1)] += problem.A
        left = values[:2].copy()
        for d in range(1, problem.degree + 1):
            add_derivatives_along(basis, T, field, 1, d, d, -1, left)
        for d in range(2, problem.degree + 1):
            T[:, basis.part(d)] += solver(basis, left[:, basis.part(d)], d)
    assert np.array_equal(T, exact)


def test_decay_near_the_origin_follows_the_slowest_mode() -> None:
    # A node, x' = -x and -3 x: after a while only its first component remains.
    x1, x2 = variables(2)
    (y,) = variables(1)
    problem = systems.Case([-x1, -2 * x2], [x2], [0 * y, -y]).problem(2)
    expected = np.log(np.hypot(np.exp(-5), np.exp(-15)) / np.sqrt(2)) / 5
    assert decay_rate(problem, 0.01, 5.0) == pytest.approx(expected, rel=1e-6)
    # For the observer of a linear system T is the identity, and e' = A e.
    T = PolynomialMap.linear(np.eye(2))
    slopes = list(error_decay(problem, T, 0.01, 5.0).values())
    assert slopes == pytest.approx([expected] * 3, rel=1e-6)
    # For the example: e^(A t) at 2 s, up to terms that are small like the state.
    A, start = np.array([[-2.0, 1.0], [-5.0, 1.0]]), np.ones(2)
    size = np.linalg.norm(scipy.linalg.expm(2.0 * A) @ start) / np.linalg.norm(start)
    example = form()
    found = error_decay(example.problem, example.T, 1e-4, 2.0)
    assert found[GROWTH] == pytest.approx(np.log(size) / 2, abs=1e-6)
    # The state grows as e^(t / 2); the run ends where it is no longer near the origin.
    late, later = (error_decay(example.problem, example.T, 1e-4, end) for end in (50.0, 500.0))
    assert late == later
    # It ends later where the state may grow more, and the mean slope changes with the phase.
    assert len(set(late.values())) == 3
    assert all(slope < -0.3 for slope in late.values())
    value = theory()
    assert value["unobservable", "error_decay"] == pytest.approx(
        value["unobservable", "decay_rate"], rel=0.01
    )


def test_siegel_domain_system_has_the_stated_eigenvalues() -> None:
    """F has its eigenvalues on the imaginary axis, A where the parameters state."""
    problem = theory_stage.siegel(typed(settings_of_theory()).theory)
    assert np.allclose(np.linalg.eigvals(problem.F).real, 0.0)
    assert np.allclose(np.sort(np.linalg.eigvals(problem.A).real), [-2.0, -1.0])
    # -1 - (m1 - m2) i with m1 = m2
    found = resonance(problem.F, problem.A, problem.basis)
    assert found.distance == pytest.approx(1.0, abs=1e-12)
    # The radii from 21 and from 41 degrees.
    assert theory()["siegel", "radius_ratio"] == pytest.approx(1.0, abs=0.01)


def settings_of_theory() -> dict[str, Any]:
    return evaluator().parameters.settings("theory")


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_matrix_of_ad_agrees_with_another_arithmetic(degree: int) -> None:
    A = [[QQ(-2), QQ(1)], [QQ(-5), QQ(1)]]
    wanted = np.array(matrix_of_ad(A, degree), dtype=float)
    np.testing.assert_array_equal(ad_matrix(np.array([[-2.0, 1.0], [-5.0, 1.0]]), degree), wanted)


def test_sums_of_eigenvalues_agree_with_hand_calculation() -> None:
    found = np.sort(sums_of_eigenvalues(np.diag([-1.0, -3.0]), 2).real)
    # -2, -4, -6 plus 1 or plus 3
    np.testing.assert_allclose(found, [-5, -3, -3, -1, -1, 1])


@pytest.mark.parametrize("unobservable", [False, True])
def test_random_problems_have_the_requested_properties(unobservable: bool) -> None:
    for k in range(3):
        problem = random_problem(random_stream(7, "t", str(k)), 3, 3, 3, unobservable=unobservable)
        system = problem.system
        case = systems.Case(
            to_polynomials(system.dynamics),
            to_polynomials(system.output),
            to_polynomials(problem.injection),
        )
        A = problem.A.astype(float)
        assert np.all(A.diagonal() < -(np.abs(A).sum(axis=1) - np.abs(A.diagonal())))
        seen = np.concatenate([system.H @ np.linalg.matrix_power(system.F, j) for j in range(3)])
        assert (sympy.Matrix(seen).rank() < 3) == unobservable
        S = to_polynomials(PolynomialMap(problem.basis, Solutions(problem).S))
        left = case.residual_of_s(S)
        assert systems.lowest_degree(left) == 4
        assert systems.lowest_degree(difference(S, variables(3))) == 2


def test_resonant_problem_is_sampled_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse_once(problem: Any) -> None:
        monkeypatch.undo()
        first.append(problem)
        raise InputError("poles", "are resonant")

    first: list[Any] = []
    monkeypatch.setattr(theory_series, "check_nonresonant", refuse_once)
    second = random_problem(random_stream(7, "t", "0"), 3, 3, 3)
    assert np.array_equal(first[0].A, random_problem(random_stream(7, "t", "0"), 3, 3, 3).A)
    assert not np.array_equal(first[0].A, second.A)


def test_wrong_series_is_detected() -> None:
    problem = van_der_pol().problem(5)
    right = Solutions(problem)
    assert (right.difference(), right.residual()) == (0, 0)
    wrong = Solutions(problem)
    wrong.__dict__["S"] = right.S.copy()
    wrong.S[1, problem.basis.place((3, 0))] += 1
    assert wrong.difference() >= 1
    assert wrong.residual() >= 1
    other = Solutions(problem)
    other.__dict__["T"] = right.T.copy()
    other.T[0, problem.basis.place((2, 1))] += 1
    assert other.difference() >= 1
    assert other.residual() >= 1


def test_runs_distinguish_linear_from_nonlinear_errors() -> None:
    case = Case([2.0, 0.5], [0.0, 0.0], 5.0, 2e-3)
    exact, truncated = form(5, with_cubic=True), form(5)
    assert deviation_from_linear(exact, 2, case) < 1e-11
    assert difference_of_forms(exact, 2, case) < 1e-9
    assert deviation_from_linear(truncated, 4, case) > 0.1
    assert difference_of_forms(truncated, 4, case) > 1.0
    near = [
        deviation_from_linear(truncated, 4, Case([radius, 0.0], [0.0, 0.0], 1.0, 1e-3))
        for radius in (0.1, 0.05)
    ]
    # The error of the truncated S starts at degree 7, next to an error of degree 1.
    assert np.log2(near[0] / near[1]) == pytest.approx(6.0, abs=0.3)


def test_share_of_pole_choices_agrees_with_another_count() -> None:
    stated = typed(settings_of_theory()).theory
    rules = replace(
        stated, seed=5, printed_degree=3, poles=[-1.0, -3.0], choices=40, tries=2, margin=0.05
    )
    stream = random_stream(5, "lie", "poles")
    far = 0
    for _ in range(40):
        alpha = np.linalg.eigvals(stream.standard_normal((2, 2)))
        sums = [
            m1 * alpha[0] + m2 * alpha[1]
            for m1, m2 in product(range(4), repeat=2)
            if 2 <= m1 + m2 <= 3
        ]
        for _ in range(2):
            poles = stream.uniform(-3.0, -1.0, 2)
            distances = [(abs(m - pole), max(abs(m), abs(pole))) for m in sums for pole in poles]
            distance, size = min(distances)
            if distance >= 0.05 * size:
                far += 1
                break
    (share,) = theory_stage._nonresonant(rules)
    assert share.value == pytest.approx(far / 40)
    assert 0 < far < 40
    # With more states there are more sums of eigenvalues, and fewer choices of poles are good.
    four, six = (one.value for one in theory_stage._nonresonant_in_more_states(rules))
    assert six < four < share.value


def test_minimum_ratio_is_taken_over_initial_states() -> None:
    def row(name: str, order: int, quantity: str, value: float) -> dict[str, Any]:
        return {"form": name, "order": order, "quantity": quantity, "value": value}

    study = []
    for name, order, errors in (("constant", 0, [2.0, 4.0]), ("series", 4, [1.0, 4.0]),
                                ("series", 2, [float("nan"), 3.0])):  # fmt: skip
        for error in errors:
            study += [row(name, order, "ise", error), row(name, order, "settled", 1.0),
                      row(name, order, "diverged", 0.0)]  # fmt: skip
    kinds = {name: KINDS[name] for name in study[0]}
    data = FigureData(
        typed(settings_of_theory()),
        Series(np.zeros(1), {}),
        {},
        StudyTable.of(study, kinds),
    )
    found = lookup(metrics_stage._ensemble(data))
    assert found.at("series", "minimum_ise_ratio", order=4) == 0.5
    assert found.at("series", "median_ise_ratio", order=4) == 0.75
    assert found.at("series", "minimum_ise_ratio", order=2) == 0.75
    assert isnan(found.at("series", "median_ise_ratio", order=2))
    assert found.at("constant", "minimum_ise_ratio", order=0) == 1.0


@pytest.mark.parametrize("degree", [2, 3])
def test_wrong_spectrum_at_one_degree_is_detected(
    monkeypatch: pytest.MonkeyPatch, degree: int
) -> None:
    """The number is the worst over the degrees of the parameter file."""
    assert theory()["ad", "spectrum_difference"] < 1e-6
    right = theory_stage.spectrum_difference
    monkeypatch.setattr(
        theory_stage,
        "spectrum_difference",
        lambda A, d: right(A, d) + (0.5 if d == degree else 0.0),
    )
    found = list(theory_stage._series(typed(evaluator().parameters.settings("theory"))))
    (worst,) = (m.value for m in found if m.metric == "spectrum_difference")
    assert worst == pytest.approx(0.5, abs=1e-6)

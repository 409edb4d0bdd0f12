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
from reobserve.core.random_streams import random_stream
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.resonance import in_poincare_domain, resonance
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.metrics.metrics import lookup
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.lie import design as design_stage
from reobserve_papers.papers.lie import metrics as metrics_stage
from reobserve_papers.papers.lie import theory as theory_stage
from reobserve_papers.papers.lie import theory_series
from reobserve_papers.papers.lie.ensemble import RunOutcome
from reobserve_papers.papers.lie.lie_transform import lie_transform
from reobserve_papers.papers.lie.study_rows import KINDS
from reobserve_papers.papers.lie.theory_runs import (
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


def test_compared_errors_are_those_of_the_ensemble() -> None:
    """The whole state in one, its components in the other, from the same initial states."""
    outcome = RunOutcome((1.0, 2.0), 3.0, diverged=False)
    assert (outcome.ise, outcome.ise_of("x"), outcome.ise_of("x1"), outcome.ise_of("x2")) == (
        3.0, 3.0, 1.0, 2.0,
    )  # fmt: skip
    found = theory()["identity", "share_better"], theory()["identity", "largest_improvement"]
    study = lookup(evaluator().figure("fig1_ensemble").numbers)
    least = study.at("series", "minimum_ise_ratio", order=4)
    wanted = study.at("series", "share_better", order=4), 1 - least
    assert found == pytest.approx(wanted, abs=1e-12)
    assert theory()["identity", "share_settled"] == 1


def test_operation_counts_support_the_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    """The claim `lie_is_faster`: T degree by degree takes half to a tenth of the operations."""
    done: list[str] = []

    def count(name: str) -> None:
        right = getattr(Fraction, name)

        def counted(self: Fraction, other: Any) -> Any:
            done.append(name)
            return right(self, other)

        monkeypatch.setattr(Fraction, name, counted)

    for name in ("add", "sub", "mul", "truediv"):
        count(f"__{name}__")
        count(f"__r{name}__")
    ratios = []
    for degree in (3, 7, 13):
        problem = van_der_pol().problem(degree)
        solver = solver_for(problem)
        solve_s(problem, solver)  # computed once per problem
        used = []
        for solve in (solve_t, lie_transform):
            done.clear()
            solve(problem, solver)
            used.append(len(done))
        ratios.append(used[1] / used[0])
    assert 2 < ratios[0] < ratios[1] < ratios[2] < 12


def test_decay_near_the_origin_follows_the_slowest_mode() -> None:
    # A node, x' = -x and -3 x: after a while only its first component remains.
    x1, x2 = variables(2)
    (y,) = variables(1)
    problem = systems.Case([-x1, -2 * x2], [x2], [0 * y, -y]).problem(2)
    expected = np.log(np.hypot(np.exp(-5), np.exp(-15)) / np.sqrt(2)) / 5
    assert decay_rate(problem, 0.01, 5.0) == pytest.approx(expected, rel=1e-6)
    # For the observer of a linear system T is the identity, and e' = A e.
    T = PolynomialMap.linear(np.eye(2))
    assert error_decay(problem, T, 0.01, 5.0) == pytest.approx(expected, rel=1e-6)
    # For the example: e^(A t) at 2 s, up to terms that are small like the state.
    A, start = np.array([[-2.0, 1.0], [-5.0, 1.0]]), np.ones(2)
    size = np.linalg.norm(scipy.linalg.expm(2.0 * A) @ start) / np.linalg.norm(start)
    example = form()
    found = error_decay(example.problem, example.T, 1e-4, 2.0)
    assert found == pytest.approx(np.log(size) / 2, abs=1e-6)
    # The state grows as e^(t / 2); the run ends where it is no longer near the origin.
    late, later = (error_decay(example.problem, example.T, 1e-4, end) for end in (50.0, 500.0))
    assert late == later < -0.3
    value = theory()
    assert value["unobservable", "error_decay"] == pytest.approx(
        value["unobservable", "decay_rate"], rel=0.01
    )


def test_siegel_domain_system_has_the_stated_eigenvalues() -> None:
    """F has its eigenvalues on the imaginary axis, A where the parameters state."""
    problem = theory_stage.siegel(typed(settings_of_theory()).theory)
    assert np.allclose(np.linalg.eigvals(problem.F).real, 0.0)
    assert not in_poincare_domain(np.linalg.eigvals(problem.F))
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

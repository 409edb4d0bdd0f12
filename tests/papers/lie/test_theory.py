"""The numbers of the theory by closed forms and by other ways."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from math import isnan
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.random_streams import random_stream
from reobserve.papers.lie import design as design_stage
from reobserve.papers.lie import keys, theory_cases, theory_conditions
from reobserve.papers.lie import metrics as metrics_stage
from reobserve.papers.lie import theory as theory_stage
from reobserve.papers.lie.study_rows import KINDS
from reobserve.papers.lie.theory_cases import random_problem
from reobserve.papers.lie.theory_runs import (
    Case,
    decay_rate,
    deviation_from_linear,
    difference_of_forms,
)
from reobserve.papers.lie.theory_series import (
    Roads,
    ad_matrix,
    lowest_degree,
    solvable,
    sums_of_eigenvalues,
    transformation_by_triangle,
)
from reobserve.polynomials.maps import PolynomialMap
from reobserve.replication.metrics.metrics import lookup
from reobserve.replication.metrics.study_table import StudyTable
from reobserve.replication.parameters.figure_data import FigureData
from reobserve.replication.parameters.job import Job, read_job
from reobserve.replication.parameters.overrides import OVERRIDDEN
from reobserve.signals.series import Series
from tests.observers.test_normal_form_observers import form
from tests.papers.lie.test_errata_series import GENERIC, matrix_of_ad, triangle
from tests.papers.lie.test_paper import evaluator, measured
from tests.synthesis.normal_form import systems
from tests.synthesis.normal_form.systems import (
    QQ,
    difference,
    parts,
    to_polynomials,
    van_der_pol,
    variables,
)

Array = NDArray[np.float64]


@cache
def theory() -> dict[tuple[str, str], float]:
    return {(m.observer, m.metric): m.value for m in evaluator().theory()}


def test_numbers_that_are_known() -> None:
    value = theory()
    # trace and determinant: -1 and 3 for A, 3 and -1 for F - L0 H
    assert value["linear", "eigenvalue_real"] == pytest.approx(-0.5, abs=1e-14)
    assert value["linear", "eigenvalue_imaginary"] == pytest.approx(np.sqrt(11) / 2, abs=1e-14)
    error = np.sqrt(11) / 2 - 1.65831
    assert value["linear", "eigenvalue_error"] == pytest.approx(error, abs=1e-14)
    assert value["linear", "coefficients_printed"] == 10
    assert value["linear", "coefficients_agreeing"] == 10
    assert value["triangle", "first_wrong_degree"] == 7
    # m lambda - lambda for one state: -2 (m - 1)
    assert value["scalar", "smallest_eigenvalue"] == 2.0
    assert value["scalar", "solvable"] == 0
    assert value["nonlinear", "inverse_radius"] == 0
    # -1 - (m1 - m2) i with m1 = m2
    assert value["siegel", "smallest_divisor"] == pytest.approx(1.0, abs=1e-12)
    assert value["siegel", "share_siegel"] == 1


def test_what_is_exact_is_zero() -> None:
    value = theory()
    for name in ("linear", "random", "hidden"):
        assert value[name, "largest_residual"] == 0
    for name in ("linear", "random"):
        assert value[name, "largest_difference"] == 0
    assert value["ad", "off_diagonal"] == 0


def test_the_printed_eigenvalues_leave_one_output() -> None:
    """Two equations for the two entries of H, whose only solution is y = x1."""
    h1, h2 = sympy.symbols("h1 h2")
    A = sympy.Matrix([[0, 1], [-1, 1]]) + sympy.Matrix([-2, -4]) * sympy.Matrix([[h1, h2]])
    real, imaginary = sympy.Rational(-1, 2), sympy.sqrt(11) / 2
    found = sympy.solve([A.trace() - 2 * real, A.det() - real**2 - imaginary**2], [h1, h2])
    assert found == {h1: 1, h2: 0}
    settings = evaluator().ledger.settings("design", "linear")
    settings["plant"]["output"] = [{"component": 1, "powers": [0, 1], "coefficient": 1}]
    with pytest.raises(InputError, match="all real parts must be negative"):
        design_stage.compute(settings)


def changed(**values: Any) -> dict[tuple[str, str], float]:
    """The numbers of the theory with other values in its section."""
    tree = evaluator().ledger.tree
    entries = {
        name: {**tree["theory"][name], "value": value, "source": OVERRIDDEN}
        for name, value in values.items()
    }
    other = {**tree, "theory": {**tree["theory"], **entries}}
    ledger = type(evaluator().ledger)("lie", other, 1)
    return {(m.observer, m.metric): m.value for m in evaluator().sibling(ledger).theory()}


def test_the_triangle_is_right_in_the_other_reading() -> None:
    assert isnan(changed(lie_derivative="of p along U")["triangle", "first_wrong_degree"])


@pytest.mark.nightly
@pytest.mark.parametrize(("order", "gain"), [(2, "series"), (4, "composed"), (6, "jacobian")])
def test_the_comparison_is_that_of_the_ensemble(order: int, gain: str) -> None:
    """On the same grid, in the same steps, by the study."""
    study = evaluator().ledger.tree["studies"]["ensemble"]
    found = changed(
        compared_order=order, compared_gain=gain, compared_points=study["points"]["value"]
    )
    wanted = measured("fig1_ensemble")
    for name, row in (("identity", gain), ("transformed", "transformed")):
        share = wanted.at(row, "share_settled", order=order)
        assert found[name, "share_settled"] == pytest.approx(share, abs=1e-12)
    assert found["constant", "share_settled"] == 1
    assert 0 < found["constant", "latest_settling_time"] < 20
    assert isnan(found["transformed", "latest_settling_time"])
    assert found["identity", "share_better"] == wanted.at(gain, "share_better", order=order)
    most = max(0.0, 1 - wanted.at(gain, "least_ise_ratio", order=order))
    assert found["identity", "largest_improvement"] == pytest.approx(most, abs=1e-12)


def test_the_decay_of_a_small_state_is_that_of_the_slowest_mode() -> None:
    value = theory()
    slowest = value["hidden", "largest_real_part"]
    assert value["hidden", "decay_rate"] == pytest.approx(slowest, rel=0.2)
    # A node, x' = -x and -3 x: after a while the state is its first component.
    x1, x2 = variables(2)
    (y,) = variables(1)
    problem = systems.Case([-x1, -2 * x2], [x2], [0 * y, -y]).problem(2)
    expected = np.log(np.hypot(np.exp(-5), np.exp(-15)) / np.sqrt(2)) / 5
    assert decay_rate(problem) == pytest.approx(expected, rel=1e-6)


def test_the_system_of_the_siegel_domain() -> None:
    """F has its eigenvalues on the imaginary axis, A its own where the ledger says."""
    value = theory()
    radii = [value["siegel", f"radius degree={degree}"] for degree in (21, 41)]
    assert radii[0] == pytest.approx(radii[1], rel=0.01)
    problem = theory_conditions.siegel(read_job(keys.Ledger, settings_of_theory()).theory)
    assert np.allclose(np.linalg.eigvals(problem.F).real, 0.0)
    assert np.allclose(np.sort(np.linalg.eigvals(problem.A).real), [-2.0, -1.0])


def settings_of_theory() -> dict[str, Any]:
    return evaluator().ledger.settings("theory")


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_the_matrix_of_ad_by_another_arithmetic(degree: int) -> None:
    A = [[QQ(-2), QQ(1)], [QQ(-5), QQ(1)]]
    wanted = np.array(matrix_of_ad(A, degree), dtype=float)
    np.testing.assert_array_equal(ad_matrix(np.array([[-2.0, 1.0], [-5.0, 1.0]]), degree), wanted)


def test_sums_of_eigenvalues_by_hand() -> None:
    found = np.sort(sums_of_eigenvalues(np.diag([-1.0, -3.0]), 2).real)
    # -2, -4, -6 plus 1 or plus 3
    np.testing.assert_allclose(found, [-5, -3, -3, -1, -1, 1])


@pytest.mark.parametrize("literal", [False, True])
def test_the_triangle_by_another_arithmetic(literal: bool) -> None:
    for case, degree in ((van_der_pol(), 7), (GENERIC, 5)):
        problem = case.problem(degree)
        roads = Roads(problem)
        U = to_polynomials(PolynomialMap(problem.basis, roads.lie.U))
        U_i = [[parts(p, d, d) for p in U] for d in range(2, degree + 1)]
        wanted = list(U[0].ring.gens)
        for m, part in enumerate(triangle(U_i, literal=literal)):
            factor = QQ(1, int(sympy.factorial(m + 1)))
            wanted = [t + factor * p for t, p in zip(wanted, part, strict=True)]
        T = transformation_by_triangle(problem, roads.lie.U, literal=literal)
        assert to_polynomials(PolynomialMap(problem.basis, T)) == wanted
        assert np.array_equal(T, roads.T) is not literal


def test_the_lowest_degree_of_a_series() -> None:
    problem = van_der_pol().problem(5)
    S = Roads(problem).S
    assert lowest_degree(problem, S) == 1
    higher = S.copy()
    higher[:, problem.basis.part(1)] = 0
    assert lowest_degree(problem, higher) == 3  # f is odd
    assert lowest_degree(problem, 0 * S) == 0


@pytest.mark.parametrize("hidden", [False, True])
def test_random_problems(hidden: bool) -> None:
    for k in range(3):
        problem = random_problem(random_stream(7, "t", str(k)), 3, 3, hidden=hidden)
        system = problem.system
        case = systems.Case(
            to_polynomials(system.dynamics),
            to_polynomials(system.output),
            to_polynomials(problem.injection),
        )
        A = problem.A.astype(float)
        assert np.all(A.diagonal() < -(np.abs(A).sum(axis=1) - np.abs(A.diagonal())))
        seen = np.concatenate([system.H @ np.linalg.matrix_power(system.F, j) for j in range(3)])
        assert (sympy.Matrix(seen).rank() < 3) == hidden
        S = to_polynomials(PolynomialMap(problem.basis, Roads(problem).S))
        left = case.residual_of_s(S)
        assert systems.lowest_degree(left) == 4
        assert systems.lowest_degree(difference(S, variables(3))) == 2


def test_a_resonant_problem_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse_once(problem: Any) -> None:
        monkeypatch.undo()
        first.append(problem)
        raise InputError("poles", "are resonant")

    first: list[Any] = []
    monkeypatch.setattr(theory_cases, "check_nonresonant", refuse_once)
    second = random_problem(random_stream(7, "t", "0"), 3, 3)
    assert np.array_equal(first[0].A, random_problem(random_stream(7, "t", "0"), 3, 3).A)
    assert not np.array_equal(first[0].A, second.A)


def test_a_wrong_series_is_found_out() -> None:
    problem = van_der_pol().problem(5)
    right = Roads(problem)
    assert (right.difference(), right.residual()) == (0, 0)
    wrong = Roads(problem)
    wrong.__dict__["S"] = right.S.copy()
    wrong.S[1, problem.basis.place((3, 0))] += 1
    assert wrong.difference() >= 1
    assert wrong.residual() >= 1
    assert wrong.first_wrong_degree(literal=True) != 3  # T is right
    wrong.__dict__["T"] = right.T + 0
    wrong.T[0, problem.basis.place((2, 1))] += 1
    assert wrong.first_wrong_degree(literal=False) == 3


def test_solvable_is_what_the_roots_say() -> None:
    """x' = -x + x^2 with A = -2 or -3 has no series from degree 2 or 3 on; with -5/2 it has."""
    (x,) = variables(1)
    known = ((-2, 2, False), (-3, 2, True), (-3, 3, False), (QQ(-5, 2), 6, True))
    for pole, degree, wanted in known:
        case = systems.Case([-x + x**2], [x], [(pole + 1) * x])
        assert solvable(case.problem(degree)) is wanted


def test_runs_tell_a_linear_error_from_another() -> None:
    case = Case([2.0, 0.5], [0.0, 0.0], 5.0, 2e-3)
    exact, cut_off = form(5, with_cubic=True), form(5)
    assert deviation_from_linear(exact, 2, case) < 1e-11
    assert difference_of_forms(exact, 2, case) < 1e-9
    assert deviation_from_linear(cut_off, 4, case) > 0.1
    assert difference_of_forms(cut_off, 4, case) > 1.0
    near = [
        deviation_from_linear(cut_off, 4, Case([radius, 0.0], [0.0, 0.0], 1.0, 1e-3))
        for radius in (0.1, 0.05)
    ]
    # What S leaves out begins with degree 7, beside an error of degree 1.
    assert np.log2(near[0] / near[1]) == pytest.approx(6.0, abs=0.3)


def test_the_share_of_pole_choices_by_another_count() -> None:
    stated = read_job(keys.Ledger, settings_of_theory()).theory
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
    assert theory_conditions._share_nonresonant(rules) == pytest.approx(far / 40)
    assert 0 < far < 40


def test_the_least_ratio_is_over_initial_states() -> None:
    def row(name: str, order: int, quantity: str, value: float) -> dict[str, Any]:
        return {"form": name, "order": order, "quantity": quantity, "value": value}

    study = []
    for name, order, errors in (("constant", 0, [2.0, 4.0]), ("series", 4, [1.0, 4.0]),
                                ("series", 2, [float("nan"), 3.0])):  # fmt: skip
        for error in errors:
            study += [row(name, order, "ise", error), row(name, order, "settled", 1.0),
                      row(name, order, "diverged", 0.0)]  # fmt: skip
    kinds = {name: KINDS[name] for name in study[0]}
    data = FigureData(Job(None), Series(np.zeros(1), {}), {}, StudyTable.of(study, kinds))
    found = lookup(metrics_stage._ensemble(data))
    assert found.at("series", "least_ise_ratio", order=4) == 0.5
    assert found.at("series", "median_ise_ratio", order=4) == 0.75
    assert found.at("series", "least_ise_ratio", order=2) == 0.75
    assert isnan(found.at("series", "median_ise_ratio", order=2))
    assert found.at("constant", "least_ise_ratio", order=0) == 1.0


@pytest.mark.parametrize("degree", [2, 3])
def test_one_degree_with_a_wrong_spectrum_shows(
    monkeypatch: pytest.MonkeyPatch, degree: int
) -> None:
    """The number of the ledger's degrees is the worst of them, whichever that is."""
    assert theory()["ad", "spectrum_difference"] < 1e-6
    right = theory_stage.spectrum_difference
    monkeypatch.setattr(
        theory_stage,
        "spectrum_difference",
        lambda A, d: right(A, d) + (0.5 if d == degree else 0.0),
    )
    found = list(theory_stage._series(read_job(keys.Ledger, evaluator().ledger.settings("theory"))))
    (worst,) = (m.value for m in found if m.metric == "spectrum_difference")
    assert worst == pytest.approx(0.5, abs=1e-6)

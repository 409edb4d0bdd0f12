"""Stage theory: what the paper states of series, equations and eigenvalues, in numbers.

Statements about all systems are tried on random ones; everything is exact where it can be.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, located
from reobserve.ledger.types import Job, Settings, named, read_job
from reobserve.models.polynomial import PolynomialSystem
from reobserve.numerics.matrices import as_vector
from reobserve.numerics.random_streams import random_stream
from reobserve.papers.lie import keys, table
from reobserve.papers.lie.setup import build_observer, build_problem, stored_form
from reobserve.papers.lie.theory_cases import random_problem
from reobserve.papers.lie.theory_runs import (
    Case,
    deviation_from_linear,
    difference_of_forms,
    squared_error,
)
from reobserve.papers.lie.theory_series import (
    Roads,
    ad_matrix,
    largest,
    lowest_degree,
    solvable,
    spectrum_difference,
    sums_of_eigenvalues,
)
from reobserve.power_series.maps import PolynomialMap
from reobserve.power_series.monomials import monomials
from reobserve.scoring.metrics import Metric
from reobserve.synthesis.normal_form.convergence import convergence
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.homological import SchurSolver
from reobserve.synthesis.normal_form.lie_transform import lie_transform
from reobserve.synthesis.normal_form.problem import NormalFormProblem, hidden_modes
from reobserve.synthesis.normal_form.resonance import resonance
from reobserve.synthesis.normal_form.solver import identity

Array = NDArray[np.float64]

TRIANGLES = {"triangle_as_printed": True, "triangle": False}  # whether (22) is read literally

_FAR = 0.01  # of the sizes of m.alpha and lambda: a divisor that costs two digits


def measure(settings: Settings, designs: Mapping[str, Any]) -> list[Metric]:
    """The numbers of the paper's theory; see `MEANINGS` of `metrics`.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    return [
        *_example(job, designs["linear"]),
        *_runs(job, designs),
        *_series(job),
        *_random_systems(job.theory.seed, job.theory.cases, job.theory.case_degree),
        *_conditions(job),
    ]


def _example(job: Job, design: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 5 and Remark 4.23: eigenvalues, coefficients as printed, and what is imaginary."""
    theory, body = job.theory, job.designs["linear"]
    problem = build_problem(job.plant, body)
    A, fed = problem.A, problem.A - problem.F
    fastest = max(np.linalg.eigvals(A), key=lambda value: value.imag)
    yield Metric("linear", "eigenvalue_real", float(fastest.real), "1/s")
    yield Metric("linear", "eigenvalue_imaginary", float(fastest.imag), "1/s")
    yield Metric("identity", "largest_real_part", _stability(problem.F + fed), "1/s")
    yield Metric("identity_as_printed", "largest_real_part", _stability(problem.F - fed), "1/s")
    printed = keys.Table("linear", theory.printed, theory.printed_degree)
    rows = table.rows(Job(job.plant, design=body, table=printed), design)
    agrees = [row["agrees"] == "yes" for row in rows if row["printed"]]
    yield Metric("linear", "coefficients_printed", float(len(theory.printed)), "1")
    yield Metric("linear", "coefficients_agreeing", float(sum(agrees)), "1")
    solver = SchurSolver(problem.F, A)
    solve_s(problem, solver)
    lie_transform(problem, solver)
    yield Metric("linear", "imaginary_part", solver.imaginary, "1")


def _runs(job: Job, designs: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 2.2 and Remarks 3.12 and 3.13: errors in z, both forms, and the domain of S and T."""
    theory, plant, observer = job.theory, job.plant, job.observers
    injection, order4 = (named(observer, name, keys.Observer) for name in ("injection", "order4"))
    forms = {
        name: stored_form(plant, job.designs[name], designs[name])
        for name in ("linear", "nonlinear")
    }
    start = as_vector("initial_state", theory.initial_state, forms["linear"].S.variables)
    near = theory.near_share * start
    figure = Case(start, injection.initial_estimate, plant.horizon, injection.sampling_period)
    close = Case(
        near,
        order4.initial_estimate,
        theory.near_duration,
        order4.sampling_period,
    )
    highest = forms["linear"].problem.degree - 1
    for name, order, case in (
        ("linear", highest, close),
        ("nonlinear", injection.order, figure),
    ):
        form = forms[name]
        yield Metric(name, "deviation", deviation_from_linear(form, order, case), "1")
        yield Metric(name, "form_difference", difference_of_forms(form, order, case), "1")
        yield Metric(name, "inverse_radius", _inverse_radius(form.S), "1")
    if theory.injection_form != "transformed":
        injection = keys.Identity(
            "identity",
            injection.design,
            injection.order,
            theory.injection_form,
            injection.initial_estimate,
            injection.sampling_period,
        )
    with located("injection_form"):
        error = squared_error(build_observer(injection, forms["nonlinear"]), figure)
    order4_error = squared_error(build_observer(order4, forms["linear"]), figure)
    yield Metric("injection", "ise_ratio", error / order4_error, "1")


def _series(job: Job) -> Iterator[Metric]:
    """Section 4 on the example: Lie transform and direct roads, Lemma 4.17, the triangle (22)."""
    theory, body = job.theory, job.designs["linear"]
    exact = build_problem(job.plant, body, degree=theory.degree, exact=True)
    roads = Roads(exact)
    yield Metric("linear", "largest_difference", roads.difference(), "1")
    yield Metric("linear", "largest_residual", roads.residual(), "1")
    for name, literal in TRIANGLES.items():
        wrong = roads.first_wrong_degree(literal=literal)
        yield Metric(name, "first_wrong_degree", wrong, "1")
    A = exact.A.astype(np.float64)
    highest = theory.spectrum_degree
    differences = [spectrum_difference(A, d) for d in range(2, highest + 1)]
    yield Metric("ad", "spectrum_difference", max(differences), "1/s")
    diagonal = ad_matrix(np.diag(as_vector("poles", theory.poles, 2)), highest)
    yield Metric("ad", "off_diagonal", largest(diagonal - np.diag(diagonal.diagonal())), "1/s")


@cache
def _random_systems(seed: int, cases: int, degree: int) -> tuple[Metric, ...]:
    """Proposition 3.10, Remark 3.11 and the triangles on systems with terms of all degrees."""
    streams = [random_stream(seed, "lie", "random", str(k)) for k in range(cases)]
    found = [
        Roads(random_problem(stream, 2 + k % 2, degree - k % 2)) for k, stream in enumerate(streams)
    ]
    metrics = [
        Metric("random", "largest_difference", max(one.difference() for one in found), "1"),
        Metric("random", "largest_residual", max(one.residual() for one in found), "1"),
    ]
    problem, lie = found[0].problem, found[0].lie
    for name, series in (("generator", lie.U), ("transformation", lie.T - identity(problem))):
        lowest = float(lowest_degree(problem, series))
        metrics.append(Metric("random", f"lowest_degree_{name}", lowest, "1"))
    for name, literal in TRIANGLES.items():
        wrong = found[0].first_wrong_degree(literal=literal)
        metrics.append(Metric(name, "first_wrong_degree_random", wrong, "1"))
    streams = [random_stream(seed, "lie", "hidden", str(k)) for k in range(cases)]
    hidden = [Roads(random_problem(stream, 3, degree - 1, hidden=True)) for stream in streams]
    unseen = [bool(hidden_modes(*_linear_part(one.problem))) for one in hidden]
    worst = max(_stability(one.problem.A.astype(np.float64)) for one in hidden)
    return (
        *metrics,
        Metric("hidden", "share_unobservable", float(np.mean(unseen)), "1"),
        Metric("hidden", "largest_residual", max(one.residual() for one in hidden), "1"),
        Metric("hidden", "largest_real_part", worst, "1/s"),
    )


def _conditions(job: Job) -> Iterator[Metric]:
    """Remarks 3.7 and 4.19: which condition decides whether there is a transformation."""
    for name, problem in conditions(job.plant, job.theory).items():
        A = problem.A.astype(np.float64)
        degrees = range(2, problem.degree + 1)
        sums = [np.min(np.abs(sums_of_eigenvalues(A, degree))) for degree in degrees]
        yield Metric(name, "smallest_eigenvalue", float(min(sums)), "1/s")
        yield Metric(name, "solvable", float(solvable(problem)), "1")
    yield Metric("nonresonant", "share", _share_nonresonant(job.theory), "1")


def conditions(plant: keys.Plant, theory: keys.Theory) -> dict[str, NormalFormProblem]:
    """Problems with a singular and a regular condition; `InputError` for terms that are none."""
    degree = theory.case_degree
    gain = keys.Design(theory.singular_injection, degree)
    dynamics, injection = (
        PolynomialMap.from_terms(name, terms, 1, 1, exact=True)
        for name, terms in (
            ("regular_dynamics", theory.regular_dynamics),
            ("regular_injection", theory.regular_injection),
        )
    )
    system = PolynomialSystem(dynamics, PolynomialMap.linear(np.array([[1]], dtype=object)))
    return {
        "singular": build_problem(plant, gain, exact=True),
        "regular": NormalFormProblem(system, injection, degree),
    }


def _share_nonresonant(theory: keys.Theory) -> float:
    """Of random real poles for random linear parts of two states, with divisors that are large."""
    stream = random_stream(theory.seed, "lie", "poles")
    basis = monomials(2, theory.printed_degree)
    slowest, fastest = as_vector("poles", theory.poles, 2)
    choices = theory.choices
    far = 0
    for _ in range(choices):
        F = stream.standard_normal((2, 2))
        found = resonance(F, np.diag(stream.uniform(slowest, fastest, 2)), basis)
        far += found.distance >= _FAR * found.size
    return far / choices


def _inverse_radius(series: PolynomialMap) -> float:
    """Of convergence; 0 for a series that ends, nan if its degree is too low to tell."""
    try:
        return 1.0 / convergence(series).radius
    except InputError:
        return float("nan")


def _linear_part(problem: NormalFormProblem) -> tuple[Array, Array]:
    return problem.F.astype(np.float64), problem.system.H.astype(np.float64)


def _stability(matrix: Array) -> float:
    """The largest real part of the eigenvalues."""
    return float(np.max(np.linalg.eigvals(matrix).real))

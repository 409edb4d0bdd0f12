"""Stage theory: what the paper states of series, equations and eigenvalues, in numbers.

Statements about all systems are tried on random ones; everything is exact where it can be.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_vector
from reobserve.core.random_streams import random_stream
from reobserve.papers.lie import keys, table, theory_comparison, theory_conditions
from reobserve.papers.lie.lie_transform import lie_transform
from reobserve.papers.lie.setup import build_problem, stored_form
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
    largest,
    spectrum_difference,
)
from reobserve.polynomials.maps import PolynomialMap
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import Job, Settings, named, read_job
from reobserve.synthesis.linear import unobservable_modes
from reobserve.synthesis.normal_form.convergence import convergence
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.homological import SchurSolver
from reobserve.synthesis.normal_form.problem import NormalFormProblem

Array = NDArray[np.float64]


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
        *theory_conditions.measure(job.theory),
        *theory_comparison.measure(job, designs["linear"]),
    ]


@part
def _example(job: Job, design: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 5 and Remark 4.23: eigenvalues, coefficients as printed, and what is imaginary."""
    theory, body = job.theory, job.designs["linear"]
    problem = build_problem(job.plant, body)
    A = problem.A
    fastest = max(np.linalg.eigvals(A), key=lambda value: value.imag)
    yield Metric("linear", "eigenvalue_real", float(fastest.real), "1/s")
    yield Metric("linear", "eigenvalue_imaginary", float(fastest.imag), "1/s")
    away = np.array([fastest.real, fastest.imag]) - theory.printed_eigenvalue
    yield Metric("linear", "eigenvalue_error", float(np.max(np.abs(away))), "1/s")
    printed = keys.Table("linear", theory.printed, theory.printed_degree)
    rows = table.rows(Job(job.plant, design=body, table=printed), design)
    agrees = [row["agrees"] == "yes" for row in rows if row["printed"]]
    yield Metric("linear", "coefficients_printed", float(len(theory.printed)), "1")
    yield Metric("linear", "coefficients_agreeing", float(sum(agrees)), "1")
    solver = SchurSolver(problem.F, A)
    solve_s(problem, solver)
    lie_transform(problem, solver)
    yield Metric("linear", "imaginary_part", solver.imaginary, "1")


@part
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


@part
def _series(job: Job) -> Iterator[Metric]:
    """Section 4 on the example: Lie transform and direct roads, Lemma 4.17, the triangle (22)."""
    theory, body = job.theory, job.designs["linear"]
    exact = build_problem(job.plant, body, degree=theory.degree, exact=True)
    roads = Roads(exact)
    yield Metric("linear", "largest_difference", roads.difference(), "1")
    yield Metric("linear", "largest_residual", roads.residual(), "1")
    wrong = roads.first_wrong_degree(literal=theory.lie_derivative == "of U along p")
    yield Metric("triangle", "first_wrong_degree", wrong, "1")
    A = exact.A.astype(np.float64)
    highest = theory.spectrum_degree
    differences = [spectrum_difference(A, d) for d in range(2, highest + 1)]
    yield Metric("ad", "spectrum_difference", max(differences), "1/s")
    diagonal = ad_matrix(np.diag(as_vector("poles", theory.poles, 2)), highest)
    yield Metric("ad", "off_diagonal", largest(diagonal - np.diag(diagonal.diagonal())), "1/s")


@part
@cache
def _random_systems(seed: int, cases: int, degree: int) -> tuple[Metric, ...]:
    """Section 2.1, Proposition 3.10 and Remark 3.11 on systems with terms of all degrees."""
    streams = [random_stream(seed, "lie", "random", str(k)) for k in range(cases)]
    found = [
        Roads(random_problem(stream, 2 + k % 2, degree - k % 2)) for k, stream in enumerate(streams)
    ]
    metrics = [
        Metric("random", "largest_difference", max(one.difference() for one in found), "1"),
        Metric("random", "largest_residual", max(one.residual() for one in found), "1"),
        Metric("random", "largest_real_part", _slowest(found), "1/s"),
    ]
    streams = [random_stream(seed, "lie", "hidden", str(k)) for k in range(cases)]
    hidden = [Roads(random_problem(stream, 3, degree - 1, hidden=True)) for stream in streams]
    unseen = [unobservable_modes(*_linear_part(one.problem)).size > 0 for one in hidden]
    return (
        *metrics,
        Metric("hidden", "share_unobservable", float(np.mean(unseen)), "1"),
        Metric("hidden", "largest_residual", max(one.residual() for one in hidden), "1"),
        Metric("hidden", "largest_real_part", _slowest(hidden), "1/s"),
        Metric("hidden", "decay_rate", max(decay_rate(one.problem) for one in hidden), "1/s"),
    )


def _inverse_radius(series: PolynomialMap) -> float:
    """Of convergence; 0 for a series that ends, nan if its degree is too low to tell."""
    try:
        return 1.0 / convergence(series).radius
    except InputError:
        return float("nan")


def _slowest(found: list[Roads]) -> float:
    """The largest real part of all eigenvalues of A."""
    return max(_stability(one.problem.A.astype(np.float64)) for one in found)


def _linear_part(problem: NormalFormProblem) -> tuple[Array, Array]:
    return problem.F.astype(np.float64), problem.system.H.astype(np.float64)


def _stability(matrix: Array) -> float:
    """The largest real part of the eigenvalues."""
    return float(np.max(np.linalg.eigvals(matrix).real))

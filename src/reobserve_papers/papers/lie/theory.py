"""Stage theory: metrics that test the paper's statements on series, eigenvalues and orders.

Statements about all systems are tested on random ones, in rational arithmetic where possible.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import as_vector
from reobserve.observers.normal_form import IdentityObserver, TransformedObserver
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.synthesis.normal_form.convergence import convergence
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.homological import SchurSolver
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.resonance import resonance
from reobserve.synthesis.normal_form.solver import identity, solver_for
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.lie import keys, table
from reobserve_papers.papers.lie.ensemble import RunOutcome, axis, records
from reobserve_papers.papers.lie.lie_transform import lie_transform
from reobserve_papers.papers.lie.operations import operations
from reobserve_papers.papers.lie.plant import build_system
from reobserve_papers.papers.lie.scoring import MEASURES, largest_improvement, share_better
from reobserve_papers.papers.lie.setup import build_problem, stored_form
from reobserve_papers.papers.lie.theory_runs import (
    GROWTH,
    Case,
    copy_decay,
    decay_rate,
    deviation_from_linear,
    difference_of_forms,
    error_decay,
)
from reobserve_papers.papers.lie.theory_series import (
    Solutions,
    ad_matrix,
    largest,
    random_problem,
    residual_of_s,
    series_exists,
    spectrum_difference,
    with_singular_ad,
)
from reobserve_papers.parameters.job import named
from reobserve_papers.plants.polynomial import PolynomialPlant
from reobserve_papers.signals.grid import multiple
from reobserve_papers.signals.random_streams import random_stream

Array = NDArray[np.float64]

_MORE_STATES = (4, 6)  # than the example has
_COUNTED = (3, 5, 7)  # degrees of T at which operations are counted
_ALIKE = {"equations": "alike"}  # solved in both methods


def measure(job: keys.Job, designs: Mapping[str, Any]) -> list[Metric]:
    """The numbers of the paper's theory (see `MEANINGS` of `metrics`)."""
    theory = job.theory
    return [
        *_example(job, designs["linear"]),
        *_runs(job, designs),
        *_series(job),
        *_random_systems(
            theory.seed, theory.cases, theory.case_degree, theory.case_terms,
            theory.decay_start, theory.decay_duration,
        ),
        *_siegel_domain(theory),
        *_nonresonant(theory),
        *_nonresonant_in_more_states(theory),
        *_operations(job),
        *_settled(job, designs),
        *_constant(job, designs),
        *_better(job, designs),
        *_injected(job, designs),
    ]  # fmt: skip


@part
def _example(job: keys.Job, design: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 5 and Remark 4.23: eigenvalues, printed coefficients, and imaginary parts."""
    theory, body = job.theory, job.designs["linear"]
    problem = build_problem(job.plant, body)
    A = problem.A
    fastest = max(np.linalg.eigvals(A), key=lambda value: value.imag)
    away = np.array([fastest.real, fastest.imag]) - theory.printed_eigenvalue
    yield Metric("linear", "eigenvalue_error", float(np.max(np.abs(away))), "1/s")
    printed = keys.Table("linear", theory.printed, theory.printed_degree)
    rows = table.rows(keys.Job(job.plant, design=body, table=printed), design)
    agrees = [row["agrees"] == "yes" for row in rows if row["printed"]]
    yield Metric("linear", "coefficients_printed", float(len(theory.printed)), "1")
    yield Metric("linear", "coefficients_agreeing", float(sum(agrees)), "1")
    solver = SchurSolver(problem.F, A)
    solve_s(problem, solver)
    lie_transform(problem, solver)
    yield Metric("linear", "imaginary_part", solver.imaginary, "1")


@part
def _runs(job: keys.Job, designs: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 2.2 and Remarks 3.12 and 3.13: errors in z, both forms, and the domain of S."""
    theory, plant, observer = job.theory, job.plant, job.observers
    injection, order4 = (named(observer, name, keys.Observer) for name in ("injection", "order4"))
    forms = {
        "linear": _form(build_problem(plant, job.designs["linear"], degree=theory.series_degree)),
        "nonlinear": stored_form(plant, job.designs["nonlinear"], designs["nonlinear"]),
    }
    start = as_vector("initial_state", theory.initial_state, forms["linear"].S.variables)
    figure = Case(start, injection.initial_estimate, plant.horizon, injection.sampling_period)
    near = Case(
        theory.near_share * start, order4.initial_estimate, theory.near_duration,
        order4.sampling_period,
    )  # fmt: skip
    for name, order, case in (
        ("linear", theory.series_degree - 1, near),
        ("nonlinear", injection.order, figure),
    ):
        form = forms[name]
        yield Metric(name, "deviation", deviation_from_linear(form, order, case), "1")
        yield Metric(name, "form_difference", difference_of_forms(form, order, case), "1")
        body = job.designs[name]
        yield Metric(name, "inverse_radius", _inverse_radius(job, body, theory.series_degree), "1")
    linear, size, duration = forms["linear"], theory.decay_start, theory.decay_duration
    yield from _decays("linear", [error_decay(linear.problem, linear.T, size, duration)])
    yield from _decays("copy", [copy_decay(linear.problem, size, duration)])


def _decays(name: str, decays: list[dict[float, float]]) -> Iterator[Metric]:
    """The slowest of some decays, until the state has grown tenfold or by another factor."""
    for growth in decays[0]:
        slowest = max(decay[growth] for decay in decays)
        at = {} if growth == GROWTH else {"growth": growth}
        yield Metric.at(name, ("error_decay", slowest, "1/s"), **at)


@part
def _series(job: keys.Job) -> Iterator[Metric]:
    """Section 4 on the example: Lie transform and direct methods, Lemma 4.17."""
    theory, body = job.theory, job.designs["linear"]
    exact = build_problem(job.plant, body, degree=theory.degree, exact=True)
    solutions = Solutions(exact)
    yield Metric("linear", "largest_difference", solutions.difference(), "1")
    yield Metric("linear", "largest_residual", solutions.residual(), "1")
    # Of z = x, in which nothing is transformed.
    yield Metric("copy", "largest_residual", residual_of_s(exact, identity(exact)), "1")
    yield Metric("remark_3_7", "series_exists", float(series_exists()), "1")
    smallest, residual = with_singular_ad(exact.system)
    yield Metric("remark_4_19", "smallest_eigenvalue", round(smallest, 12), "1/s")
    yield Metric("remark_4_19", "largest_residual", residual, "1")
    A = exact.A.astype(np.float64)
    highest = theory.spectrum_degree
    differences = [spectrum_difference(A, d) for d in range(2, highest + 1)]
    yield Metric("ad", "spectrum_difference", max(differences), "1/s")
    diagonal = ad_matrix(np.diag(as_vector("poles", theory.poles, 2)), highest)
    yield Metric("ad", "off_diagonal", largest(diagonal - np.diag(diagonal.diagonal())), "1/s")


@part
@cache
def _random_systems(
    seed: int, cases: int, degree: int, terms: int, start: float, duration: float
) -> tuple[Metric, ...]:
    """Section 2.1, Proposition 3.10 and Remark 3.11 on systems with terms of all degrees."""

    def drawn(name: str, k: int, states: int, highest: int) -> NormalFormProblem:
        unobservable = name == "unobservable"
        label = "hidden" if unobservable else name  # of the stream: another one draws other systems
        stream = random_stream(seed, "lie", label, str(k))
        return random_problem(stream, states, highest, terms, unobservable=unobservable)

    systems = {
        "random": [drawn("random", k, 2 + k % 2, degree - k % 2) for k in range(cases)],
        "unobservable": [drawn("unobservable", k, 3, degree - 1) for k in range(cases)],
    }
    metrics: list[Metric] = []
    for name, problems in systems.items():
        solutions = [Solutions(problem) for problem in problems]
        decays = [
            error_decay(each.problem, PolynomialMap(each.problem.basis, each.T), start, duration)
            for each in solutions
        ]
        residual = max(each.residual() for each in solutions)
        metrics += [Metric(name, "largest_residual", residual, "1"), *_decays(name, decays)]
        if name == "random":
            difference = max(each.difference() for each in solutions)
            metrics.append(Metric(name, "largest_difference", difference, "1"))
    slowest = max(decay_rate(problem, start, duration) for problem in systems["unobservable"])
    return (*metrics, Metric("unobservable", "decay_rate", slowest, "1/s"))


@part
def _siegel_domain(theory: keys.Theory) -> Iterator[Metric]:
    """Proposition 3.9: whether the radius of convergence settles as the degree doubles."""
    problem = siegel(theory)
    S = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))
    radii = [convergence(S.upto(d)).radius for d in (problem.degree, problem.degree // 2 + 1)]
    yield Metric("siegel", "radius_ratio", radii[0] / radii[1], "1")


def siegel(theory: keys.Theory) -> NormalFormProblem:
    """The test system in the Siegel domain, with y = x1, or `InputError` for invalid terms.

    Thomas, Kwatny & Chang, Proposition 3.9.
    """
    dynamics = PolynomialMap.from_terms("siegel_dynamics", theory.siegel_dynamics, 2, 2)
    injection = PolynomialMap.from_terms("siegel_injection", theory.siegel_injection, 2, 1)
    system = PolynomialSystem(dynamics, PolynomialMap.linear([[1.0, 0.0]]))
    return NormalFormProblem(system, injection, theory.series_degree)


@part
def _nonresonant(theory: keys.Theory) -> Iterator[Metric]:
    """Share of random linear parts of two states with real poles that keep divisors large.

    Up to ``tries`` pairs of poles are drawn for each.
    """
    yield Metric("nonresonant", "share", _nonresonant_share(theory, 2), "1")


@part
def _nonresonant_in_more_states(theory: keys.Theory) -> Iterator[Metric]:
    for states in _MORE_STATES:
        score = ("share", _nonresonant_share(theory, states), "1")
        yield Metric.at("nonresonant", score, states=states)


def _nonresonant_share(theory: keys.Theory, states: int) -> float:
    label = ("poles",) if states == 2 else ("poles", str(states))
    stream = random_stream(theory.seed, "lie", *label)
    basis = monomials(states, theory.printed_degree)
    slowest, fastest = sorted(as_vector("poles", theory.poles, 2))

    def far(F: Array) -> bool:
        nearest = resonance(F, np.diag(stream.uniform(slowest, fastest, states)), basis)
        return nearest.distance >= theory.margin * nearest.size

    matrices = (stream.standard_normal((states, states)) for _ in range(theory.choices))
    good = sum(any(far(F) for _ in range(theory.tries)) for F in matrices)
    return good / theory.choices


@part
def _operations(job: keys.Job) -> Iterator[Metric]:
    """Section 6: operations of the Lie transform and of brute force (see `operations`)."""
    theory = job.theory
    for degree in _COUNTED:
        problem = build_problem(job.plant, job.designs["linear"], degree=degree, exact=True)
        counts, equations = operations(problem), theory.lie_equations
        for name, count, words in (
            ("lie", counts.lie(theory.lie_gain, equations), {}),
            ("brute_force", counts.brute_force(theory.brute_force, "elimination"), {}),
            ("brute_force", counts.brute_force(theory.brute_force, equations), _ALIKE),
        ):
            yield Metric.at(name, ("operations", float(count), "1"), degree=degree, **words)


@part
def _settled(job: keys.Job, designs: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 6: share of initial states from which an order settles, in both forms."""
    for name, outcomes in _outcomes(job, designs, "identity", "transformed", "copy").items():
        settled = float(np.mean([outcome.settled for outcome in outcomes]))
        yield Metric(name, "share_settled", settled, "1")


@part
def _constant(job: keys.Job, designs: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 6: how long the constant gain takes from the worst initial state."""
    for name, outcomes in _outcomes(job, designs, "constant", "copy").items():
        latest = float(np.max([outcome.settling_time for outcome in outcomes]))
        yield Metric(name, "latest_settling_time", latest, "s")


@part
def _better(job: keys.Job, designs: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 6: how often and by how much an order is better than the constant gain.

    `over_copy` compares it with the plant's copy instead.
    """
    error = job.theory.compared_error
    outcomes = _outcomes(job, designs, "identity", "constant", "copy")
    for name, reference in (("identity", "constant"), ("over_copy", "copy")):
        for measure in MEASURES:
            pair = outcomes["identity"], outcomes[reference]
            mine, other = ([outcome.size(error, measure) for outcome in runs] for runs in pair)
            score = ("share_better", share_better(mine, other), "1")
            yield Metric.at(name, score, measure=measure)
            score = ("largest_improvement", largest_improvement(mine, other), "1")
            yield Metric.at(name, score, measure=measure)


@part
def _injected(job: keys.Job, designs: Mapping[str, Any]) -> Iterator[Metric]:
    """Section 6: how often the nonlinear injection at order 0 is better than the constant gain."""
    outcomes = _outcomes(job, designs, "nonlinear", "constant")
    for measure in MEASURES:
        mine, other = (
            [o.size("x", measure) for o in outcomes[name]] for name in ("nonlinear", "constant")
        )
        score = ("share_better_at_order_0", share_better(mine, other), "1")
        yield Metric.at("nonlinear", score, measure=measure)


def _outcomes(
    job: keys.Job, designs: Mapping[str, Any], *names: str
) -> dict[str, list[RunOutcome]]:
    """Outcomes over a grid, of the constant gain, of an order in both forms, and of others.

    Others are the nonlinear injection at order 0, and a copy of the plant without any correction.
    """
    theory, body = job.theory, named(job.observers, "constant", keys.Identity)
    form, injected = (
        stored_form(job.plant, job.designs[name], designs[name]) for name in ("linear", "nonlinear")
    )
    step, order = theory.compared_period, theory.compared_order
    steps = multiple("compared_duration", theory.compared_duration, step, "compared_period")
    with located("compared_order"):
        observers = {
            "constant": IdentityObserver(form, order=0, sampling_period=step),
            "identity": IdentityObserver(
                form, order=order, gain=theory.compared_gain, sampling_period=step
            ),
            "transformed": TransformedObserver(form, order=order, sampling_period=step),
            "nonlinear": IdentityObserver(injected, order=0, sampling_period=step),
        }
    plant = PolynomialPlant(build_system(job.plant))
    estimate = np.array(body.initial_estimate)
    copy = plant.simulate(estimate, 0.5 * step, 2 * steps)[::2]
    coordinates = axis(theory.compared_half_width, theory.compared_points)
    runs = list(records(plant, coordinates, estimate, steps, step))
    band = theory.compared_band
    return {
        name: [
            run.scored(copy, band)
            if name == "copy"
            else run.outcome(observers[name], estimate, band)
            for run in runs
        ]
        for name in names
    }


def _form(problem: NormalFormProblem) -> NormalForm:
    return normal_form(problem.system, problem.degree, injection=problem.injection)


def _inverse_radius(job: keys.Job, design: keys.InjectionDesign, degree: int) -> float:
    """Inverse of the radius of convergence of S, or 0 if it ends, nan if its degree is too low."""
    inverse = float("nan")
    # The high degrees of a series that ends are rounding, so the low degree is tried first.
    for each in (design.degree, degree):
        problem = build_problem(job.plant, design, degree=each)
        S = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))
        try:
            inverse = 1.0 / convergence(S).radius
        except InputError:
            inverse = float("nan")
        if inverse == 0.0:
            break
    return inverse

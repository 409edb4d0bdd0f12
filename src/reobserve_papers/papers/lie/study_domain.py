"""Domains where the series of S and T converge, and their errors on the limit cycle.

On the limit cycle the true z = S(x) is known without any series: it is the periodic solution of
z' = A z - l(h(x(t))), to which every solution converges, because A is stable.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import located
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.convergence import Convergence, convergence
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.floquet import LimitCycle, limit_cycle
from reobserve_papers.papers.lie.setup import build_problem, forms
from reobserve_papers.papers.lie.study_rows import Row, summary
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

_FORGOTTEN = 1e-15  # share of the initial z that is left when the true z is taken


def run(
    job: keys.Job, study: keys.DomainStudy, plant: Series, design: Mapping[str, Any]
) -> list[Row]:
    """Rows: the boundary of the domain, radii by degree, errors of the series on the cycle."""
    form = forms(job, study.design, design)[study.design]
    with located("studies.domain"):
        cycle = limit_cycle(form.problem.system, plant["state"][0], study.settle)
    degree, count = study.degree, study.cycle_points
    body = job.designs[study.design]
    problem = build_problem(job.plant, body, degree=degree)
    S = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))
    x = cycle.points(count)
    z = _true_coordinates(problem, cycle, x)
    distance = float(np.min(np.linalg.norm(x, axis=1)))
    domain = convergence(S)
    states = plant["state"][:: max(1, len(plant.time) // 2000)]
    rows = [
        summary("cycle", 0, "distance", distance, "1"),
        *_growth("cycle", domain.growth(x)),
        *_growth("plant", domain.growth(states)),
        *_points("cycle", 0, "point", x),
        *_points("S", degree, "boundary", _boundary(domain, count)),
    ]
    # f is odd, and so are S and T: every other degree adds nothing.
    radii = {d: convergence(S.upto(d)).radius for d in range(keys.LEAST_DEGREE, degree + 1, 2)}
    rows += [summary("S", d, "radius", radius, "1") for d, radius in radii.items()]
    half = convergence(S.upto(max(keys.LEAST_DEGREE, degree // 2 + 1))).radius
    rows.append(summary("S", 0, "radius_ratio", convergence(S).radius / half, "1"))
    for name, series, at, true in (("S", S, x, z), ("T", form.T, z, x)):
        sums = np.cumsum(series.parts(at), axis=0)
        rows += [
            summary(
                name, d, "largest_error", float(np.max(np.linalg.norm(sums[d] - true, axis=1))), "1"
            )
            for d in range(1, series.degree + 1, 2)
        ]
    return rows


def _growth(form: str, growth: Array) -> list[Row]:
    """Minimum and maximum factor by which the parts of S grow with their degree."""
    return [
        summary(form, 0, "minimum_growth", float(np.min(growth)), "1"),
        summary(form, 0, "maximum_growth", float(np.max(growth)), "1"),
    ]


def _points(form: str, order: int, quantity: str, points: Array) -> list[Row]:
    """One row per point of the plane, numbered from 0."""
    return [
        Row(form, order, float(x1), float(x2), quantity, float(k), "1")
        for k, (x1, x2) in enumerate(points)
    ]


def _boundary(domain: Convergence, count: int) -> Array:
    """The edge of the domain of convergence in each direction of the plane, shape (count, 2)."""
    angle = np.arange(count) * (2 * np.pi / count)
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    edge: Array = directions / domain.growth(directions)[:, None]
    return edge


def _true_coordinates(problem: NormalFormProblem, cycle: LimitCycle, x: Array) -> Array:
    """True z = S(x) at the points of the cycle, from the observer's own linear dynamics."""
    from scipy.integrate import solve_ivp

    n, system = problem.system.states, problem.system

    def slope(_: float, values: Array) -> Array:
        state, z = values[:n], values[n:]
        fed = problem.injection(system.output(state))
        return np.concatenate([system.dynamics(state), problem.A @ z - fed])

    slowest = float(np.max(np.linalg.eigvals(problem.A).real))
    first = np.ceil(np.log(_FORGOTTEN) / slowest / cycle.period) * cycle.period
    time = first + np.arange(len(x)) * (cycle.period / len(x))
    start = np.concatenate([cycle.start, np.zeros(n)])
    solution = solve_ivp(
        slope,
        (0, first + cycle.period),
        start,
        method="DOP853",
        t_eval=time,
        rtol=1e-11,
        atol=1e-12,
    )
    z_true: Array = solution.y[n:].T
    return z_true

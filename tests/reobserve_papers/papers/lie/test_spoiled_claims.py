"""Main claims with one outcome in all samples: a spoiled formula gives the other one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from reobserve_papers.claims.outcomes import outcome
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.metrics.metrics import Metric, Numbers, lookup
from reobserve_papers.papers.lie import design, keys, lie_transform, study_orders, theory_series
from reobserve_papers.papers.lie import theory as theory_stage
from reobserve_papers.papers.lie.floquet import LimitCycle, limit_cycle
from reobserve_papers.papers.lie.plant import build_system
from reobserve_papers.papers.lie.setup import build_problem, stored_form
from reobserve_papers.papers.lie.theory_runs import error_decay
from reobserve_papers.papers.lie.theory_series import Solutions, random_problem
from reobserve_papers.parameters.parameters import default_parameters
from reobserve_papers.signals.random_streams import random_stream
from tests import ROOT
from tests.reobserve_papers.papers import fixed_parameters, job_of

Figures = dict[str, Numbers]


@cache
def job() -> keys.Job:
    """Few initial states, short runs, and series of low degrees."""
    theory = {"compared_points": 3, "compared_duration": 10.0, "series_degree": 25}
    made: keys.Job = job_of(fixed_parameters("lie", {"theory": theory}, 1), "theory")
    return made


@cache
def reached() -> LimitCycle:
    return limit_cycle(build_system(job().plant), [2.0, 0.5], 20.0)


@cache
def problems() -> Mapping[str, Any]:
    """The example, to where the first terms of the Lie transform differ, and a random system."""
    exact = build_problem(job().plant, job().designs["linear"], degree=5, exact=True)
    return {"linear": exact, "random": random_problem(random_stream(1, "spoiled"), 2, 3, 3)}


def transformed(spoil: bool, patch: pytest.MonkeyPatch) -> Figures:
    """With ad_f U = U' f + f' U."""
    plain = lie_transform.add_derivatives_along
    if spoil:
        patch.setattr(
            lie_transform, "add_derivatives_along", lambda *a: plain(*a[:6], abs(a[6]), a[7])
        )
    found = {name: Solutions(one).difference() for name, one in problems().items()}
    return theory(Metric(name, "largest_difference", one, "1") for name, one in found.items())


def existing(spoil: bool, patch: pytest.MonkeyPatch) -> Figures:
    """With solutions P of the wrong sign."""
    plain = theory_series.solver_for
    if spoil:
        patch.setattr(theory_series, "solver_for", lambda p: lambda *a: -plain(p)(*a))
    metrics = []
    for name, one in problems().items():
        found = Solutions(one)
        T = theory_series.PolynomialMap(one.basis, found.T)
        metrics += theory_stage._decays(name, [error_decay(one, T, 0.01, 5.0)])
        metrics.append(Metric(name, "largest_residual", found.residual(), "1"))
    return theory(metrics)


def constant(spoil: bool, _: pytest.MonkeyPatch) -> Figures:
    """With the sign of the gain that (11) prints."""
    mine = job()
    stored = {name: design.compute(replace(mine, design=mine.designs[name])) for name in SERIES}
    if spoil:
        for name in ("S", "gain"):
            stored["linear"][name] = [[-value for value in row] for row in stored["linear"][name]]
    form = stored_form(mine.plant, mine.designs["linear"], stored["linear"])
    cycle = reached()
    rate = study_orders._exponent(cycle, cycle.points(400), form, "series", 0, "constant")
    fig1 = lookup([Metric("constant", "floquet_exponent", rate.value, "1/s")])
    return {**theory(theory_stage._constant(mine, stored)), "fig1": fig1}


def injected(spoil: bool, _: pytest.MonkeyPatch) -> Figures:
    """With cubic terms of the wrong sign."""
    mine, metrics = job(), []
    for name in SERIES:
        body = mine.designs[name]
        if spoil:
            body = replace(body, injection=[
                {**term, "coefficient": (-1) ** (sum(term["powers"]) > 1) * term["coefficient"]}
                for term in body.injection
            ])  # fmt: skip
        inverse = theory_stage._inverse_radius(mine, body, mine.theory.series_degree)
        metrics.append(Metric(name, "inverse_radius", inverse, "1"))
    return theory(metrics)


SERIES = ("linear", "nonlinear")


def theory(metrics: Any) -> Figures:
    return {"theory": lookup(metrics)}


SPOILED: dict[str, Callable[[bool, pytest.MonkeyPatch], Figures]] = {
    "lie_transform": transformed,
    "existence": existing,
    "constant_gain_effective": constant,
    "injection_enlarges_domain": injected,
}


@cache
def registered() -> list[Claim]:
    return read_registry(ROOT, default_parameters(ROOT, "lie")).claims


@pytest.mark.parametrize("spoil", [False, True])
@pytest.mark.parametrize("name", SPOILED)
def test_claim_fails_where_it_is_spoiled(
    name: str, spoil: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    claim = next(one for one in registered() if one.name == name)
    assert (outcome(claim, SPOILED[name](spoil, monkeypatch)) == "holds") != spoil

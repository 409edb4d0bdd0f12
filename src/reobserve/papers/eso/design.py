"""Stage design: gains of an observer, certified; the ``kind`` of a design in the ledger is one of

pi_feasible       the PI observer by feasibility with a decay rate
pi_least_norm     the PI observer by optimisation, gamma fixed
pd_pi_least_norm  the PD/PI observer by optimisation, gamma fixed
pd_pi_bounded     Theorem 1, min gamma, with poles not faster than a bound and matrices in a radius
"""

from __future__ import annotations

from typing import Any

from reobserve.ledger.types import Settings, read_job
from reobserve.papers.eso import keys
from reobserve.papers.eso.setup import augmented
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.design import Design


def compute(settings: Settings) -> dict[str, Any]:
    """Gains, solver, status, gamma and certificate, as plain JSON values, and the filter's rate.

    Raises
    ------
    InputError
        If a value cannot be used, the solver fails, or the certificate does not hold.
    """
    job = read_job(keys.Ledger, settings)
    body = job.design
    return {"filter_rate": body.filter_rate, **design(job.plant, body).to_dict()}


def design(plant: keys.Plant, stated: keys.Design) -> Design:
    """The design that a ledger states; raises as `compute`."""
    system, solver = augmented(plant, stated.filter_rate), stated.solver
    if isinstance(stated, keys.Feasible):
        return pi.design_feasible(system, stated.decay, solver)
    if isinstance(stated, keys.Bounded):
        return pd_pi.design_least_gamma(system, 0.0, stated.pole_bound, stated.radius, solver)
    by_kind = {"pi_least_norm": pi.design, "pd_pi_least_norm": pd_pi.design}
    return by_kind[stated.kind](system, stated.factor, None, solver)

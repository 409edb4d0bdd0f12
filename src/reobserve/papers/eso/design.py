"""Stage design: gains of an observer, certified; the ``kind`` of a design in the ledger is one of

pi_feasible       the PI observer by feasibility with a decay rate
pi_least_norm     the PI observer by optimisation, gamma fixed
pd_pi_least_norm  the PD/PI observer by optimisation, gamma fixed
pd_pi_bounded     Theorem 1, min gamma, with poles not faster than a bound and matrices in a radius
"""

from __future__ import annotations

from typing import Any

from reobserve.errors import InputError
from reobserve.papers.eso.setup import augmented
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.design import Design

KINDS = ("pi_feasible", "pi_least_norm", "pd_pi_least_norm", "pd_pi_bounded")


def compute(settings: dict[str, Any]) -> dict[str, Any]:
    """Gains, solver, status, gamma and certificate, as plain JSON values, and the filter's rate.

    Raises
    ------
    InputError
        If a value cannot be used, the solver fails, or the certificate does not hold.
    """
    body = settings["design"]
    return {"filter_rate": body["filter_rate"], **design(settings["plant"], body).to_dict()}


def design(plant: dict[str, Any], body: dict[str, Any]) -> Design:
    """The design that a ledger's body asks for; raises as `compute`."""
    kind = body["kind"]
    check_kind(kind)
    system = augmented(plant, body["filter_rate"])
    solver = body["solver"]
    if kind == "pi_feasible":
        return pi.design_feasible(system, body["decay"], solver)
    if kind == "pi_least_norm":
        return pi.design(system, body["factor"], None, solver)
    if kind == "pd_pi_least_norm":
        return pd_pi.design(system, body["factor"], None, solver)
    return pd_pi.design_least_gamma(system, 0.0, body["pole_bound"], body["radius"], solver)


def check_kind(kind: Any) -> None:
    """Refuse a kind of design that there is not."""
    if kind not in KINDS:
        raise InputError("kind", f"{kind!r} must be one of {', '.join(KINDS)}")

"""Stage design: certified gains of an observer. The ``kind`` of a design is one of

pi_feasible      the PI observer by feasibility with a decay rate
pi_optimised     the PI observer by optimisation
pd_pi_optimised  the PD/PI observer by optimisation

and the ``criterion`` of an optimisation is one of

minimum_norm     gamma fixed at a multiple of its lower bound, with matrices of minimum norm
minimum_gamma    minimum gamma with no pole faster than a bound and matrices within a radius
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import lru_cache
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.design import CertifiedGains
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso.setup import augmented


def compute(job: keys.Job) -> dict[str, Any]:
    """Compute gains, solver, status, gamma, certificate and filter rate, as plain JSON values."""
    body = job.design
    return {"filter_rate": body.filter_rate, **design(job.plant, body).to_dict()}


def design(plant: keys.Plant, body: keys.Design) -> CertifiedGains:
    """The design that the parameters specify (raises as `compute`).

    It is cached, because samples of other parameters, such as the hold period, need it again.
    """
    system = augmented(plant, body.filter_rate)
    matrices = (getattr(system, each.name) for each in fields(system))
    return _designed(tuple(tuple(map(tuple, matrix.tolist())) for matrix in matrices), body)


@lru_cache(maxsize=200)
def _designed(matrices: Any, body: keys.Design) -> CertifiedGains:
    system, solver = AugmentedSystem(*matrices), body.solver
    if isinstance(body, keys.Feasible):
        return _feasible(system, body)
    derivative = body.kind == "pd_pi_optimised"
    if body.criterion == "minimum_norm":
        return pd_pi.design(system, body.factor, solver=solver, derivative=derivative)
    return pd_pi.design_minimum_gamma(
        system, 0.0, body.pole_bound, body.radius, solver, derivative=derivative
    )


def _feasible(system: AugmentedSystem, body: keys.Feasible) -> CertifiedGains:
    """The design from a solution in which currents are in `current_unit`, in SI units.

    The states and outputs are T x and T y there; C is the identity, the same in all units. All have
    the same solutions, but not the same one of minimum norm.
    """
    T = np.array([1.0, 1e3 if body.current_unit == "mA" else 1.0])
    sizes = np.array([*T, *T, 1.0, 1.0])[:, None]  # of x, xz, fa, fs
    entering = {key: T[:, None] * getattr(system, key) for key in ("B", "Dd", "Dw", "Fa", "Fs")}
    there = replace(system, A=T[:, None] * system.A / T, **entering)
    found = pi.design_feasible(there, body.decay, body.solver, body.solution)
    gains = Gains(found.gains.L * T / sizes, found.gains.Ld)
    certificate = certify(system, gains, decay=body.decay)
    if not certificate.holds:
        raise InputError("current_unit", f"{body.current_unit}: {certificate.reason}")
    return replace(found, gains=gains, certificate=certificate)


def stored_design(
    plant: keys.Plant, values: Mapping[str, Any]
) -> tuple[AugmentedSystem, CertifiedGains]:
    """The system of a stored design, and the design."""
    rest = {name: value for name, value in values.items() if name != "filter_rate"}
    certified = CertifiedGains.from_dict(rest)
    if "filter_rate" not in values:
        raise InputError("design", "has no key 'filter_rate'")
    system = augmented(plant, as_positive("filter_rate", values["filter_rate"]))
    wanted = (system.size, len(system.C))
    for name, gain in (("L", certified.gains.L), ("Ld", certified.gains.Ld)):
        if gain.shape != wanted:
            raise InputError(f"design.{name}", f"has shape {gain.shape}, must be {wanted}")
    return system, certified

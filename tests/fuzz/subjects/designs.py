"""Designs of extended state observers and normal forms, their proofs, and designs as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.designs.file import kind_of, load_design, save_design
from reobserve.designs.poles import parse_poles
from reobserve.models.polynomial import PolynomialSystem
from reobserve.plain_data.documents import parse_yaml
from reobserve.power_series.maps import PolynomialMap
from reobserve.synthesis.definiteness import ball_matrix, prove_negative_definite
from reobserve.synthesis.extended_state import pd_pi, pi, structured
from reobserve.synthesis.extended_state.certificate import certify, error_system
from reobserve.synthesis.extended_state.deviation import held_deviation
from reobserve.synthesis.extended_state.floor import as_gamma, gamma_floor
from reobserve.synthesis.extended_state.system import AugmentedSystem
from reobserve.synthesis.normal_form.convergence import convergence, part_norms
from reobserve.synthesis.normal_form.design import normal_form
from reobserve.synthesis.normal_form.placement import injection_for
from reobserve.synthesis.normal_form.problem import NormalFormProblem

from .. import material
from .models import van_der_pol
from .observers import augmented, gains
from .subject import Subject, subject


def subjects() -> Iterator[Subject]:
    """Calls that must be accepted."""
    system, found = augmented(), gains()
    names = ("A", "B", "C", "Dd", "Dw", "Fa", "Fs", "Az")
    yield subject(AugmentedSystem, *(getattr(system, name) for name in names))
    yield subject(gamma_floor, system)
    yield subject(as_gamma, system, 1.05)
    yield subject(error_system, system, found)
    yield subject(certify, system, found, 100.0)
    yield subject(held_deviation, system, found, np.ones(3), 0.1)
    yield Subject("synthesis.extended_state.pi.design", pi.design, (system, 1.05))
    yield Subject("synthesis.extended_state.pd_pi.design", pd_pi.design, (system, 1.05))
    yield Subject("synthesis.extended_state.pi.design_feasible", pi.design_feasible, (system, 1.0))
    yield Subject("synthesis.extended_state.structured.design", structured.design, (system, 1.05))
    least = pd_pi.design_least_gamma
    yield Subject("synthesis.extended_state.pd_pi.design_least_gamma", least, (system, 2.0, 50.0))
    yield subject(ball_matrix, [[-2.0, 1.0], [1.0, -2.0]])
    yield subject(prove_negative_definite, [[-2.0, 1.0], [1.0, -2.0]])
    yield from _normal_forms()
    yield from _files()


def _files() -> Iterator[Subject]:
    path = material.scratch("design.json")
    kind: Any = kind_of("luenberger")
    made = save_design(path, kind.designed(parse_yaml(kind.example, "model.yaml")))
    yield subject(load_design, path)
    yield subject(save_design, Path("again.json"), made)
    yield subject(kind_of, "luenberger")
    yield subject(parse_poles, "-2, -1+3j, -1-3j")


def _normal_forms() -> Iterator[Subject]:
    system = van_der_pol()
    linear = PolynomialMap.linear(np.array([[-2.0], [-1.0]]))
    yield subject(NormalFormProblem, system, linear, 3)
    yield subject(injection_for, system, [-1.7, -2.3], takes=("complex",))
    # Its series converge up to 1, and that can be seen.
    known = PolynomialSystem.from_expressions(["x + x**2"], ["x"], ["x"], 2)
    series = normal_form(known, 13, poles=[-0.5])
    yield subject(convergence, series.S)
    yield subject(part_norms, series.S)

"""Valid calls of models, synthesis and designs that no example of a docstring has."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from reobserve.core.documents import parse_yaml
from reobserve.estimation.families import family
from reobserve.estimation.families.examples import model_text
from reobserve.estimation.families.file import load_design, save_design
from reobserve.synthesis.ilo_certificate import certify
from reobserve.synthesis.ilo_error_system import LearningLaw
from tests.reobserve.observers.small_plants import first_order_lag

from . import models
from .call import Call, called
from .models import INERTIA, TRANSITION, van_der_pol


def calls() -> Iterator[Call]:
    """All of them."""
    for part in (_basics, _models, _synthesis, _designs):
        yield from part()


def _basics() -> Iterator[Call]:
    hold = (TRANSITION, [[0.0], [1.0]], 0.1)
    yield from called({
        "core.discretisation.interpolating_hold": (*hold, [0.0, 1.0]),
        "core.discretisation.polynomial_hold": (*hold, 1),
    })  # fmt: skip


def _models() -> Iterator[Call]:
    lag, system = first_order_lag(), van_der_pol()
    yield from called({
        "systems.triangular.TriangularModel": (1, lag.drift, lag.input_gain, np.ones(2)),
        "systems.polynomial.PolynomialSystem": (system.dynamics, system.output),
    })  # fmt: skip


def _synthesis() -> Iterator[Call]:
    parameters = (INERTIA, 500.0, np.eye(3), 0.9, 50.0, 0.01)
    law, zeros = LearningLaw(*parameters), np.zeros((4, 3))
    negative = ([[-2.0, 1.0], [1.0, -2.0]],)
    yield from called({
        "synthesis.ilo_error_system.LearningLaw": parameters,
        "synthesis.ilo_accuracy.error_transfer": ([1.0, 2.0], law),
        "synthesis.ilo_accuracy.sampled_error_transfer": ([1.0, 2.0], law),
        "synthesis.ilo_accuracy.matched_integrator": (500.0, 0.01),
        "synthesis.ilo_accuracy.pi_error_transfer": (
            [1.0], INERTIA, 500.0, np.eye(3), 1000.0, 10.0,
        ),
        "synthesis.ilo_sampled_stability.held_blocks": (law,),
        "synthesis.ilo_sampled_stability.sampled_map": (law,),
        "synthesis.ilo_stability.continuous_stability": (law,),
        "synthesis.ilo_certificate.lemma1_sides": (zeros, zeros, zeros, 0.9, 50.0, 1.0, 1.0, 1.0),
        "synthesis.ilo_certificate.bound18": (
            certify(3.0, 1.0, 0.5, 0.5).theorem, np.ones((5, 3)), np.ones((5, 3)), 0.1,
        ),
        "synthesis.high_gain_design.lyapunov_matrix": (3, 2.0),
        "synthesis.high_gain_design.high_gain": (3, 2.0),
        "synthesis.high_gain_design.high_gain_over_time": (2, 2.0, np.eye(2), [0.0, 1.0]),
        "synthesis.h_infinity_norm.h_infinity_norm": (
            [[-1.0]], [[1.0]], [[1.0]], [[1.0]], 1e-9,
        ),
        "synthesis.definiteness.ball_matrix": negative,
        "synthesis.definiteness.prove_negative_definite": negative,
    })  # fmt: skip


def _designs() -> Iterator[Call]:
    system, found = models.augmented(), models.gains()
    kind: Any = family("luenberger")
    path = Path(mkdtemp()) / "design.json"
    save_design(path, kind.designed(parse_yaml(model_text("luenberger"), "model.yaml")))
    yield from called({
        "synthesis.extended_state.gamma_bound.gamma_lower_bound": (system,),
        "synthesis.extended_state.gamma_bound.as_gamma": (system, 1.05),
        "synthesis.extended_state.certificate.error_system": (system, found),
        "synthesis.extended_state.certificate.certify": (system, found, 100.0),
        "synthesis.extended_state.pi.design": (system, 1.05),
        "synthesis.extended_state.pi.design_feasible": (system, 1.0),
        "synthesis.extended_state.pd_pi.design": (system, 1.05),
        "synthesis.extended_state.pd_pi.design_minimum_gamma": (system, 2.0, 50.0),
        "estimation.families.file.load_design": (path,),
        "estimation.families.file.save_design": (Path("again.json"), load_design(path)),
        "estimation.families.family": ("luenberger",),
    })  # fmt: skip

"""Valid calls of everything except observers: models, synthesis, designs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pandas as pd

from reobserve.core.documents import parse_yaml
from reobserve.estimation.families import family
from reobserve.estimation.families.file import load_design, save_design
from reobserve.observers.kalman import KalmanFilter
from reobserve.synthesis.ilo_certificate import certify
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.systems.linear import LinearModel
from reobserve.tuning.fit import fit
from reobserve.tuning.search import tune
from tests.reobserve.observers.small_plants import first_order_lag

from . import models
from .call import Call, called
from .models import INERTIA, TRANSITION, VAN_DER_POL, van_der_pol


def calls() -> Iterator[Call]:
    """All of them."""
    for part in (_basics, _models, _synthesis, _designs):
        yield from part()


def _basics() -> Iterator[Call]:
    def tuned(make: Any, ranges: Any, records: Any, score: Any, budget: Any, seed: Any) -> object:
        # A type can be called, and what it raises when it is called is the caller's affair.
        make = dict if isinstance(make, type) else make
        score = (lambda *_: 1.0) if isinstance(score, type) else score
        return tune(make, ranges, records, score, budget, seed)

    yield Call(
        "tuning.search.tune", tuned,
        (lambda found: found, {"gain": (0.1, 10.0)}, [1.0], lambda found, _: found["gain"], 5, 1),
    )  # fmt: skip

    def fitted(ranges: Any, records: Any, budget: Any, seed: Any) -> object:
        def make(values: Any) -> Any:
            kalman = KalmanFilter(LinearModel([[0.5]], C=[[1]], Q=values["q"], R=1.0))
            return kalman, kalman.init([0.0], 1.0)

        return fit(make, ranges, records, budget=budget, seed=seed)

    level = np.sin(np.arange(60.0) ** 2)
    specification = {
        "observer": {
            "kind": "luenberger", "time": "discrete", "A": [[1.0]], "C": [[1.0]], "poles": [0.5],
        },
        "columns": {"measurements": [{"column": "y"}]}, "sampling": {"period": 1.0},
    }  # fmt: skip
    yield from called(
        {"estimation.estimates.estimate": (specification, pd.DataFrame({"y": level}))}
    )
    yield Call("tuning.fit.fit", fitted, ({"q": (1e-3, 10.0)}, [level], 500, 1))
    hold = (TRANSITION, [[0.0], [1.0]], 0.1)
    yield from called({
        "detection.false_alarms.false_alarm_threshold": (np.arange(19.0), 0.05),
        "core.discretisation.zero_order_hold": hold,
        "core.discretisation.interpolating_hold": (*hold, [0.0, 1.0]),
        "core.discretisation.polynomial_hold": (*hold, 1),
    })  # fmt: skip


def _models() -> Iterator[Call]:
    lag, system = first_order_lag(), van_der_pol()
    yield from called({
        "systems.linear.LinearModel": (
            TRANSITION, [[0.0], [0.01]], [[1.0, 0.0]], [[0.0]], 1e-4, 1e-2,
        ),
        "systems.rigid_body.RigidBody": (INERTIA, np.eye(3), np.eye(3)),
        "systems.triangular.TriangularModel": (1, lag.drift, lag.input_gain, np.ones(2)),
        "systems.triangular_text.triangular_model": (["a", "b"], ["0", "-a"], "1"),
        "systems.polynomial.PolynomialSystem": (system.dynamics, system.output),
        "systems.polynomial.PolynomialSystem.from_expressions": (VAN_DER_POL, ["a"], ["a", "w"], 3),
    })  # fmt: skip


def _synthesis() -> Iterator[Call]:
    parameters = (INERTIA, 500.0, np.eye(3), 0.9, 50.0, 0.01)
    law, zeros = LearningLaw(*parameters), np.zeros((4, 3))
    negative = ([[-2.0, 1.0], [1.0, -2.0]],)
    yield from called({
        "synthesis.ilo_error_system.LearningLaw": parameters,
        "synthesis.ilo_accuracy.error_transfer": ([1.0, 2.0], law),
        "synthesis.ilo_accuracy.sampled_error_transfer": ([1.0, 2.0], law),
        "synthesis.ilo_accuracy.predicted_rms_error": ([[1.0, 0, 0]], [10.0], law),
        "synthesis.ilo_accuracy.matched_integrator": (500.0, 0.01),
        "synthesis.ilo_accuracy.pi_error_transfer": (
            [1.0], INERTIA, 500.0, np.eye(3), 1000.0, 10.0,
        ),
        "synthesis.ilo_sampled_stability.held_blocks": (law,),
        "synthesis.ilo_sampled_stability.sampled_map": (law,),
        "synthesis.ilo_sampled_stability.sampled_stability": (law,),
        "synthesis.ilo_sampled_stability.sampled_limit_gain": (law,),
        "synthesis.ilo_stability.continuous_stability": (law,),
        "synthesis.ilo_certificate.lemma1_sides": (zeros, zeros, zeros, 0.9, 50.0, 1.0, 1.0, 1.0),
        "synthesis.ilo_certificate.certify": (500.0, np.eye(3), 0.5, 50.0, 0.01),
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
    save_design(path, kind.designed(parse_yaml(kind.example, "model.yaml")))
    matrices = tuple(getattr(system, key) for key in ("A", "B", "C", "Dd", "Dw", "Fa", "Fs", "Az"))
    yield from called({
        "synthesis.extended_state.system.AugmentedSystem": matrices,
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

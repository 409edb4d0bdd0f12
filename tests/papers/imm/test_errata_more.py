"""More of what is printed wrong or twice differently in Gadsden, McCullough & Habibi 2011."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.ledger.config import read_yaml
from reobserve.ledger.ledger import Ledger
from reobserve.models.linear import LinearModel
from reobserve.observers.imm_loop import mixing_probabilities
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.pipeline.evaluation import evaluate
from reobserve.scoring.metrics import lookup

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[3]
SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]
STICKY = 0.023 * np.ones((3, 3)) + 0.931 * np.eye(3)  # p_ii = 0.954
MU = np.array([0.6, 0.3, 0.1])


def mixing(transition: Array, mu: Array) -> tuple[Array, Array]:
    """Our mu(i|j) and c_j."""
    weights, predicted = np.empty_like(transition), np.empty_like(mu)
    mixing_probabilities(transition, np.log(mu), weights, predicted)
    return weights, np.exp(predicted)


# --- (4) and (5) against (15) and (16): K is a correction, or a gain ----------------------------


@pytest.mark.parametrize("e", [0.2, 3.0, -3.0])
def test_4_in_16_multiplies_by_the_innovation_twice(e: float) -> None:
    correction = abs(e) * np.clip(e / 0.1, -1, 1)  # (4) without memory
    one = LinearModel([[1.0]], np.empty((1, 0)), [[1.0]], 0.0, 1.0)
    smooth = SmoothVariableStructureFilter(one, 0.1, 0.0)
    told = smooth.correct(smooth.init([0.0], 1.0).belief, [e])
    assert told.belief.mean == pytest.approx([correction]), "(5): K alone is added"
    assert told.belief.error == pytest.approx([0.0], abs=1e-15)
    printed = correction * e  # (16) with the K of (4)
    assert e - printed == pytest.approx(e - e**2)
    assert abs(e - printed) > 0.15


# --- (7): the sum's index is raised, and its name is another's ----------------------------------


def test_7_is_no_predicted_probability_of_a_mode() -> None:
    # What the chain predicts is c_j of (8): one number a mode, together one.
    weights, c = mixing(STICKY, MU)
    assert c == pytest.approx(MU @ STICKY)
    assert c.sum() == pytest.approx(1.0)
    assert weights.sum() == pytest.approx(3.0), "(7): where a mode may have come from, r densities"
    assert np.abs(weights.sum(axis=1) - c).min() > 0.04


# --- Nomenclature: j is the number of filters, or one of them -----------------------------------


def test_with_j_for_the_number_of_filters_one_sum_would_serve_all() -> None:
    weights, c = mixing(STICKY, MU)
    number = 3
    printed = STICKY * MU[:, None] / (STICKY[:number, number - 1] @ MU[:number])
    assert printed[:, -1] == pytest.approx(weights[:, -1])
    assert printed.sum(axis=0) == pytest.approx(c / c[-1])
    assert printed.sum(axis=0)[0] > 5


# --- "In this case there are two models" --------------------------------------------------------


# --- Fig. 8's caption: an increased layer -------------------------------------------------------


def test_an_increased_layer_has_not_what_fig_8_shows() -> None:
    quoted = 0.8
    for factor, agrees in ((0.01, True), (100.0, False)):
        changes = {"observers": {"svsf_thin_tuned": {"layer_factor": factor}}}
        figure = evaluate(Ledger.load(ROOT, "imm", changes, SEED), "fig8")
        leakage = lookup(figure.metrics)["svsf_thin_tuned", "leakage_after"]
        assert (abs(leakage - quoted) < 0.1) == agrees, leakage

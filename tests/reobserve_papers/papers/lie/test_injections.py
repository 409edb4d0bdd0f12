"""Injections with a cubic term over a square of coefficients, and their figures."""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest

from reobserve_papers.papers.lie import design as design_stage
from reobserve_papers.papers.lie import study as study_stage
from reobserve_papers.papers.lie.scoring import ratios, share_better
from reobserve_papers.papers.lie.styles import FORMS, OBSERVERS, pair, vector
from reobserve_papers.signals.series import Series
from tests.reobserve_papers.papers.lie.test_paper import evaluator, typed


@cache
def small_study() -> list[dict[str, Any]]:
    """Coefficients -1/3, 0 and 1/3, eight initial states, five seconds."""
    settings = deepcopy(evaluator().parameters.settings("study", "injections"))
    settings["study"].update(largest=1 / 3, coefficients=3, points=3, half_width=1.5)
    settings["plant"]["horizon"] = 5.0
    design = typed({"plant": settings["plant"], "design": settings["designs"]["linear"]})
    return study_stage.run(typed(settings), Series(np.zeros(1), {}), design_stage.compute(design))


def found(form: str, quantity: str, *cubic: float) -> float:
    (value,) = [
        row["value"]
        for row in small_study()
        if (row["form"], row["quantity"]) == (form, quantity)
        and (not cubic or np.allclose((row["x1"], row["x2"]), cubic))
    ]
    return float(value)


def test_exact_injection_has_the_error_of_the_transformed_form() -> None:
    """With (1/3, 1/3) y^3 the series end, and both forms are one."""
    ratio = found("cubic", "median_ise_ratio", 1 / 3, 1 / 3)
    assert ratio == pytest.approx(found("injection", "median_ise_ratio"), rel=1e-4)
    assert ratio > 1
    share = found("cubic", "share_better", 1 / 3, 1 / 3)
    assert share == found("injection", "share_better")


def test_negative_coefficient_has_smaller_error() -> None:
    for second in (-1 / 3, 0.0, 1 / 3):
        shares = [found("cubic", "share_better", first, second) for first in (-1 / 3, 1 / 3)]
        assert shares[0] >= 0.5 > shares[1]
    assert len([row for row in small_study() if row["form"] == "cubic"]) == 2 * 9
    assert found("constant", "median_ise_ratio") == 1
    assert found("constant", "share_better") == 0


def test_diverging_run_is_not_better_and_has_no_ratio() -> None:
    ise, reference = [1.0, np.nan, 4.0], [2.0, 2.0, 2.0]
    assert share_better(ise, reference) == pytest.approx(1 / 3)
    assert ratios(ise, reference).tolist() == [0.5, np.inf, 2.0]


def test_figure_labels_state_the_settings() -> None:
    terms = [(1, 1, -2), (2, 1, -4), (1, 3, 0.3333333333333333), (2, 3, -0.9)]
    injection = [{"component": c, "powers": [p], "coefficient": v} for c, p, v in terms]
    assert vector(injection) == "(−2 y + 1/3 y³, −4 y − 0.9 y³)"
    assert pair([2.0, 0.5]) == "(2, 0.5)"


def test_every_observer_has_its_own_line() -> None:
    assert set(OBSERVERS) == set(evaluator().parameters.tree["observers"])
    for kept in (OBSERVERS.values(), [style for style, _ in FORMS.values()]):
        styles = list(kept)
        assert len({style.color for style in styles}) == len(styles)
        assert len({str(style.linestyle) for style in styles}) == len(styles)

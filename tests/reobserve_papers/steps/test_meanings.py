"""Metrics without a meaning are refused by the step that computes them."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.steps.meanings import check_meanings


def test_metric_that_no_meaning_explains_is_refused() -> None:
    known = Metric("sampled", "rms_error", 0.1, "N m")
    check_meanings("reobserve_papers.papers.ilo", [known])
    with pytest.raises(InputError) as caught:
        check_meanings("reobserve_papers.papers.ilo", [known, Metric("sampled", "rmse", 0.1, "1")])
    said = "metric 'rmse': has no entry in MEANINGS of reobserve_papers.papers.ilo.metrics"
    assert str(caught.value) == said

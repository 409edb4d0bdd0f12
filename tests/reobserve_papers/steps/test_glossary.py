"""Metrics without a meaning are refused by the step that computes them."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.cli.main import main
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.papers.ilo import metrics as ilo
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.steps.glossary import check_explained
from tests import ROOT


def test_metric_that_no_meaning_explains_is_refused() -> None:
    known = Metric("sampled", "rms_error", 0.1, "N m")
    check_explained("reobserve_papers.papers.ilo", [known])
    with pytest.raises(InputError) as caught:
        check_explained("reobserve_papers.papers.ilo", [known, Metric("sampled", "rmse", 0.1, "1")])
    said = "metric 'rmse': has no entry in MEANINGS of reobserve_papers.papers.ilo.metrics"
    assert str(caught.value) == said


def test_metrics_of_named_papers_are_printed_with_their_meanings(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["metrics", "ilo"]) == 0
    printed = capsys.readouterr().out
    assert all(f"| `{name}` | {text[:9]}" in printed for name, text in ilo.MEANINGS.items())
    assert "Metrics of `eso`" not in printed
    assert main(["metrics"]) == 0
    assert capsys.readouterr().out.count("## Metrics of `") == len(known_papers(ROOT))
    assert main(["metrics", "ill"]) == 1
    assert "paper: there is no 'ill'; did you mean 'ilo'?" in capsys.readouterr().err

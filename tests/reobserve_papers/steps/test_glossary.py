"""Metrics without a meaning are refused by the step that computes them."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.claims.checks import THEORY
from reobserve_papers.cli.main import main
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.papers.ilo import metrics as ilo
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import paper_module
from reobserve_papers.steps.glossary import check_explained, check_subject, pattern
from tests import ROOT
from tests.published_numbers import golden_metrics


def test_metric_that_no_meaning_explains_is_refused() -> None:
    known = [Metric(name, "rms_error", 0.1, "N m") for name in ("sampled", "zero")]
    parameters = Parameters.load(ROOT, "ilo")
    check_explained(parameters, "fig1", known)
    module = "reobserve_papers.papers.ilo.metrics"
    for observer, metric, said in (
        ("sampled", "rmse", f"metric 'rmse': has no entry in MEANINGS of {module}"),
        ("adaptive", "rms_error", "observer: fig1 has no 'adaptive'; there are: sampled"),
    ):
        with pytest.raises(InputError) as caught:
            check_explained(parameters, "fig1", [*known, Metric(observer, metric, 0.1, "1")])
        assert str(caught.value).startswith(said)


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_numbers_are_of_observers_and_of_stated_subjects(paper: str) -> None:
    """Each stated subject has numbers in some figure, or in the theory."""
    parameters, used = Parameters.load(ROOT, paper), set()
    stated = {
        (layout, name)
        for layout, listed in paper_module(parameters.package, "metrics").SUBJECTS.items()
        for name in listed.split()
    }
    for figure in [*parameters.tree["figures"], THEORY]:
        layout = parameters.tree["figures"].get(figure, {}).get("layout", THEORY)
        for subject in {subject for subject, _ in golden_metrics(paper, figure)}:
            check_subject(parameters, figure, subject)
            used |= {
                one for one in stated if one[0] == layout and pattern(one[1]).fullmatch(subject)
            }
    assert used == stated


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

"""Choices in words: those of all papers, and what a paper excludes."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from reobserve.core.errors import InputError
from reobserve_papers.claims.labels import readings
from reobserve_papers.claims.plot_claims import short_labels
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

PAPERS = [path.stem for path in sorted((ROOT / "config/claims").glob("*.yaml"))]


@pytest.mark.parametrize("paper", PAPERS)
def test_labels_of_all_choices_are_words(paper: str) -> None:
    """No key, and the labels of a claim differ."""
    parameters = Parameters.load(ROOT, paper)
    for claim in read_registry(ROOT, parameters).claims:
        knobs = [knob for choice in claim.choices for knob in choice.knobs]
        words = {knob.name: list(readings(knob.words).values()) for knob in knobs}
        for name, label in ((knob.name, claim.labels[knob.name]) for knob in knobs):
            said = [str(label), label.unit, *label.notes.values(), *words.get(name, ())]
            assert label.words
            assert not any(mark in text for text in said[:1] for mark in ("_", "{", "*", "."))
            assert not any("_" in text or "{" in text for text in said)
        for knob in knobs:
            assert len(set(words[knob.name])) == len(knob.words)
            assert claim.labels[knob.name].of
        shown = short_labels(claim, claim.knob_names)
        assert len(set(shown)) == len(shown)


CASES = [
    ("ilo", "observers.sampled.observer_gain", "observer gain (observer sampled)", "N m s/rad"),
    ("ilo", "plant.control.1.phase", "phase of control 2 (plant)", "rad"),
    (
        "ilo",
        "scenarios.combined.fault.0.size",
        "size of fault 1 (scenario combined)",
        "N m",
    ),
    ("eso", "plant.initial_state.1", "initial state 2 (plant)", "A"),
    ("eso", "plant.controller_poles.0", "controller pole 1 (plant)", "1/s"),
    ("eso", "designs.{pd_pi,pi_optimal}.criterion", "criterion (designs pd pi, pi optimal)", ""),
    ("imm", "metrics.after.1", "end of the window after (metrics)", "s"),
]


@pytest.mark.parametrize(("paper", "name", "said", "unit"), CASES)
def test_label_names_the_place_and_the_unit(paper: str, name: str, said: str, unit: str) -> None:
    claims = read_registry(ROOT, Parameters.load(ROOT, paper)).claims
    label = next(claim.labels[name] for claim in claims if name in claim.labels)
    assert (str(label), label.unit) == (said, unit)


def test_signals_differ_in_what_distinguishes_them() -> None:
    values = [
        [{"kind": "square", "axis": 1, "high": 1.0}],
        [{"kind": "constant", "axis": 1, "size": 1.5}],
        [{"kind": "constant", "axis": 1, "size": 47.0}],
    ]
    assert list(readings(values).values()) == ["square", "constant size 1.5", "constant size 47"]


def with_excluded(project: Path, excluded: object) -> list[Claim]:
    path = project / "config/claims/ilo.yaml"
    path.parent.mkdir(parents=True)
    body = {
        "place": "Fig. 1", "statement": "It is.", "why": "So.", "threshold": "after",
        "checks": [{"value": "fig1 sampled relative_rms_error", "below": 0.05}],
        "depends_on": ["metrics.variant", "observers.sampled.K1"],
    }  # fmt: skip
    path.write_text(
        yaml.safe_dump({"limitations": "None.", "excluded": excluded, "claims": {"one": body}})
    )
    return read_registry(project, Parameters.load(ROOT, "ilo")).claims


def test_exclusion_and_named_value_are_notes(tmp_path: Path) -> None:
    (one,) = with_excluded(tmp_path, {"metrics.variant": {"continuous": "Theorem 1"}})
    assert (
        one.labels["metrics.variant"].readings["continuous"] == "continuous (excluded by Theorem 1)"
    )
    assert one.labels["observers.sampled.K1"].notes == {"1": "named by the paper"}
    (stated,) = {
        str(claim.labels["observers.{order2,order1}.initial_matrix"].notes)
        for claim in read_registry(ROOT, Parameters.load(ROOT, "delay")).claims
        if "observers.{order2,order1}.initial_matrix" in claim.labels
    }
    assert stated == "{'1': 'stated by the paper'}"


@pytest.mark.parametrize(
    ("excluded", "place", "said"),
    [
        ({"metrics.varient": {"continuous": "A"}}, "excluded", "there is no 'metrics.varient'"),
        ({"observers.sampled.K1": {"1": "A"}}, "excluded", "there is no 'observers.sampled.K1'"),
        ({"metrics.variant": {"continous": "A"}}, "excluded.metrics.variant", "'continous'"),
        (
            {"metrics.variant": {"continuous": 1}},
            "excluded.metrics.variant.continuous",
            "1 must be a word",
        ),
        ({"metrics.variant": "continuous"}, "excluded.metrics.variant", "must be"),
        (["metrics.variant"], "excluded", "must be"),
    ],
)
def test_unknown_exclusions_are_refused(
    tmp_path: Path, excluded: object, place: str, said: str
) -> None:
    with pytest.raises(InputError) as caught:
        with_excluded(tmp_path, excluded)
    assert caught.value.parameter == f"claims.ilo.{place}"
    assert said in caught.value.problem

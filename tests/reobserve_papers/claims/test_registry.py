"""The registry: reading it, and one sentence naming the entry for every error."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from reobserve.core.errors import InputError
from reobserve_papers.claims.errata import read_errata
from reobserve_papers.claims.registry import Claim, amiss, deciding, decisive, read_registry
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
PAPERS = [path.stem for path in sorted((ROOT / "config/claims").glob("*.yaml"))]
ERRATA = [path.stem for path in sorted((ROOT / "config/errata").glob("*.yaml"))]

GOOD = {
    "place": "Fig. 1",
    "statement": "It is\n  accurate.",
    "checks": [{"value": "fig1 sampled relative_rms_error", "below": 0.05}],
    "why": "A twentieth.",
    "threshold": "after",
    "depends_on": ["gains", "plant.control"],
}
OTHER = {"place": "Fig. 2", "statement": "Words.", "not_testable": "Words cannot be tested."}


def registry(tmp_path: Path, **claims: Any) -> list[Claim]:
    """The claims of an `ilo` registry with these entries."""
    (tmp_path / "config/claims").mkdir(parents=True, exist_ok=True)
    tree = {
        "limitations": "Nothing.",
        "choices": {"gains": ["observers.sampled.K2", "observers.*.update_interval"]},
        "claims": claims,
    }
    (tmp_path / "config/claims/ilo.yaml").write_text(yaml.safe_dump(tree))
    return read_registry(tmp_path, ILO).claims


def test_claim_is_read_with_its_groups_of_choices(tmp_path: Path) -> None:
    one, other = registry(tmp_path, one=GOOD, other=OTHER)
    assert (one.statement, one.why) == ("It is accurate.", "A twentieth.")
    assert one.threshold == "after"
    assert one.figures == ["fig1"]
    assert one.keys[0] == "observers.sampled.K2"
    assert one.keys[-1] == "plant.control"
    assert one.testable
    assert [(ref.observer, ref.metric) for ref in one.wanted] == [("sampled", "relative_rms_error")]
    assert not other.testable
    assert other.why == "Words cannot be tested."


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"checks": [{"value": "fig1_ sampled rms_error", "below": 1}]},
            "claims.ilo.one.checks.0.value.figure: there is no 'fig1_'; did you mean 'fig1'?",
        ),
        (
            {"depends_on": ["observers.sampled.K9"]},
            "claims.ilo.one.depends_on: there is no 'observers.sampled.K9'; "
            "did you mean 'observers.sampled.K2'?",
        ),
        (
            {"depends_on": ["plant.step"]},
            "claims.ilo.one.depends_on: plant.step is a numerical resolution, no choice",
        ),
        (
            {"checks": [{"value": "fig1 sampled rms_eror", "below": 1}]},
            "claims.ilo.one.checks.0.value.metric: there is no 'rms_eror'; did you mean "
            "'rms_error'?",
        ),
        ({"statment": "x"}, "claims.ilo.one.statment: unknown key; did you mean 'statement'?"),
        (
            {"not_testable": "No."},
            "claims.ilo.one: must have checks with a why, or not_testable",
        ),
        (
            {"checks": [{"value": "fig1 sampled rms_error", "beneath": 1}]},
            "claims.ilo.one.checks.0.beneath: unknown key; there are: "
            "value, over, minus, below, above, within, falling, rising, exists, share",
        ),
        (
            {"checks": [{"value": "fig1 sampled rms_error", "below": "low"}]},
            "claims.ilo.one.checks.0.below: 'low' is not a number, must be one that is finite",
        ),
        (
            {"checks": [{"value": "fig1 sampled rms_error"}]},
            "claims.ilo.one.checks.0: 0 relations given, must be one of "
            "below, above, within, exists, falling, rising",
        ),
        (
            {"printed": 2},
            "claims.ilo.one.printed: 2 must be one of true and false, not a word or a number",
        ),
        (
            {"null": {"smapled": "idle"}},
            "claims.ilo.one.null: there is no 'smapled'; did you mean 'sampled'?",
        ),
        (
            {"depends_on": ["gainns"]},
            "claims.ilo.one.depends_on: there is no 'gainns'; did you mean 'gains'?",
        ),
        (
            {"depends_on": ["sede"]},
            "claims.ilo.one.depends_on: there is no 'sede'; did you mean 'seed'?",
        ),
        (
            {"departs": {"shrae": "A reason."}},
            "claims.ilo.one.departs: there is no 'shrae'; did you mean 'share'?",
        ),
        ({"samples": 35}, "claims.ilo.one.samples: 35 must be 36 or more"),
        (
            {"quantifier": "sometimes"},
            "claims.ilo.one.quantifier: 'sometimes' must be one of can, shown, is, always",
        ),
        (
            {"quantifier": "can", "promised": ["abstract"]},
            "claims.ilo.one.null: is missing: a main claim of what can be needs a baseline, or the "
            "reason for none",
        ),
        ({"place": ""}, "claims.ilo.one.place: must not be empty"),
        (
            {"threshold": "later"},
            "claims.ilo.one.threshold: 'later' must be one of stated, before, after",
        ),
    ],
)
def test_invalid_claim_is_reported_in_one_sentence(
    tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as caught:
        registry(tmp_path, one={**GOOD, **change}, other=OTHER)
    assert str(caught.value) == said


def test_threshold_without_a_source_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^claims\.ilo\.one\.threshold: is missing: say who set"):
        registry(tmp_path, one={key: GOOD[key] for key in GOOD if key != "threshold"})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- a list\n", "must be a mapping of keys to values"),
        ("claims: {a: {}}\n", "claims.ilo.limitations: is missing; the claims file needs it"),
        (
            "limitations: x\nclaims: {a: {}}\nchoice: {}\n",
            "claims.ilo.choice: unknown key; did you mean 'choices'?",
        ),
    ],
)
def test_invalid_registry_is_reported_in_one_sentence(
    tmp_path: Path, text: str | None, said: str
) -> None:
    registry(tmp_path, other=OTHER)
    path = tmp_path / "config/claims/ilo.yaml"
    path.unlink()
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_registry(tmp_path, ILO)
    assert str(caught.value).removeprefix(f"{path}: ") == said


CONVENTIONS = {"conventions": {"less": {"value": 0.95, "alternatives": {"any": 1.0}}}}


def test_wording_does_not_affect_the_digest() -> None:
    tree = {"limitations": "a", "choices": {"gains": ["b"]}, "claims": {"one": GOOD}}
    other = {**tree, "limitations": "c", "claims": {"one": {**GOOD, "statement": "d", "why": "e"}}}
    assert decisive(tree, CONVENTIONS) == decisive(other, CONVENTIONS)
    assert deciding(tree, CONVENTIONS) == deciding(other, CONVENTIONS)


def test_bound_decides_how_many_samples_are_enough_and_not_what_they_are() -> None:
    tree = {"claims": {"one": GOOD}}
    stricter = [{**GOOD["checks"][0], "below": 0.04}]
    other = {"claims": {"one": {**GOOD, "checks": stricter}}}
    assert decisive(tree, CONVENTIONS) == decisive(other, CONVENTIONS)
    assert deciding(tree, CONVENTIONS) != deciding(other, CONVENTIONS)
    moved = {"conventions": {"less": {"value": 0.9, "alternatives": {"any": 1.0}}}}
    assert decisive(tree, CONVENTIONS) == decisive(tree, moved)
    assert deciding(tree, CONVENTIONS) != deciding(tree, moved)
    another = {"conventions": {"less": {"value": 0.95, "alternatives": {"any": 0.8}}}}
    assert deciding(tree, CONVENTIONS) == deciding(tree, another)


def test_measure_decides_what_samples_are() -> None:
    """Also one that only an alternative names, by a word."""
    tree = {"claims": {"one": GOOD}}
    other = [{**GOOD["checks"][0], "value": "fig1 sampled rms_error"}]
    changed = {"claims": {"one": {**GOOD, "checks": other}}}
    assert decisive(tree, CONVENTIONS) != decisive(changed, CONVENTIONS)
    lag = {"conventions": {"lag": {"value": "counted", "alternatives": {"removed": "removed"}}}}
    assert decisive(tree, CONVENTIONS) != decisive(tree, lag)


@pytest.mark.parametrize("paper", PAPERS)
def test_registries_of_the_papers_are_valid(paper: str) -> None:
    parameters = Parameters.load(ROOT, paper)
    claims = read_registry(ROOT, parameters).claims
    assert list(amiss(claims)) == []


def test_inconsistent_claims_are_named() -> None:
    one, two, three = (Claim("ilo", name, statement=name, promised=("abstract",)) for name in "abc")
    assert list(amiss([one, two, three])) == []
    (said,) = amiss([replace(one, testable=False), Claim("ilo", "d", statement="d")])
    assert said == "claims.ilo: none that can be tested is promised, must be one or more"
    assert list(amiss([])) == []
    (said,) = amiss([one, two, Claim("ilo", "d", statement="a")])
    assert said == "claims.ilo.d.statement: is that of a, must be another claim"


@pytest.mark.parametrize("paper", ERRATA)
def test_every_erratum_names_an_existing_test(paper: str) -> None:
    for erratum in read_errata(ROOT, paper):
        file, _, test = erratum.test.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert f"def {test}(" in text, erratum.name


@pytest.mark.parametrize("paper", ERRATA)
def test_no_claim_depends_on_a_choice_settled_by_an_erratum(paper: str) -> None:
    parameters = Parameters.load(ROOT, paper)
    known = {key for key, _ in parameters.entries()}
    drawn = {key for claim in read_registry(ROOT, parameters).claims for key in claim.keys}
    for erratum in read_errata(ROOT, paper):
        if erratum.settles:
            assert erratum.settles in known, erratum.name
            assert erratum.settles not in drawn, erratum.name


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"certainty": "sure"}, "certainty: 'sure' must be one of certain, likely, copy"),
        ({"plaec": "x"}, "plaec: unknown key; did you mean 'place'?"),
        ({"test": "tests/x.py"}, "test: 'tests/x.py': String should match pattern"),
        ({"corrected": "a"}, "corrected: is what is printed"),
    ],
)
def test_invalid_erratum_is_reported_in_one_sentence(
    tmp_path: Path, change: dict[str, str], said: str
) -> None:
    words = {"place": "(1)", "printed": "a", "corrected": "b", "why": "c", "certainty": "likely"}
    entry = {**words, "test": "tests/reobserve_papers/papers/test_it.py::test_it", **change}
    (tmp_path / "config/errata").mkdir(parents=True)
    path = tmp_path / "config/errata/toy.yaml"
    path.write_text(yaml.safe_dump({"errata": {"one": entry}}))
    with pytest.raises(InputError) as caught:
        read_errata(tmp_path, "toy")
    assert str(caught.value).startswith(f"errata.toy.one.{said}")


@pytest.mark.parametrize(
    "change", [{"depends_on": ["gains"]}, {"depends_on": ["gains", "plant.noise"]}]
)
def test_sampled_choices_affect_the_digest(change: dict[str, Any]) -> None:
    claims, changed = {"one": GOOD}, {"one": {**GOOD, **change}}
    assert decisive({"claims": claims}, {}) != decisive({"claims": changed}, {})
    groups = {"claims": claims, "choices": {"gains": ["a"]}}
    assert decisive(groups, {}) != decisive({**groups, "choices": {"gains": ["b"]}}, {})


def test_history_is_read_and_needs_all_of_its_keys(tmp_path: Path) -> None:
    path = tmp_path / "config/claims/ilo.yaml"
    registry(tmp_path, one=GOOD)
    tree = yaml.safe_load(path.read_text())
    entry = {"claim": "one", "verdict": "reproduced", "was": "below 0.1", "now": "below 0.05"}
    path.write_text(yaml.safe_dump({**tree, "history": [{**entry, "why": "So."}]}))
    (earlier,) = read_registry(tmp_path, ILO).history
    assert (earlier.claim, earlier.verdict, earlier.now) == ("one", "reproduced", "below 0.05")
    path.write_text(yaml.safe_dump({**tree, "history": [entry]}))
    with pytest.raises(InputError, match=r"^claims\.ilo\.history\.0\.why: is missing"):
        read_registry(tmp_path, ILO)


@pytest.mark.parametrize("paper", PAPERS)
def test_samples_of_numbers_do_not_have_to_meet_one_value(paper: str) -> None:
    """A check with one allowed value fails in all samples of a range, whatever the paper claims."""
    for claim in read_registry(ROOT, Parameters.load(ROOT, paper)).claims:
        knobs = [knob for choice in claim.choices for knob in choice.knobs]
        spans = [one for one in knobs if not one.levels and not one.name.endswith("seed")]
        exact = [one for one in claim.checks if one.relation == "within" and len({*one.bound}) == 1]
        assert not (spans and exact), claim.name


# Methods that are only cited: observers, and metrics that compare with one.
CITED = {
    "delay": r"\b(least_squares|adaptive|relay)\b",
    "ilo": r"\b(adaptive|matched|integral)\b|rival=|integrator",
}


@pytest.mark.parametrize("paper", PAPERS)
def test_claims_about_methods_that_are_only_cited_name_the_reconstruction(paper: str) -> None:
    for claim in read_registry(ROOT, Parameters.load(ROOT, paper)).claims:
        asked = " ".join(map(str, claim.wanted))
        concerned = paper in CITED and re.search(CITED[paper], asked)
        named = re.search("reconstructed (as|here)", claim.statement)
        assert bool(concerned) == bool(named), claim.name

"""Conventions and alternatives: how claims name them, and what is refused in one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from reobserve.core.errors import InputError
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.claims.conventions import SPECIAL, names_in, read_conventions
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

from .stub import GAIN, ILO, VARIANT, registry, write, write_registry

LESS = {"value": 1200, "alternatives": {"more": 1500}}
LAG = {"value": "counted", "alternatives": {"removed": "removed"}}
WITH_LAG = "fig1 sampled relative_rms_error lag=$lag"
PLAIN = "fig1 sampled relative_rms_error"
PAPERS = [path.stem for path in sorted((ROOT / "config/claims").glob("*.yaml"))]


def test_project_without_conventions_has_those_of_the_code(tmp_path: Path) -> None:
    found = read_conventions(tmp_path)
    assert found.values == SPECIAL
    assert not found.stated
    assert not found.single


def test_convention_stands_for_a_bound(tmp_path: Path) -> None:
    found = registry(
        tmp_path, {"it": {"checks": [{"value": PLAIN, "above": "$less"}]}}, {"less": LESS}
    )
    assert [check.bound for check in found.claims[0].checks] == [1200]
    assert found.naming("less") == ["it"]
    other = found.variant("it", found.conventions.with_value("less", 1500))
    assert [check.bound for check in other.checks] == [1500]


def test_convention_stands_in_a_reference_and_all_its_values_are_wanted(tmp_path: Path) -> None:
    (one,) = registry(
        tmp_path, {"it": {"checks": [{"value": WITH_LAG, "above": 1}]}}, {"lag": LAG}
    ).claims
    assert [ref.metric for ref in one.checks[0].references] == ["relative_rms_error lag=counted"]
    assert [ref.metric for ref in one.wanted] == [
        "relative_rms_error lag=counted",
        "relative_rms_error lag=removed",
    ]


def test_convention_stands_for_a_list_and_in_one(tmp_path: Path) -> None:
    both = {"value": [PLAIN, "fig2 sampled relative_rms_error"], "alternatives": {"one": [PLAIN]}}
    checks = [
        {"value": "$figures", "above": 1},
        {"value": [PLAIN, WITH_LAG], "within": ["$less", "$most"]},
    ]
    conventions = {
        "figures": both, "lag": LAG, "less": LESS,
        "most": {"value": 5000}, "any": {"value": "always", "alternatives": {"mostly": "is"}},
    }  # fmt: skip
    found = registry(tmp_path, {"it": {"checks": checks, "quantifier": "$any"}}, conventions)
    (one,) = found.claims
    assert [len(check.value) for check in one.checks] == [2, 2]
    assert one.checks[1].bound == [1200, 5000]
    assert one.checks[1].value[1].metric == "relative_rms_error lag=counted"
    assert one.quantifier == "always"
    fewer = found.variant("it", found.conventions.with_value("figures", [PLAIN]))
    assert len(fewer.checks[0].value) == 1
    assert found.variant("it", found.conventions.with_value("any", "is")).quantifier == "is"


def test_wording_names_no_convention(tmp_path: Path) -> None:
    """A dollar in a reason is one."""
    found = registry(tmp_path, {"it": {"why": "It costs $less.", "place": "$less"}}, {"less": LESS})
    assert found.claims[0].why == "It costs $less."
    assert found.naming("less") == []
    assert names_in({"why": "$a", "checks": [{"below": "$b"}], "quantifier": "$c"}) == {"b", "c"}


def test_alternative_changes_keys_of_a_claim(tmp_path: Path) -> None:
    checks = [{"value": PLAIN, "above": 1000}, {"value": PLAIN, "below": 9000}]
    found = registry(tmp_path, {"it": {"checks": checks}})
    changes = {"checks.0.above": 700, "quantifier": "always", "checks.1": None, "promised": []}
    one = found.variant("it", found.conventions, changes)
    assert [(check.relation, check.bound) for check in one.checks] == [("above", 700)]
    assert (one.quantifier, one.promised) == ("always", ())
    measured = found.variant("it", found.conventions, {"checks.0.below": 5, "checks.0.above": None})
    assert [check.relation for check in measured.checks] == ["below", "below"]


def test_special_conventions_of_the_file_replace_those_of_the_code(tmp_path: Path) -> None:
    found = registry(tmp_path, {"it": {}}, {"share": {"value": 0.8}})
    assert found.conventions.values == {**SPECIAL, "share": 0.8}


CLAIM = {"it": {"checks": [{"value": PLAIN, "above": "$less"}], "depends_on": [GAIN, VARIANT]}}


@pytest.mark.parametrize(
    ("conventions", "alternatives", "said"),
    [
        # Names and values of conventions.
        (
            {"les": LESS},
            {},
            "claims.ilo.it: there is no convention 'less'; did you mean 'les'?",
        ),
        (
            {"less": {"value": 1200, "alternatives": {"same": 1200}}},
            {},
            "conventions.less.alternatives: 1200 must be another than the value",
        ),
        (
            {"less": LESS, "share": {"value": 0.5}},
            {},
            "conventions.share.value: 0.5 must be between 0.5 and 1",
        ),
        (
            {"less": LESS, "share": {"value": 0.9, "alternatives": {"all": 1}}},
            {},
            "conventions.share.value: 1 must be between 0.5 and 1",
        ),
        (
            {"less": LESS, "majority": {"value": 1}},
            {},
            "conventions.majority.value: 1 must be 0 or more, and less than 1",
        ),
        (
            {"less": LESS, "samples": {"value": 35}},
            {},
            "conventions.samples.value: 35 must be a number of samples, 36 or more",
        ),
        (
            {"less": LESS, "purpose": {"value": "counted"}},
            {},
            "conventions.purpose.value: 'counted' must be one of ignored, counts",
        ),
        (
            {"less": LESS, "main": {"value": "abstract", "alternatives": {"x": "title"}}},
            {},
            "conventions.main.value: 'title' must be one of abstract and conclusions, abstract, "
            "conclusions, figures, all claims",
        ),
        (
            {"less": {**LESS, "alternative": {}}},
            {},
            "conventions.less.alternative: unknown key; did you mean 'alternatives'?",
        ),
        (
            {"less": {"value": 1200, "alternatives": {"word": "low"}}},
            {},
            "conventions.less.alternatives.word.ilo.it.checks.0.above: 'low' is not a number, must "
            "be one that is finite",
        ),
        # Keys of alternatives.
        (
            {"less": LESS},
            {"mine": {"claim": {}}},
            "alternatives.mine.claim: unknown key; did you mean 'claims'?",
        ),
        (
            {"less": LESS},
            {"mine": {"paper": "ill"}},
            "alternatives.mine.paper: there is no 'ill'; did you mean 'ilo'?",
        ),
        (
            {"less": LESS},
            {"mine": {"claims": {"ti": {}}}},
            "alternatives.mine.claims: there is no 'ti'; did you mean 'it'?",
        ),
        (
            {"less": LESS},
            {"mine": {"claims": {"it": {"quantfier": "always"}}}},
            "alternatives.mine.ilo.it.quantfier: unknown key; did you mean 'quantifier'?",
        ),
        (
            {"less": LESS},
            {"mine": {"claims": {"it": {"checks.1.above": 3}}}},
            "alternatives.mine.checks.1.above: there is no item 1, must be 0 to 0",
        ),
        (
            {"less": LESS},
            {"mine": {"claims": {"it": {"check.0.above": 3}}}},
            "alternatives.mine.check.0.above: there is no 'check'; did you mean 'checks'?",
        ),
        (
            {"less": LESS},
            {"mine": {"claims": {"it": {"checks.0.value": "fig1 sampled rms_eror"}}}},
            "alternatives.mine.checks.0.value.metric: there is no 'rms_eror'; did you mean "
            "'rms_error'?",
        ),
        (
            {"less": LESS},
            {"mine": {"claims": {"it": {"depends_on": [GAIN]}}}},
            "alternatives.mine.depends_on: must stay: samples vary what the claim states",
        ),
        # Ranges and weights.
        (
            {"less": LESS},
            {"mine": {"ranges": {"observers.continuous.K3": [1, 2]}}},
            "alternatives.mine.ranges: no claim depends on 'observers.continuous.K3'; did you mean "
            "'observers.continuous.K2'?",
        ),
        (
            {"less": LESS},
            {"mine": {"weights": {"metrics.variants": {"sampled": 0.5}}}},
            "alternatives.mine.weights: no claim depends on 'metrics.variants'; did you mean "
            "'metrics.variant'?",
        ),
        (
            {"less": LESS},
            {"mine": {"ranges": {VARIANT: ["sampeld"]}}},
            "alternatives.mine.ranges.metrics.variant: there is no 'sampeld'; did you mean "
            "'sampled'?",
        ),
        (
            {"less": LESS},
            {"mine": {"weights": {VARIANT: {"sampeld": 0.5}}}},
            "alternatives.mine.weights.metrics.variant: there is no 'sampeld'; did you mean "
            "'sampled'?",
        ),
        (
            {"less": LESS},
            {"mine": {"weights": {VARIANT: {"sampled": 1.5}}}},
            "alternatives.mine.weights.metrics.variant.sampled: 1.5 must be 1 or less",
        ),
        (
            {"less": LESS},
            {"mine": {"weights": {GAIN: {"500": 0.5}}}},
            f"alternatives.mine.weights.{GAIN}: is a choice of numbers, which have ranges and no "
            "weights",
        ),
        *(
            (
                {"less": LESS},
                {"mine": {"ranges": {GAIN: ends}}},
                f"alternatives.mine.ranges.{GAIN}: {ends} must be two numbers, the lower one first",
            )
            for ends in ([1000], [2000, 1000], ["low", "high"])
        ),
        (
            {"less": LESS},
            {"mine": {"ranges": {GAIN: [600, 700]}, "only": ["ti"]}},
            "alternatives.mine.only: there is no 'ti'; did you mean 'it'?",
        ),
    ],
)  # fmt: skip
def test_wrong_convention_is_refused_in_one_sentence(
    tmp_path: Path, conventions: dict[str, Any], alternatives: dict[str, Any], said: str
) -> None:
    """By `reobserve-papers check` and by every build."""
    project = project_of_ilo(tmp_path)
    write_registry(project, CLAIM, conventions, alternatives)
    with pytest.raises(InputError) as caught:
        check_evidence(project, ILO)
    assert str(caught.value) == said


def project_of_ilo(tmp_path: Path) -> Path:
    (tmp_path / "config/papers").mkdir(parents=True)
    (tmp_path / "config/papers/ilo.yaml").write_text("")
    return tmp_path


def test_right_conventions_are_sound(tmp_path: Path) -> None:
    project = project_of_ilo(tmp_path)
    alternatives = {
        "mine": {"claims": {"it": {"checks.0.above": 700}}},
        "narrow": {"ranges": {GAIN: [600, 700], VARIANT: ["sampled"]}, "only": ["it"]},
        "any": {"ranges": {"observers.*.K2": [600, 700]}},
        "seldom": {"weights": {VARIANT: {"continuous": 0.5}}},
    }
    registry(project, CLAIM, {"less": LESS}, alternatives)
    check_evidence(project, ILO)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"note": None}, r"^note: "),
        ({"conventions": None}, r"^conventions: "),
        ({"convention": {}}, r"^convention: unknown key; did you mean 'conventions'\?$"),
    ],
)
def test_wrong_file_of_conventions_is_refused_in_one_sentence(
    tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    project = project_of_ilo(tmp_path)
    write(project / "config/conventions.yaml", {"note": "x", "conventions": {}, **change})
    with pytest.raises(InputError, match=said):
        check_evidence(project, ILO)


# Of the project.


def stated(paper: str) -> dict[str, Any]:
    """The claims of a paper as its file has them."""
    tree = yaml.safe_load((ROOT / f"config/claims/{paper}.yaml").read_text(encoding="utf-8"))
    claims: dict[str, Any] = tree["claims"]
    return claims


def test_every_convention_is_named_by_a_claim_or_known_to_the_code() -> None:
    named = {name for paper in PAPERS for name in names_in(stated(paper))}
    named |= {
        name for one in read_conventions(ROOT).single.values() for name in names_in(one.claims)
    }
    assert set(read_conventions(ROOT).stated) == named | set(SPECIAL)


def test_conventions_and_alternatives_of_the_project_are_sound() -> None:
    known = known_papers(ROOT)
    for paper in PAPERS:
        check_evidence(ROOT, Parameters.load(ROOT, paper))
    assert all(one.paper in known for one in read_conventions(ROOT).single.values())


# Each claim that departs from a convention, by paper, claim and convention.
DEPARTURES = {
    ("delay", "radius_on_ramp", "same"),
    ("delay", "higher_derivatives_hard", "less"),
    ("delay", "fig3_relay_oscillates", "less"),
    ("eso", "any_form", "any"),
    ("eso", "same_level", "same"),
    ("ilo", "fewer_updates_less_noise", "less"),
    ("ilo", "faster_needs_shorter", "less"),
    ("imm", "thin_layer_chatters", "less"),
    ("imm", "svsf_robust", "less"),
}


def test_departures_from_conventions_are_these() -> None:
    found = {
        (paper, name, convention)
        for paper in PAPERS
        for name, body in stated(paper).items()
        for convention in body.get("departs", {})
    }
    assert found == DEPARTURES


def test_departures_are_from_conventions_that_there_are() -> None:
    assert {convention for _, _, convention in DEPARTURES} <= set(read_conventions(ROOT).stated)

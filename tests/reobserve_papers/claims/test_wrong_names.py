"""A name in a configuration file with a letter changed: `check` names the near one."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.claims.errata import read_errata
from reobserve_papers.claims.registry import claims_text, has_claims, read_claims
from reobserve_papers.parameters.job import read_parameters
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

PAPER = "two_mass"
# By file: text before a name, and the name.
NAMED = {
    "papers": [
        ("layout: errors, scenario: ", "coarse"),
        ("observers: [", "placed"),
        ("observers: [placed, ", "kalman"),
    ],
    "claims": [
        ("value: ", "fig1"),
        ("value: fig1 ", "kalman"),
        ("value: fig1 kalman ", "rms_error"),
        ("over: fig1 ", "placed"),
        ("over: fig1 placed ", "rms_error"),
        ("below: $", "majority"),
        ("depends_on: [", "tuning"),
        ("depends_on: [tuning, ", "observers.placed.pole"),
        ("tuning: [", "observers.placed.pole"),
        ("tuning: [observers.placed.pole, ", "plant.gusts"),
        ("errata: [", "sign_of_damping"),
        ("departs: {", "samples"),
        ('"null": {', "kalman"),
        ('"null": {kalman: ', "placed"),
        ("ours: [", "fig1"),
    ],
    "errata": [("settles: ", "plant.damping")],
}  # fmt: skip
SITES = [(kind, *pair) for kind, pairs in NAMED.items() for pair in pairs]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The worked example, with a name in each place that can have one."""
    for folder in ("config", "src"):
        shutil.copytree(ROOT / "examples/two_mass" / folder, tmp_path / folder)
    claims = tmp_path / f"config/claims/{PAPER}.yaml"
    text = claims.read_text().replace("below: 1", "below: $majority")
    text = text.replace("depends_on: [tuning]", "depends_on: [tuning, observers.placed.pole]")
    text += "    errata: [sign_of_damping]\n    departs: {samples: Few.}\n"
    text += '    "null": {kalman: placed}\n'
    text += "figures:\n  Fig. 1: {shows: Errors., ours: [fig1], differs: Nothing.}\n"
    claims.write_text(text)
    with (tmp_path / f"config/errata/{PAPER}.yaml").open("a") as errata:
        errata.write("    settles: plant.damping\n")
    return tmp_path


def check(project: Path) -> None:
    parameters = Parameters.load(project, PAPER)
    read_parameters(parameters)
    check_evidence(project, parameters)


@pytest.mark.parametrize("site", SITES, ids=lambda site: f"{site[0]} {site[1]}{site[2]}")
@settings(max_examples=2, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_name_with_a_letter_changed_is_refused_with_the_near_one(
    project: Path, site: tuple[str, str, str], data: st.DataObject
) -> None:
    kind, before, name = site
    path = project / f"config/{kind}/{PAPER}.yaml"
    right = path.read_text()
    assert right.count(before + name) >= 1
    at = data.draw(st.integers(0, len(name) - 1).filter(lambda k: name[k].isalpha()))
    wrong = f"{name[:at]}{'q' if name[at] != 'q' else 'z'}{name[at + 1 :]}"
    check(project)
    path.write_text(right.replace(before + name, before + wrong, 1))
    with pytest.raises(InputError) as caught:
        check(project)
    path.write_text(right)
    assert f"did you mean '{name}'?" in str(caught.value)
    assert wrong in str(caught.value)


NONE = [None, "", "# none\n", "{}", "[]", "KIND: {}", "KIND: []", "KIND:"]


@pytest.mark.parametrize("claims", NONE)
def test_no_claims_and_no_errata_are_no_error(project: Path, claims: str | None) -> None:
    """All combinations; with claims, one that links no erratum."""
    stated = (ROOT / f"examples/two_mass/config/claims/{PAPER}.yaml").read_text()
    for text in (claims, stated):
        for errata in NONE:
            for kind, one in (("claims", text), ("errata", errata)):
                path = project / f"config/{kind}/{PAPER}.yaml"
                path.unlink(missing_ok=True)
                if one is not None:
                    path.write_text(one.replace("KIND", kind))
            check(project)
            claims_text.cache_clear()
            assert has_claims(project, PAPER) == (text == stated)
            assert read_errata(project, PAPER) == ()
            assert len(read_claims(project, PAPER).claims) == (text == stated)

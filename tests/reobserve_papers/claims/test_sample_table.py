"""Cached samples: used where nothing has changed, and recomputed otherwise."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.errors import InputError, ReobserveError
from reobserve_papers.claims import choices
from reobserve_papers.claims import sample_command as commands
from reobserve_papers.claims import sample_table as tables
from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.choices import Choice, Knob, find_choice
from reobserve_papers.claims.inquiry import Robustness, read_robustness
from reobserve_papers.claims.outcomes import Sample, basis_of
from reobserve_papers.claims.registry import Claim, Registry, read_registry
from reobserve_papers.claims.sample_command import sample_again, sample_command
from reobserve_papers.claims.sample_table import (
    Samples,
    SampleTable,
    alike,
    as_text,
    keep,
    read_cached,
    read_samples,
    write_samples,
)
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters, default_parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import FIVE, ROOT

from .stub import GAIN, ILO, SHARE, VARIANT, Code, assess, claim, registry, with_checks

NEAR = claim("fig1 a gain", GAIN, above=620)  # so that no number of samples decides
KEYS = tuple(ILO.by_key)
GAINS, SHARES = Reference("fig1", "a", "gain"), Reference("fig1", "a", "share")


def found(
    one: Claim,
    past: Samples | None = None,
    samples: int = 40,
    parameters: Parameters = ILO,
    keys: tuple[str, ...] = KEYS,
) -> Robustness:
    cached = SampleTable(keys, {} if past is None else {one.name: past})
    return assess(Evaluator(parameters), [one], lambda _: samples, 0.9, cached)[one.name]


@pytest.fixture
def first(code: Code) -> Robustness:
    """Computed without a cache."""
    code.refused, code.lost = (600, 700), (900, 1000)
    one = found(NEAR, samples=60)
    assert one.samples == 60
    assert {"refused", "diverged"} <= {*one.outcomes(NEAR)}
    code.asked.clear()
    return one


@pytest.fixture
def past(first: Robustness) -> Samples:
    """As it is cached."""
    return first.to_keep(NEAR)


@pytest.mark.parametrize("asked", [20, 60, 80])
def test_cached_samples_are_all_used_and_missing_ones_added(
    code: Code, first: Robustness, past: Samples, asked: int
) -> None:
    again = found(NEAR, past, samples=asked)
    assert again.cached == 59
    assert len(code.asked) == 1 + 1 + max(asked - 60, 0)  # nominal, one sample, and the missing
    assert replace(again, cached=0) == found(NEAR, samples=max(asked, 60))
    assert again.trials[:60] == first.trials


def test_change_of_the_code_invalidates_cached_samples(code: Code, past: Samples) -> None:
    code.factor = 1.001
    moved = found(NEAR, past, samples=60)
    assert moved.cached == 0
    assert moved == found(NEAR, samples=60)
    code.factor = 1 + 1e-9  # rounding on another machine
    assert found(NEAR, past, samples=60).cached > 50


# What a sample is made of, and what is asked of it.


def named(project: Path, **changes: Any) -> Claim:
    """The claim of a registry whose entry has these changes, and no alternatives."""
    return registry(project, {"it": changes}).claims[0]


CHECK = {"value": "fig1 sampled relative_rms_error", "above": 620}


@pytest.mark.parametrize(
    "changes",
    [
        {"checks": [{**CHECK, "above": 700}]},
        {"checks": [{"value": CHECK["value"], "within": [600, 5000]}]},
        {"statement": "Another.", "why": "Another.", "threshold": "before", "place": "Fig. 2"},
        {"promised": []},
        {"quantifier": "always"},
        {"printed": True, "setting": "at the gain of 2000", "samples": 500},
    ],
)
def test_another_bound_wording_or_quantifier_drops_no_cached_samples(
    code: Code, tmp_path: Path, changes: dict[str, Any]
) -> None:
    stated = named(tmp_path, checks=[CHECK])
    past = found(stated, samples=60).to_keep(stated)
    code.asked.clear()
    again = found(named(tmp_path, **{"checks": [CHECK], **changes}), past, 60)
    assert again.cached == again.samples - 1
    assert len(code.asked) == 2


def test_alternative_bound_drops_no_cached_samples(code: Code, tmp_path: Path) -> None:
    stated = named(tmp_path, checks=[CHECK])
    past = found(stated, samples=60).to_keep(stated)
    moved = registry(
        tmp_path,
        {"it": {"checks": [{**CHECK, "above": "$line"}]}},
        {"line": {"value": 620, "alternatives": {"higher": 700}}},
        {"mine": {"claims": {"it": {"checks.0.above": 800, "quantifier": "always"}}}},
    ).claims[0]
    assert moved.wanted == stated.wanted
    assert found(moved, past, 60).cached == 59


def with_key(parameters: Parameters, section: str, name: str) -> Parameters:
    """The parameters with an entry that they have not."""
    tree = copy.deepcopy(parameters.tree)
    place = tree
    for part in section.split("."):
        place = place[part]
    place[name] = {"value": 1.0, "unit": "1", "source": "assumed", "why": "So.", "range": [0, 2]}
    return replace(parameters, tree=tree)


@pytest.mark.parametrize("section", ["plant", "observers.continuous", "metrics"])
def test_new_key_of_a_section_drops_no_cached_samples(
    code: Code, past: Samples, section: str
) -> None:
    more = with_key(ILO, section, "brand_new")
    assert basis_of(Evaluator(more), NEAR) != past.basis
    assert found(NEAR, past, 60, more).cached == 59
    assert found(NEAR, past, 60, more, keys=tuple(more.by_key)).cached == 0


def test_renamed_class_drops_no_cached_samples(code: Code, past: Samples) -> None:
    """Digests are of plain values, and name no class."""
    choice = NEAR.choices[0]
    knob = type("RenamedKnob", (Knob,), {})(**vars(choice.knobs[0]))
    renamed = type("RenamedChoice", (Choice,), {})(choice.keys, (knob,))
    assert repr(renamed) != repr(choice)
    assert found(replace(NEAR, choices=(renamed,)), past, 60).cached == 59


def test_measure_that_only_an_alternative_names_drops_none_in_a_build(
    code: Code, past: Samples, first: Robustness
) -> None:
    """Its numbers are missing from the samples until the command makes them again."""
    more = replace(NEAR, wanted=(*NEAR.wanted, SHARES))
    again = found(more, past, 60)
    assert again.cached == 59
    assert again.outcomes(more) == first.outcomes(NEAR)
    assert again.to_keep(more).metrics == past.metrics
    other = with_checks(NEAR, Check.parse({"value": "fig1 a share", "above": 0}))
    with pytest.raises(InputError, match="fig1 has no 'share' of a"):
        again.outcomes(other)


@pytest.mark.parametrize(
    "check", [{"value": "fig1 a share", "above": 0}, {"value": "fig1 idle gain", "above": 0}]
)
def test_new_measure_of_a_check_makes_samples_again(
    code: Code, past: Samples, check: dict[str, Any]
) -> None:
    other = with_checks(NEAR, Check.parse(check))
    assert found(other, past, 60).cached == 0


def test_new_null_makes_samples_again(code: Code, past: Samples) -> None:
    null = with_checks(replace(NEAR, null={"a": "idle"}), *NEAR.checks)
    again = found(null, past, 60)
    assert again.cached == 0
    assert "holds" in again.outcomes(null.with_null)


def other_range(parameters: Parameters) -> Parameters:
    """The parameters with another range of the gain."""
    tree = copy.deepcopy(parameters.tree)
    tree["observers"]["continuous"]["K2"]["range"] = [500, 6000]
    return replace(parameters, tree=tree)


@pytest.mark.parametrize("what", ["seed", "value", "range", "choice"])
def test_other_parameters_or_choices_make_samples_again(
    code: Code, past: Samples, what: str
) -> None:
    parameters, one = ILO, NEAR
    if what == "seed":
        parameters = replace(ILO, seed=2)
    if what == "value":
        parameters = Parameters.load(ROOT, "ilo", {"observers": {"sampled": {"K2": 4000}}}, seed=1)
    if what == "range":
        parameters = other_range(ILO)
        one = replace(NEAR, choices=(find_choice(parameters, GAIN),))
    if what == "choice":
        one = claim("fig1 a gain", GAIN, SHARE, above=620)
    assert found(one, past, 60, parameters).cached == 0


def project_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, claims: Mapping[str, Claim]
) -> Path:
    """A project of `ilo` without cached samples, whose claims are these."""
    project = tmp_path / "project"
    if not project.exists():
        shutil.copytree(ROOT / "config", project / "config")
        shutil.copytree(ROOT / "workflow", project / "workflow")
        (project / samples_path("ilo")).unlink(missing_ok=True)
    listed = [replace(one, name=name) for name, one in claims.items()]
    for module in (commands, tables):
        monkeypatch.setattr(module, "read_registry", lambda *_: Registry(claims=listed))
    return project


def kept(project: Path) -> SampleTable:
    return read_cached(project, "ilo")


numbers = st.dictionaries(st.sampled_from([GAINS, SHARES]), st.floats(width=32)) | st.none()


@given(st.lists(numbers), st.booleans(), st.data())
def test_table_is_read_as_it_was_written(
    found: list[Sample | None], seal: bool, data: st.DataObject
) -> None:
    texts = tuple(as_text([GAINS, SHARES], one) for one in found)
    cached = data.draw(st.integers(0, len(texts)))
    one = Samples("0a", (str(GAINS), str(SHARES)), texts, cached)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "ilo.json"
        write_samples(path, ILO, {"it": one, "none": replace(one, samples=(), cached=0)}, seal=seal)
        table = read_samples(path, "ilo")
        assert ("sha256" in path.read_text()) == seal
    assert table.keys == KEYS
    assert table.claims == {"it": one, "none": replace(one, samples=(), cached=0)}
    for number, numbers in enumerate(found):
        assert alike(table.claims["it"].at(number), numbers, [GAINS, SHARES])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"samples": ["1", "12 a"]}, r"claims.it.samples.1: '12 a' must be 1 numbers$"),
        ({"samples": ["1", "1 2"]}, r"claims.it.samples.1: '1 2' must be 1 numbers$"),
        ({"samples": [None, ""]}, r"claims.it.samples.1: '' must be 1 numbers$"),
        ({"samples": [1]}, r"claims.it.samples.0"),
        ({"metrics": ["fig1 a"]}, r"claims.it.reference: 'fig1 a' must be FIGURE OBSERVER METRIC"),
        ({"cached": 61}, r"claims.it.cached: 61 must be a number of samples, up to 60$"),
        ({"cached": -1}, r"claims.it.cached: -1 must be a number of samples, up to 60$"),
        ({"basis": None}, r"claims.it.basis"),
        ({"values": []}, r"claims.it.values"),
    ],
)
def test_damaged_table_is_refused(
    past: Samples, tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    path = tmp_path / "ilo.json"
    write_samples(path, ILO, {"it": past}, seal=False)
    with pytest.raises(InputError, match="is of ilo, must be of lie"):
        read_samples(path, "lie")
    stored = json.loads(path.read_text())
    stored["claims"]["it"].update(change)
    path.write_text(json.dumps(stored))
    with pytest.raises(InputError, match=said) as caught:
        read_samples(path, "ilo")
    assert str(path) in str(caught.value)


def test_more_samples_than_settings_are_refused(code: Code, tmp_path: Path) -> None:
    words = claim("fig1 a variant", VARIANT, below=1.5)
    path, all_three = tmp_path / "ilo.json", found(words).to_keep(words)
    write_samples(path, ILO, {"it": replace(all_three, samples=(*all_three.samples, "0"))})
    said = r"^samples\.ilo\.it: there are 4, must be at most 3, which are all settings$"
    with pytest.raises(InputError, match=said):
        read_robustness(path, ILO, [words])
    with pytest.raises(InputError, match=said):
        assess(Evaluator(ILO), [words], lambda _: 40, 0.9, read_samples(path, "ilo"))


def test_new_key_keeps_samples_of_claims_that_are_not_sampled_then(
    code: Code, past: Samples, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their digest is renewed with the list of keys, unless they were stale before."""
    project = project_with(tmp_path, monkeypatch, {"it": NEAR, "new": NEAR, "stale": NEAR})
    keep(project, ILO, {"it": past, "stale": replace(past, basis="0a")})
    more = with_key(ILO, "plant", "brand_new")
    keep(project, more, {"new": found(NEAR, parameters=more).to_keep(NEAR)})
    assert kept(project).keys == tuple(more.by_key)
    bases = {name: one.basis for name, one in kept(project).claims.items()}
    here = basis_of(Evaluator(more), NEAR)
    assert bases == {"it": here, "new": here, "stale": "0a"}


def test_samples_agree_up_to_rounding() -> None:
    a, b = GAINS, SHARES
    nan, inf = float("nan"), float("inf")
    assert alike({a: nan, b: inf}, {a: nan, b: inf}, {a, b})
    assert alike({a: 1.0}, {a: 1.0 + 1e-9}, {a})
    assert not alike({a: 1.0}, {a: 1.0 + 1e-5}, {a})
    assert not alike({}, None, {a})
    assert not alike({}, {a: 1.0}, {a})
    assert alike(None, None, set())
    assert alike({}, {}, {a})
    assert not alike({a: 1.0}, {b: 1.0}, set())  # nothing is compared
    assert not alike({a: 1.0}, {a: 1.0, b: 2.0}, {a, b})  # a figure diverged


@pytest.mark.parametrize("paper", FIVE)
def test_every_claim_has_current_cached_samples(paper: str) -> None:
    """If this fails, `make samples` adds the missing ones."""
    parameters = default_parameters(ROOT, paper)
    claims = [one for one in read_registry(ROOT, parameters).claims if one.checks and one.choices]
    cached, here = read_cached(ROOT, paper), Evaluator(parameters)
    assert {name: one.basis for name, one in cached.claims.items()} == {
        claim.name: basis_of(here, claim, cached.keys) for claim in claims
    }
    for one in claims:
        assert set(one.wanted) <= set(cached.claims[one.name].references), (
            f"{one.name}: numbers of alternatives"
        )


@pytest.mark.parametrize("paper", FIVE)
def test_cached_samples_are_stored_as_they_are_written(paper: str, tmp_path: Path) -> None:
    """A line for each claim, so that caching one of them changes no other line."""
    stored, path = ROOT / samples_path(paper), tmp_path / "cached.json"
    table = read_cached(ROOT, paper)
    write_samples(path, default_parameters(ROOT, paper), table.claims, seal=False)
    rows = [text.read_text().partition(' "claims": {\n')[2] for text in (stored, path)]
    assert rows[0] == rows[1]
    assert len(rows[0].splitlines()) == len(table.claims) + 2


# The command.


def run(project: Path, most: int | None, *claims: str, check: bool = False) -> None:
    sample_command(project, ["ilo"], claims, most, check)


def test_samples_command_resumes_and_checks(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    never = claim("fig1 a gain", GAIN, above=5000)
    project = project_with(tmp_path, monkeypatch, {"it": NEAR, "never": never})
    run(project, 100)
    reported = capsys.readouterr().out.splitlines()
    assert [line.split(", ")[1] for line in reported] == ["1 of 2 claims undecided"] * 3
    assert [len(one.samples) for one in kept(project).claims.values()] == [100, 36]
    run(project, 60)
    said = "ilo: 136 samples, 1 of 2 claims undecided, 0 have fewer than 400 samples\n"
    assert capsys.readouterr().out == said
    run(project, 100, check=True)
    project_with(tmp_path, monkeypatch, {"it": NEAR, "never": never, "new": never})
    with pytest.raises(ReobserveError, match="1 claims have samples that differ"):
        run(project, 30, check=True)
    said = "claims.ilo.new: there are no cached samples of the claim as it is"
    head = "1 claims have samples that differ:"
    assert capsys.readouterr().out.splitlines() == [head, said]
    project_with(tmp_path, monkeypatch, {"it": NEAR, "never": never})
    code.factor = 1.01
    with pytest.raises(ReobserveError, match="2 claims have samples that differ"):
        run(project, 30, check=True)
    assert "the first is 0: " in capsys.readouterr().out


def test_samples_command_makes_samples_with_a_new_measure_again(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the claim whose alternative names it, and of no other."""
    claims = {"it": NEAR, "other": claim("fig1 a gain", GAIN, above=640)}
    project = project_with(tmp_path, monkeypatch, claims)
    run(project, 60)
    before = kept(project).claims
    more = replace(NEAR, wanted=(*NEAR.wanted, SHARES))
    project_with(tmp_path, monkeypatch, {**claims, "it": more})
    code.asked.clear()
    run(project, 60)
    after = kept(project).claims
    assert after["other"] == before["other"]
    assert after["it"].metrics == ("fig1 a gain", "fig1 a share")
    stripped = tuple(text and text.split()[0] for text in after["it"].samples)
    assert stripped == before["it"].samples
    assert len(code.asked) < 80


def test_samples_command_samples_named_claims_only(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    claims = {"it": NEAR, "cheap": replace(NEAR, maximum=90), "word": NEAR}
    project = project_with(tmp_path, monkeypatch, claims)
    run(project, None, "cheap")
    assert {name: len(one.samples) for name, one in kept(project).claims.items()} == {"cheap": 90}
    with pytest.raises(InputError, match=r"^--claim: there is no 'wrod'; did you mean 'word'\?$"):
        run(project, None, "wrod")


NEVER, HALF = (claim("fig1 a gain", GAIN, above=bound) for bound in (5000, 1600))
FOUR = {
    "main": replace(NEVER, promised=("abstract",)), "near": NEAR, "never": NEVER, "half": HALF,
    "words": replace(claim("fig1 a variant", VARIANT, below=1.5), promised=("abstract",)),
}  # fmt: skip


def lengths(project: Path) -> dict[str, int]:
    return {name: len(table.samples) for name, table in kept(project).claims.items()}


@pytest.mark.parametrize("most", [30, 60, None, 500])
def test_main_claims_and_those_that_depend_have_enough_samples(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], most: int | None,
) -> None:  # fmt: skip
    """As many as the convention says, here 400, or all; others end when they are decided."""
    project = project_with(tmp_path, monkeypatch, FOUR)
    run(project, most)
    enough = min(most or 400, 400)
    near = most or 400
    assert lengths(project) == {
        "main": enough, "near": near, "never": min(enough, 36), "half": enough, "words": 3,
    }  # fmt: skip
    undecided, few = 1 if enough >= 36 else 3, 2 if enough < 400 else 0
    said = f" {undecided} of 5 claims undecided, {few} have fewer than 400 samples"
    assert capsys.readouterr().out.splitlines()[-1].endswith(said)


def test_claim_may_state_another_maximum_than_is_enough(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is reached where the claim is undecided, and less where it is smaller."""
    claims = {
        "near": replace(NEAR, maximum=600),
        "half": replace(HALF, maximum=600),
        "few": replace(HALF, maximum=90),
    }
    project = project_with(tmp_path, monkeypatch, claims)
    run(project, None)
    assert lengths(project) == {"near": 600, "half": 400, "few": 90}
    assert "1 of 3 claims undecided, 1 have fewer" in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.parametrize("seconds", [60.0, 1e-9])
def test_claims_are_sampled_again_when_their_samples_do_not_apply(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], seconds: float,
) -> None:  # fmt: skip
    """All, or only what a build left undecided, by the rule of the command, but for the time."""
    project = project_with(tmp_path, monkeypatch, FOUR)
    run(project, 60)
    before = lengths(project)
    parameters = default_parameters(project, "ilo")
    assert not sample_again(project, parameters, (), seconds)
    assert sample_again(project, parameters, {"near"}, seconds)
    assert lengths(project) == before | {"near": 400 if seconds > 1 else 60}
    more = find_choice(ILO, SHARE)
    changed = {name: replace(one, choices=(*one.choices, more)) for name, one in FOUR.items()}
    project_with(tmp_path, monkeypatch, changed)
    assert sample_again(project, parameters, (), seconds)
    wanted = dict.fromkeys(FOUR, 1)
    if seconds > 1:
        wanted = {"main": 400, "near": 400, "never": 36, "half": 400, "words": 400}
    assert lengths(project) == wanted
    assert "claims undecided" in capsys.readouterr().out


def test_samples_with_words_in_other_blocks_do_not_apply(
    code: Code, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that have no words, or all combinations of them, do."""
    claims = [claim("fig1 a gain", *keys, above=620) for keys in
              ([GAIN], [VARIANT], [VARIANT, GAIN], [VARIANT, "seed"])]  # fmt: skip
    pasts = [found(one).to_keep(one) for one in claims]
    monkeypatch.setattr(choices, "_BLOCK", 6)
    again = [found(one, past).cached > 0 for one, past in zip(claims, pasts, strict=True)]
    assert again == [True, True, False, False]

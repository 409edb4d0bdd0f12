"""Cached samples: used where nothing has changed, and recomputed otherwise."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from reobserve.core.errors import DivergenceError, InputError, ReobserveError
from reobserve_papers.claims import outcomes
from reobserve_papers.claims import sample_command as commands
from reobserve_papers.claims.cached_samples import CachedSamples, alike, read_cached
from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.choices import find_choice
from reobserve_papers.claims.registry import Claim, Registry, read_registry
from reobserve_papers.claims.robustness import Robustness, assess
from reobserve_papers.claims.sample_command import keep, sample_command
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters, default_parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
GAIN = "observers.continuous.K2"  # 2000, from 500 to 5000


class Code:
    """A replacement for the computation: the gain times a factor; some samples are refused or
    lost."""

    def __init__(self) -> None:
        self.factor, self.calls = 1.0, 0

    def __call__(self, evaluator: Evaluator, figure: str, asked: object = None) -> list[Metric]:
        """The numbers of any figure."""
        self.calls += 1
        gain = evaluator.parameters.section("observers")["continuous"]["K2"]
        if 600 < gain < 700:
            raise InputError("K2", "must not be between 600 and 700")
        if 900 < gain < 1000:
            raise DivergenceError("it", 1.0)
        return [Metric("a", "gain", self.factor * gain, "1")]


@pytest.fixture
def code(monkeypatch: pytest.MonkeyPatch) -> Code:
    """The replaced computation, which a test may change."""
    instead = Code()
    monkeypatch.setattr(outcomes, "metrics_of", instead)
    return instead


def claim(above: float = 1000) -> Claim:
    checks = (Check.parse({"value": "fig1 a gain", "above": above}),)
    return Claim("ilo", "it", checks=checks, choices=(find_choice(ILO, GAIN),))


def found(
    one: Claim,
    cached: dict[str, CachedSamples] | None = None,
    samples: int = 40,
    parameters: Parameters = ILO,
) -> Robustness:
    return assess(Evaluator(parameters), [one], samples, cached=cached)["it"]


def as_made(one: Robustness) -> Robustness:
    """The same, computed in one go."""
    return replace(one, cached=0)


@pytest.fixture
def first(code: Code) -> Robustness:
    """Computed without a cache; the claim is near the threshold, so that no samples decide."""
    one = found(claim(620), samples=60)
    assert one.samples == 60
    assert one.refused
    assert one.diverged
    code.calls = 0
    return one


def test_cached_samples_equal_new_samples(code: Code, first: Robustness) -> None:
    again = found(claim(620), {"it": first.to_keep}, samples=60)
    assert as_made(again) == first
    assert code.calls == 1 + 2  # nominal, and the first two samples
    assert again.cached == 58 or first.refused[0] < 2


def test_missing_samples_are_added_to_cached_ones(code: Code, first: Robustness) -> None:
    longer = found(claim(620), {"it": first.to_keep}, samples=80)
    assert longer.samples == 80
    assert longer.trials[:60] == first.trials
    assert as_made(longer) == found(claim(620), samples=80)


def test_requesting_fewer_samples_keeps_all_cached_ones(first: Robustness) -> None:
    assert as_made(found(claim(620), {"it": first.to_keep}, samples=20)) == first


def test_change_of_the_code_invalidates_cached_samples(code: Code, first: Robustness) -> None:
    code.factor = 1.001
    moved = found(claim(620), {"it": first.to_keep}, samples=60)
    assert moved.cached == 0
    assert moved == found(claim(620), samples=60)
    code.factor = 1 + 1e-9  # rounding on another machine
    assert found(claim(620), {"it": first.to_keep}, samples=60).cached > 50


@pytest.mark.parametrize("what", ["bound", "seed", "value"])
def test_cached_samples_are_not_used_for_other_claims_or_parameters(
    code: Code, first: Robustness, what: str
) -> None:
    parameters = ILO
    if what == "seed":
        parameters = Parameters("ilo", ILO.tree, 2)
    if what == "value":
        parameters = Parameters.load(ROOT, "ilo", {"observers": {"sampled": {"K2": 4000}}}, seed=1)
    one = claim(621 if what == "bound" else 620)
    assert found(one, {"it": first.to_keep}, 60, parameters).cached == 0


def test_damaged_file_is_reported(code: Code, first: Robustness, tmp_path: Path) -> None:
    path = tmp_path / samples_path("ilo")
    keep(tmp_path, "ilo", {"it": first})
    assert read_cached(path, "ilo") == {"it": first.to_keep}
    with pytest.raises(InputError, match="is of ilo, must be of lie"):
        read_cached(path, "lie")
    stored = json.loads(path.read_text())
    stored["claims"]["it"]["samples"][3] = "12 a"
    path.write_text(json.dumps(stored))
    with pytest.raises(InputError, match=r"samples\.3: '12 a' must be numbers"):
        read_cached(path, "ilo")


def test_unsearched_reversal_is_not_cached(code: Code, tmp_path: Path) -> None:
    silent = assess(Evaluator(ILO), [claim()], 20, reversals=False)
    keep(tmp_path, "ilo", silent)
    assert read_cached(tmp_path / samples_path("ilo"), "ilo") == {}
    looked = found(claim(), {"it": silent["it"].to_keep}, 20)
    assert looked.cached > 10
    assert looked.reversal is not None


def test_samples_agree_up_to_rounding() -> None:
    assert alike((1.0, float("nan"), float("inf")), (1.0 + 1e-9, float("nan"), float("inf")))
    assert not alike((1.0,), (1.0 + 1e-5,))
    assert not alike((), None)
    assert not alike((), (1.0,))
    assert alike(None, None)
    assert alike((), ())


@pytest.mark.parametrize("paper", ["delay", "eso", "ilo", "imm", "lie"])
def test_every_claim_has_current_cached_samples(paper: str) -> None:
    """If this fails, `make samples` adds the missing ones."""
    parameters = default_parameters(ROOT, paper)
    claims = [one for one in read_registry(ROOT, parameters).claims if one.checks and one.choices]
    cached, here = read_cached(ROOT / samples_path(paper), paper), Evaluator(parameters)
    assert {name: one.basis for name, one in cached.items()} == {
        claim.name: outcomes.basis_of(here, claim) for claim in claims
    }


def test_samples_command_resumes_and_checks(
    code: Code, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project = tmp_path / "project"
    shutil.copytree(ROOT / "config", project / "config")
    shutil.copytree(ROOT / "workflow", project / "workflow")
    (project / samples_path("ilo")).unlink(missing_ok=True)
    near = Registry(claims=[claim(620), replace(claim(5000), name="never")])
    monkeypatch.setattr(commands, "read_registry", lambda *_: near)
    sample_command(project, ["ilo"], 100, check=False)
    reported = capsys.readouterr().out.splitlines()
    assert [line.split(", ")[1] for line in reported] == ["1 of 2 claims undecided"] * 3
    cached = read_cached(project / samples_path("ilo"), "ilo")
    assert [len(one.samples) for one in cached.values()] == [100, 36]
    sample_command(project, ["ilo"], 100, check=True)
    other = [claim(621), near.claims[1], replace(claim(5000), name="new")]
    monkeypatch.setattr(commands, "read_registry", lambda *_: Registry(claims=other))
    with pytest.raises(ReobserveError, match="2 claims have samples that differ"):
        sample_command(project, ["ilo"], 30, check=True)
    assert capsys.readouterr().out.splitlines() == [
        f"claims.ilo.{name}: there are no cached samples of the claim as it is"
        for name in ("it", "new")
    ]
    monkeypatch.setattr(commands, "read_registry", lambda *_: near)
    code.factor = 1.01
    with pytest.raises(ReobserveError, match="2 claims have samples that differ"):
        sample_command(project, ["ilo"], 30, check=True)
    assert "the first is 0: " in capsys.readouterr().out

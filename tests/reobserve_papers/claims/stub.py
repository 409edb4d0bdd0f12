"""Claims whose metrics are numbers of a parameter file, so that every answer is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from reobserve.core.errors import DivergenceError, InputError
from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.choices import find_choice
from reobserve_papers.claims.inquiry import Inquiry, Robustness
from reobserve_papers.claims.registry import Claim, Registry, read_registry
from reobserve_papers.claims.sample_table import SampleTable
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
GAIN = "observers.continuous.K2"  # 2000, from 500 to 5000: logarithmic
SHARE = "observers.forgetting.K1"  # 0.9, from 0.5 to 0.99: linear
VARIANT = "metrics.variant"  # the first of these words
VARIANTS = ("sampled", "continuous", "forgetting")
PERIODS = "theory.periods_per_update"  # 1, one of 1, 2, 5 and 10


class Code:
    """A replacement for the computation of metrics.

    The gain is multiplied by a factor. Gains in ``refused`` and ``lost`` are refused and diverge;
    of fig2 those below 1000 diverge, too, and of fig3 they are refused. ``also`` are names of
    metrics that are the gain times a number of their own. What is `left` is one, and rounding where
    the gain is below ``rests``. Whatever gains are asked for are listed.
    """

    def __init__(self) -> None:
        self.factor, self.refused, self.lost = 1.0, (0, 0), (0, 0)
        self.asked: list[float] = []
        self.also: dict[str, float] = {}
        self.rests = 0.0

    def __call__(self, evaluator: Evaluator, figure: str, asked: object = None) -> list[Metric]:
        """The numbers of any figure."""
        observers = evaluator.parameters.section("observers")
        gain = observers["continuous"]["K2"]
        self.asked.append(gain)
        below = gain < 1000
        if (figure == "fig2" and below) or self.lost[0] < gain < self.lost[1]:
            raise DivergenceError("it", 1.0)
        if (figure == "fig3" and below) or self.refused[0] < gain < self.refused[1]:
            raise InputError("K2", "must be another")
        numbers = {
            "gain": self.factor * gain,
            "left": math.nan if gain < self.rests else 1.0,
            "share": observers["forgetting"]["K1"] / 3,
            "variant": VARIANTS.index(evaluator.parameters.section("metrics")["variant"]),
            "relative_rms_error": self.factor * gain,
            "rms_error": VARIANTS.index(evaluator.parameters.section("metrics")["variant"]),
            **{name: times * gain for name, times in self.also.items()},
        }
        found = [Metric("a", name, value, "1") for name, value in numbers.items()]
        return [*found, *(replace(one, observer="sampled") for one in found), *_idle(figure)]


def _idle(figure: str) -> list[Metric]:
    """Numbers of an estimator that knows nothing."""
    return [Metric("idle", name, 1000.0, "1") for name in ("gain", "relative_rms_error")]


def claim(value: str, *keys: str, name: str = "it", **relation: Any) -> Claim:
    """A claim of one check, which depends on these choices."""
    checks = (Check.parse({"value": value, **relation}),)
    return with_checks(
        Claim("ilo", name, choices=tuple(find_choice(ILO, key) for key in keys)), *checks
    )


def assess(
    evaluator: Evaluator,
    claims: Sequence[Claim],
    samples: Callable[[Claim], int],
    share: float,
    cached: SampleTable | None = None,
) -> dict[str, Robustness]:
    """The samples of claims, as the job `robustness` makes them."""
    inquiry = Inquiry.begin(evaluator, claims, share, cached)
    inquiry.fill(samples)
    return inquiry.sampled


def with_checks(one: Claim, *checks: Check) -> Claim:
    """The same claim with other checks, whose numbers samples take."""
    one = replace(one, checks=checks)
    return replace(one, wanted=tuple(dict.fromkeys(one.references_of_all)))


ENTRY = {
    "place": "Fig. 1",
    "statement": "The gain is large.",
    "checks": [{"value": "fig1 sampled relative_rms_error", "above": 1000}],
    "why": "So.",
    "threshold": "after",
    "promised": ["abstract"],
    "depends_on": [GAIN],
}


def registry(
    project: Path,
    claims: Mapping[str, Mapping[str, Any]] | None = None,
    conventions: Mapping[str, Any] | None = None,
    alternatives: Mapping[str, Any] | None = None,
) -> Registry:
    """The claims of `ilo` in a project with these entries, of which each differs from `ENTRY`."""
    write_registry(project, claims, conventions, alternatives)
    return read_registry(project, ILO)


def write_registry(
    project: Path,
    claims: Mapping[str, Mapping[str, Any]] | None = None,
    conventions: Mapping[str, Any] | None = None,
    alternatives: Mapping[str, Any] | None = None,
) -> None:
    """Write the two files that `registry` reads."""
    entries = {name: {**ENTRY, "statement": name, **one} for name, one in (claims or {}).items()}
    write(project / "config/claims/ilo.yaml", {"limitations": "Nothing.", "claims": entries})
    stated = {name: {"why": "So.", **one} for name, one in (conventions or {}).items()}
    single = {
        name: {"why": "So.", "paper": "ilo", **one} for name, one in (alternatives or {}).items()
    }
    tree = {"note": "Chosen late.", "conventions": stated, "alternatives": single}
    write(project / "config/conventions.yaml", tree)


def write(path: Path, tree: Any) -> None:
    """Write YAML."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")

"""The command that caches samples of claims in ``config/samples``, or repeats the cached ones."""

from __future__ import annotations

from collections.abc import Container, Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError
from reobserve_papers.claims.inquiry import Inquiry
from reobserve_papers.claims.registry import Claim, Registry, has_claims, read_registry
from reobserve_papers.claims.sample_table import alike, keep, read_cached
from reobserve_papers.parameters.config import known_papers, named_papers, refuse_unknown
from reobserve_papers.parameters.parameters import Parameters, default_parameters
from reobserve_papers.steps.evaluation import Evaluator

_FIRST = 40  # samples of the first step; each later step doubles them and caches the results
_SECONDS = 300.0  # CPU time for each claim; the next call of the command goes on from there


def sample_command(
    project: Path, paper: Sequence[str], claim: Sequence[str], max_samples: int | None, check: bool
) -> None:
    """Sample until claims are decided and have enough samples, starting from the cached ones.

    Main claims, and those that depend on unstated choices, have enough if these are as many as the
    convention `samples` says. With ``check`` nothing is written: the cached samples are recomputed
    and compared.
    ``max_samples`` limits the samples of each claim (None: the convention `samples`, or what the
    claim says itself), ``claim`` says which claims are sampled (none: all).
    """
    known = [name for name in known_papers(project) if has_claims(project, name)]
    differing = []
    for name in named_papers(known, paper):
        parameters = default_parameters(project, name)
        registry = read_registry(project, parameters)
        claims = _named(registry.claims, claim)
        if check:
            differing += _differences(project, parameters, registry, claims, max_samples)
        else:
            _sample_on(project, parameters, registry, claims, max_samples)
    if differing:
        problem = f"{len(differing)} claims have samples that differ"
        print(f"{problem}:", *differing, sep="\n")
        raise ReobserveError(problem)


def _named(claims: list[Claim], named: Sequence[str]) -> list[Claim]:
    refuse_unknown("--claim", named, [claim.name for claim in claims])
    return [claim for claim in claims if not named or claim.name in named]


def sample_again(
    project: Path, parameters: Parameters, undecided: Container[str], seconds: float
) -> bool:
    """Sample claims whose cached samples do not apply any more, and cache: False if none was.

    So are those that a build left ``undecided``. No claim is sampled for more than so many CPU
    ``seconds``.
    """
    registry, evaluator = read_registry(project, parameters), Evaluator(parameters)
    cached = read_cached(project, parameters.paper)
    sampled = [claim for claim in registry.claims if claim.checks and claim.choices]
    claims = [
        claim
        for claim in sampled
        if claim.name in undecided or not cached.current(evaluator, claim)
    ]
    if claims:
        _sample_on(project, parameters, registry, claims, None, seconds)
    return bool(claims)


def _sample_on(
    project: Path, parameters: Parameters, registry: Registry, claims: list[Claim],
    max_samples: int | None, seconds: float = _SECONDS,
) -> None:  # fmt: skip
    """Sample in steps, so that little is lost if the command is stopped (see `Inquiry.fill`)."""
    values = registry.conventions.values
    limits = {claim.name: max_samples or claim.maximum or values["samples"] for claim in claims}
    cached, enough = read_cached(project, parameters.paper), values["samples"]
    inquiry = Inquiry.begin(Evaluator(parameters), claims, values["share"], cached, complete=True)
    tried, step = inquiry.sampled, _FIRST

    def limit(claim: Claim) -> int:
        return min(step, limits[claim.name])

    while True:
        inquiry.fill(limit, seconds=seconds, enough=min(enough, max_samples or enough))
        keep(project, parameters, inquiry.to_keep())
        left = [claim.name for claim in inquiry.claims if len(inquiry.possible(claim)) > 1]
        lacking = [claim.name for claim in inquiry.claims if inquiry.lacks(claim, enough)]
        print(
            f"{parameters.paper}: {sum(robustness.samples for robustness in tried.values())} "
            f"samples, {len(left)} of {len(tried)} claims undecided, {len(lacking)} have fewer "
            f"than {enough} samples",
            flush=True,
        )
        if all(
            max(step, tried[name].samples) >= limits[name] or inquiry.spent[name] >= seconds
            for name in {*left, *lacking}
        ):
            return
        step *= 2


def _differences(
    project: Path, parameters: Parameters, registry: Registry, claims: list[Claim],
    max_samples: int | None,
) -> list[str]:  # fmt: skip
    """The claims whose recomputed samples differ from the cached ones, a sentence each."""
    values, evaluator = registry.conventions.values, Evaluator(parameters)
    cached = read_cached(project, parameters.paper)
    inquiry = Inquiry.begin(evaluator, claims, values["share"])
    inquiry.fill(lambda _: max_samples or values["samples"])
    said = []
    for claim in inquiry.claims:
        place = f"claims.{parameters.paper}.{claim.name}"
        if (past := cached.current(evaluator, claim)) is None:
            said.append(f"{place}: there are no cached samples of the claim as it is")
            continue
        made = inquiry.sampled[claim.name].to_keep(claim)
        looked = set(made.references).intersection(past.references)
        both = range(min(len(made.samples), len(past.samples)))
        moved = [k for k in both if not alike(made.at(k), past.at(k), looked)]
        if moved:
            k = moved[0]
            said.append(
                f"{place}: {len(moved)} of {len(both)} samples differ, the first is {k}: "
                f"{past.samples[k]} was cached, now {made.samples[k]}"
            )
    return said

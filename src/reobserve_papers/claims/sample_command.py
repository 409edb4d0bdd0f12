"""The command that caches samples of claims in ``config/samples``, or repeats the cached ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from reobserve.core.errors import InputError, ReobserveError, nearest, shown
from reobserve_papers.claims.cached_samples import (
    Cache,
    CachedSamples,
    alike,
    read_cached,
    write_cached,
)
from reobserve_papers.claims.outcomes import basis_of
from reobserve_papers.claims.registry import Claim, claims_file, read_registry
from reobserve_papers.claims.robustness import assess
from reobserve_papers.claims.verdicts import possible
from reobserve_papers.parameters.config import known_papers, named_papers
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters, default_parameters
from reobserve_papers.steps.evaluation import Evaluator

_FIRST = 40  # samples of the first step; each later step doubles them and caches the results


def sample_command(
    project: Path, paper: Sequence[str], claim: Sequence[str], max_samples: int | None, check: bool
) -> None:
    """Sample until claims are decided, starting from the cached samples.

    With ``check`` nothing is written: the cached samples are recomputed and compared.
    ``max_samples`` limits the samples of each claim (None: the convention `samples`, or what the
    claim says itself), ``claim`` says which claims are sampled (none: all).
    """
    known = [one for one in known_papers(project) if claims_file(project, one).is_file()]
    differing = []
    for one in named_papers(known, paper):
        parameters = default_parameters(project, one)
        registry = read_registry(project, parameters)
        claims = _named(registry.claims, claim)
        most = max_samples or registry.conventions.values["samples"]
        share = registry.conventions.values["share"]
        if check:
            differing += _differences(parameters, claims, share, _cached(project, one), most)
        else:
            _sample_on(project, parameters, claims, share, max_samples, most)
    if differing:
        print("\n".join(differing))
        raise ReobserveError(f"{len(differing)} claims have samples that differ")


def keep(project: Path, parameters: Parameters, found: Mapping[str, CachedSamples]) -> None:
    """Keep the samples of a paper's claims, and those that there were of others."""
    cached, evaluator = _cached(project, parameters.paper), Evaluator(parameters)
    kept = {}
    for claim in read_registry(project, parameters).claims:
        if claim.name in found:
            kept[claim.name] = found[claim.name]
        elif (past := cached.get(claim.name)) is not None:
            # They are kept with the keys that there are now.
            if past.basis == basis_of(evaluator, claim, cached.keys):
                past = replace(past, basis=basis_of(evaluator, claim))
            kept[claim.name] = past
    write_cached(project, parameters, kept)


def _named(claims: list[Claim], named: Sequence[str]) -> list[Claim]:
    known = [one.name for one in claims]
    for name in named:
        if name not in known:
            raise InputError("--claim", f"there is no {shown(name)}{nearest(name, known)}")
    return [one for one in claims if not named or one.name in named]


def _sample_on(
    project: Path,
    parameters: Parameters,
    claims: list[Claim],
    share: float,
    asked: int | None,
    most: int,
) -> None:
    """Sample in steps, so that little is lost if the command is stopped."""
    limits = {one.name: asked or one.maximum or most for one in claims}
    longest, step = max(limits.values(), default=0), _FIRST
    evaluator = Evaluator(parameters)
    while True:
        cached = _with_all_numbers(_cached(project, parameters.paper), claims)
        found = assess(
            evaluator.apart(), claims, partial(_limited, limits, step),
            share, cached,
        )  # fmt: skip
        by_name = {one.name: one for one in claims}
        keep(project, parameters, {name: one.to_keep(by_name[name]) for name, one in found.items()})
        judged = {
            name: possible(
                by_name[name].quantifier, one.counted(one.outcomes(by_name[name])), share
            )
            for name, one in found.items()
        }
        left = [name for name, one in judged.items() if len(one) > 1]
        drawn = f"{sum(one.samples for one in found.values())} samples"
        print(
            f"{parameters.paper}: {drawn}, {len(left)} of {len(found)} claims undecided", flush=True
        )
        if step >= longest or all(found[name].samples >= limits[name] for name in left):
            return
        step *= 2


def _limited(limits: Mapping[str, int], step: int, claim: Claim) -> int:
    return min(step, limits[claim.name])


def _with_all_numbers(cached: Cache, claims: list[Claim]) -> Cache:
    """The cached samples that have all numbers which checks and alternatives name."""
    wanted = {one.name: set(one.wanted) for one in claims}
    return Cache(
        cached.keys,
        {
            name: one
            for name, one in (cached.claims or {}).items()
            if wanted.get(name, set()).issubset(one.references)
        },
    )


def _differences(
    parameters: Parameters, claims: list[Claim], share: float, cached: Cache, max_samples: int
) -> list[str]:
    """The claims whose recomputed samples differ from the cached ones, a sentence each."""
    said = []
    by_name, evaluator = {one.name: one for one in claims}, Evaluator(parameters)
    for name, one in assess(evaluator, claims, lambda _: max_samples, share).items():
        place, past = f"claims.{parameters.paper}.{name}", cached.get(name)
        if past is None or past.basis != basis_of(evaluator, by_name[name], cached.keys):
            said.append(f"{place}: there are no cached samples of the claim as it is")
            continue
        made = one.to_keep(by_name[name])
        looked = set(made.references).intersection(past.references)
        both = range(min(len(made.samples), len(past.samples)))
        moved = [k for k in both if not alike(made.found(k), past.found(k), looked)]
        if moved:
            k = moved[0]
            said.append(
                f"{place}: {len(moved)} of {len(both)} samples differ, the first is {k}: "
                f"{past.samples[k]} was cached, now {made.samples[k]}"
            )
    return said


def _cached(project: Path, paper: str) -> Cache:
    path = project / samples_path(paper)
    return read_cached(path, paper) if path.exists() else Cache()

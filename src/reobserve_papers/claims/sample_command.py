"""The command that caches samples of claims in ``config/samples``, or repeats the cached ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError
from reobserve_papers.claims.cached_samples import CachedSamples, alike, read_cached, write_cached
from reobserve_papers.claims.registry import Claim, claims_file, read_registry
from reobserve_papers.claims.robustness import Robustness, assess
from reobserve_papers.parameters.config import known_papers, named_papers
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters, default_parameters
from reobserve_papers.steps.evaluation import Evaluator

_FIRST = 40  # samples of the first step; each later step doubles them and caches the results


def sample_command(project: Path, paper: Sequence[str], max_samples: int, check: bool) -> None:
    """Sample until claims are decided, starting from the cached samples.

    With ``check`` nothing is written: the cached samples are recomputed and compared.
    ``max_samples`` limits the samples of each claim.

    Raises
    ------
    ReobserveError
        If a recomputed sample differs from the cached one.
    """
    known = [one for one in known_papers(project) if claims_file(project, one).is_file()]
    differing = []
    for one in named_papers(known, paper):
        parameters = default_parameters(project, one)
        claims = read_registry(project, parameters).claims
        if check:
            differing += _differences(parameters, claims, _cached(project, one), max_samples)
        else:
            _sample_on(project, parameters, claims, max_samples)
    if differing:
        print("\n".join(differing))
        raise ReobserveError(f"{len(differing)} claims have samples that differ")


def keep(project: Path, paper: str, found: Mapping[str, Robustness]) -> None:
    """Keep what was found of a paper's claims."""
    write_cached(project, paper, {name: one.to_keep for name, one in found.items() if one.looked})


def _sample_on(
    project: Path, parameters: Parameters, claims: list[Claim], max_samples: int
) -> None:
    """Sample in steps, so that little is lost if the command is stopped."""
    step = min(_FIRST, max_samples)
    while True:
        found = assess(
            Evaluator(parameters), claims, step, cached=_cached(project, parameters.paper)
        )
        keep(project, parameters.paper, found)
        left = [one for one in found.values() if one.firm is None]
        drawn = f"{sum(one.samples for one in found.values())} samples"
        print(
            f"{parameters.paper}: {drawn}, {len(left)} of {len(found)} claims undecided", flush=True
        )
        if step == max_samples or not left:
            return
        step = min(2 * step, max_samples)


def _differences(
    parameters: Parameters,
    claims: list[Claim],
    cached: Mapping[str, CachedSamples],
    max_samples: int,
) -> list[str]:
    """The claims whose recomputed samples differ from the cached ones, a sentence each."""
    said = []
    for name, one in assess(Evaluator(parameters), claims, max_samples, reversals=False).items():
        place, past = f"claims.{parameters.paper}.{name}", cached.get(name)
        if past is None or past.basis != one.basis:
            said.append(f"{place}: there are no cached samples of the claim as it is")
            continue
        made = one.to_keep
        both = range(min(len(made.samples), len(past.samples)))
        moved = [k for k in both if not alike(made.numbers(k), past.numbers(k))]
        if moved:
            k = moved[0]
            said.append(
                f"{place}: {len(moved)} of {len(both)} samples differ, the first is {k}: "
                f"{past.samples[k]} was cached, now {made.samples[k]}"
            )
    return said


def _cached(project: Path, paper: str) -> dict[str, CachedSamples]:
    path = project / samples_path(paper)
    return read_cached(path, paper) if path.exists() else {}

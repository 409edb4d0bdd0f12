"""The command that keeps draws of claims beside the ledgers, or makes the kept ones again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError
from reobserve.replication.claims.kept_draws import KeptDraws, alike, read_kept, write_kept
from reobserve.replication.claims.registry import Claim, claims_file, read_registry
from reobserve.replication.claims.robustness import Robustness, assess
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.parameters.config import known_papers, named_papers
from reobserve.replication.parameters.ledger import Ledger, default_ledger
from reobserve.replication.parameters.names import samples_path

_FIRST = 40  # draws; from here on the most is doubled, and what is there is kept each time


def draws_command(project: Path, paper: Sequence[str], most: int, check: bool) -> None:
    """Draw until claims are decided or ``most`` draws are made, going on from those that are kept.

    With ``check`` nothing is kept, and all are made again that are, up to ``most`` of a claim.

    Raises
    ------
    ReobserveError
        If a draw that is made again comes out otherwise.
    """
    known = [one for one in known_papers(project) if claims_file(project, one).is_file()]
    differing = []
    for one in named_papers(known, paper):
        ledger = default_ledger(project, one)
        claims = read_registry(project, ledger).claims
        if check:
            differing += _differences(ledger, claims, _kept(project, one), most)
        else:
            _draw_on(project, ledger, claims, most)
    if differing:
        print("\n".join(differing))
        raise ReobserveError(f"{len(differing)} claims have draws that come out otherwise")


def keep(project: Path, paper: str, found: Mapping[str, Robustness]) -> None:
    """Keep what was found of a paper's claims."""
    write_kept(project, paper, {name: one.to_keep for name, one in found.items() if one.looked})


def _draw_on(project: Path, ledger: Ledger, claims: list[Claim], most: int) -> None:
    """In steps, so that little is lost where it is ended before."""
    step = min(_FIRST, most)
    while True:
        found = assess(Evaluator(ledger), claims, step, kept=_kept(project, ledger.paper))
        keep(project, ledger.paper, found)
        left = [one for one in found.values() if one.firm is None]
        drawn = f"{sum(one.draws for one in found.values())} draws"
        print(f"{ledger.paper}: {drawn}, {len(left)} of {len(found)} claims undecided", flush=True)
        if step == most or not left:
            return
        step = min(2 * step, most)


def _differences(
    ledger: Ledger, claims: list[Claim], kept: Mapping[str, KeptDraws], most: int
) -> list[str]:
    """The claims whose draws come out otherwise, a sentence each."""
    said = []
    for name, one in assess(Evaluator(ledger), claims, most, flips=False).items():
        place, past = f"claims.{ledger.paper}.{name}", kept.get(name)
        if past is None or past.basis != one.basis:
            said.append(f"{place}: no draws are kept of it as it is")
            continue
        made = one.to_keep
        both = range(min(len(made.draws), len(past.draws)))
        moved = [k for k in both if not alike(made.numbers(k), past.numbers(k))]
        if moved:
            k = moved[0]
            said.append(
                f"{place}: {len(moved)} of {len(both)} draws differ, the first is {k}: "
                f"{past.draws[k]} was kept, now {made.draws[k]}"
            )
    return said


def _kept(project: Path, paper: str) -> dict[str, KeptDraws]:
    path = project / samples_path(paper)
    return read_kept(path, paper) if path.exists() else {}

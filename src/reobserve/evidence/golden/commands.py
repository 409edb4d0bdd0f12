"""The commands over all golden numbers: compare them, here and elsewhere, or renew them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.errors import ReobserveError
from reobserve.evidence.golden import digests
from reobserve.evidence.golden.comparison import Worst, differences
from reobserve.evidence.golden.elsewhere import compare_elsewhere
from reobserve.evidence.golden.files import folder
from reobserve.evidence.golden.guard import check_may_renew, keep_reason
from reobserve.evidence.golden.kept import kept_paper
from reobserve.evidence.golden.processors import PINNED, REFINED, processors
from reobserve.evidence.golden.renewal import Evidence, prepare
from reobserve.evidence.golden.runs import Run, run_all
from reobserve.ledger.config import known_papers, named_papers
from reobserve.ledger.ledger import default_ledger
from reobserve.plain_data.documents import read_yaml
from reobserve.replication.evaluation import Evaluator


def check_command(project: Path) -> None:
    """Compare all numbers of all papers that are built; print and fail on deviations."""
    found = []
    for paper in _built(project):
        golden = folder(project, paper)
        kept = kept_paper(Evaluator(default_ledger(project, paper)))
        every = [
            one
            for part, numbers in kept.parts.items()
            for one in differences(numbers, paper, part, golden)
        ]
        worst = Worst.of(every)
        print(f"{paper}: {worst.count} numbers compared, {worst.exceeded} off")
        said = digests.first_difference(golden, kept.digests)
        if said:
            print(f"  {said}; at most {worst.ratio:.2g} tolerances: {worst.what}")
        found += [str(one) for one in every if one.exceeds]
    for deviation in found:
        print(deviation)
    if found:
        raise ReobserveError(f"{len(found)} golden numbers moved beyond their tolerances")


def elsewhere_command(project: Path, papers: Sequence[str], part: str, cores: int) -> None:
    """Compare all numbers with the golden ones under emulated processors; fail on deviations."""
    chosen = named_papers(known_papers(project), papers) if papers else _built(project)
    compare_elsewhere(project, chosen, part == "gate", cores)


def update_command(
    project: Path, paper: Sequence[str], reason: str, cores: int, anew: bool
) -> None:
    """Renew golden numbers: refuses without a reason, in CI and on a dirty tree."""
    check_may_renew(project, reason)
    chosen = named_papers(known_papers(project), paper)
    moved = renew(project, chosen, cores, anew=anew)
    print("\n".join(moved) if moved else "nothing moved beyond its tolerance")
    keep_reason(project, reason, f"{len(moved)} moved")


def renew(project: Path, papers: Sequence[str], cores: int, *, anew: bool = False) -> list[str]:
    """Write the golden numbers of these papers anew; what moved, a line each, old and new.

    Everything is evaluated before anything is written: with pinned code paths, with every step
    halved, and under each emulated processor.
    """

    def report(run: Run) -> None:
        print(f"evaluated: {run.condition.name}, {run.seconds:.0f} s", flush=True)

    conditions = [PINNED, REFINED, *processors()]
    pinned, refined, *others = run_all(
        project, dict.fromkeys(papers, None), conditions, cores, report
    )
    renewals = [
        prepare(
            paper,
            Evidence(
                pinned.papers[paper], [run.papers[paper] for run in others], refined.papers[paper]
            ),
            folder(project, paper),
            anew=anew,
        )
        for paper in papers
    ]
    for renewal in renewals:
        renewal.write()
    return [line for renewal in renewals for line in renewal.moved]


def _built(project: Path) -> list[str]:
    stated: list[str] = read_yaml(project / "config" / "config.yaml").get("papers", [])
    return stated or known_papers(project)

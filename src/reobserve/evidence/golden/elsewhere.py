"""The golden numbers on other processors: which stage differs first there, what moves most."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from reobserve.errors import ReobserveError
from reobserve.evidence.golden import digests
from reobserve.evidence.golden.comparison import Worst, differences
from reobserve.evidence.golden.deviation import Deviation, OtherCell
from reobserve.evidence.golden.files import folder
from reobserve.evidence.golden.kept import THEORY, KeptPaper, part_names
from reobserve.evidence.golden.processors import ONE_ULP, Condition, processors
from reobserve.evidence.golden.runs import Order, Run, run_all
from reobserve.ledger.ledger import Ledger, default_ledger

GATE = 2  # so many processors, the most telling, are enough for every change


def compare_elsewhere(project: Path, papers: list[str], gate: bool, cores: int) -> None:
    """Evaluate under each emulated processor, print a line for each, and fail if a number is off.

    With ``gate`` only what `gate_parts` names, on a few of them.

    Raises
    ------
    ReobserveError
        If a number leaves its tolerance, or something cannot be evaluated.
    """
    ledgers = [default_ledger(project, paper) for paper in papers]
    order: Order = {one.paper: gate_parts(one) if gate else part_names(one.tree) for one in ledgers}
    chosen = processors()[:GATE] if gate else processors()
    print(f"{sum(len(parts or ()) for parts in order.values())} figures, tables and theories of "
          f"{', '.join(papers)}, on {len(chosen)} emulated processors", flush=True)  # fmt: skip
    failed: list[str] = []

    def report(run: Run) -> None:
        found = {paper: list(_differences(project, paper, run)) for paper in run.papers}
        worst = Worst.of(one for every in found.values() for one in every)
        print(line(run, worst), flush=True)
        for paper, kept in run.papers.items():
            said = _first_stage(folder(project, paper), kept, run.condition)
            if said:
                print(f"    {paper}: {said}; at most {_in_tolerances(Worst.of(found[paper]))}")
        failed.extend(
            f"{run.condition.name}: {one}"
            for every in found.values() for one in every if one.exceeds
        )  # fmt: skip

    run_all(project, order, chosen, cores, report)
    if failed:
        print(*failed, sep="\n")
        raise ReobserveError(f"{len(failed)} golden numbers are off on other processors")


def gate_parts(ledger: Ledger) -> list[str]:
    """What depends on a design, and the first figure: where processors show first."""
    tree = ledger.tree
    chosen = list(tree["figures"])[:1]
    chosen += [name for name in tree["figures"] if ledger.settings("plot", name).get("designs")]
    chosen += [name for name, body in tree.get("tables", {}).items() if "design" in body]
    if "designs" in tree and THEORY in tree:
        chosen.append(THEORY)
    return list(dict.fromkeys(chosen))


def line(run: Run, worst: Worst) -> str:
    """One row of the table: the processor, how many numbers, which moved most, in tolerances."""
    return (
        f"{run.condition.name:<32} {run.seconds:4.0f} s  {worst.count:5d} numbers, "
        f"{worst.exceeded:4d} off; at most {_in_tolerances(worst)}"
    )


def _in_tolerances(worst: Worst) -> str:
    if math.isinf(worst.ratio):
        return f"beyond measure: {worst.what}"
    return f"{worst.ratio:.2g} tolerances: {worst.what}"


def _differences(project: Path, paper: str, run: Run) -> Iterator[Deviation | OtherCell]:
    for part, numbers in run.papers[paper].parts.items():
        yield from differences(numbers, paper, part, folder(project, paper))


def _first_stage(golden: Path, found: KeptPaper, condition: Condition) -> str:
    """Which stage differs first; of a record that was moved on purpose there is nothing to say."""
    return "" if condition == ONE_ULP else digests.first_difference(golden, found.digests)

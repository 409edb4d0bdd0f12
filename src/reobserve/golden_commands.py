"""The commands over all golden numbers: compare them, or renew them for a reason."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve import golden, golden_tables
from reobserve.config import known_papers, read_yaml
from reobserve.errors import InputError, ReobserveError
from reobserve.evaluation import Evaluator
from reobserve.golden_guard import check_may_renew, keep_reason
from reobserve.ledger import Ledger


def check_command(project: Path) -> None:
    """Compare all figures and tables of all papers that are built; print and fail on deviations."""
    found: list[str] = []
    for paper in read_yaml(project / "config" / "config.yaml")["papers"]:
        evaluator = Evaluator(_default_ledger(project, paper))
        kept = golden.folder(project, paper)
        for figure in evaluator.ledger.tree["figures"]:
            found += map(str, golden.compare(evaluator, figure, kept))
            print(f"{paper} {figure}: compared")
        for table in evaluator.ledger.tree.get("tables", {}):
            found += map(str, golden_tables.compare(evaluator, table, kept))
            print(f"{paper} {table}: compared")
    for deviation in found:
        print(deviation)
    if found:
        raise ReobserveError(f"{len(found)} golden numbers moved beyond their tolerances")


def update_command(project: Path, paper: Sequence[str], reason: str) -> None:
    """Renew golden numbers: refuses without a reason, in CI and on a dirty tree."""
    check_may_renew(project, reason)
    moved: list[str] = []
    for name in paper or known_papers(project):
        evaluator = Evaluator(_default_ledger(project, name))
        refined = evaluator.refined()
        kept = golden.folder(project, name)
        for figure in evaluator.ledger.tree["figures"]:
            try:
                moved += map(str, golden.compare(evaluator, figure, kept))
            except InputError as error:
                moved.append(f"{name} {figure}: written anew ({error})")
            golden.write(evaluator, refined, figure, kept)
        for table in evaluator.ledger.tree.get("tables", {}):
            try:
                moved += map(str, golden_tables.compare(evaluator, table, kept))
            except InputError as error:
                moved.append(f"{name} {table}: written anew ({error})")
            golden_tables.write(evaluator, table, kept)
    print("\n".join(moved) if moved else "nothing moved beyond its tolerance")
    keep_reason(project, reason, len(moved))


def _default_ledger(project: Path, paper: str) -> Ledger:
    seed = read_yaml(project / "config" / "config.yaml")["seed"]
    return Ledger.load(project, paper, seed=seed)

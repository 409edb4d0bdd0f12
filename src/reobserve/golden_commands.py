"""The commands over all golden numbers: compare them, or renew them for a reason."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from reobserve import golden, golden_tables
from reobserve.config import known_papers, read_yaml
from reobserve.errors import InputError, ReobserveError
from reobserve.evaluation import Evaluator
from reobserve.golden_guard import check_may_renew, keep_reason
from reobserve.ledger import Ledger


@dataclass(frozen=True)
class _Part:
    """A figure, a table or the theory of a paper: its name, and how it is compared."""

    name: str
    compare: Callable[[], Iterable[object]]
    write: Callable[[Evaluator], None]


def check_command(project: Path) -> None:
    """Compare all numbers of all papers that are built; print and fail on deviations."""
    found: list[str] = []
    for paper in read_yaml(project / "config" / "config.yaml")["papers"]:
        evaluator = Evaluator(_default_ledger(project, paper))
        for part in _parts(evaluator, golden.folder(project, paper)):
            found += map(str, part.compare())
            print(f"{paper} {part.name}: compared")
    for deviation in found:
        print(deviation)
    if found:
        raise ReobserveError(f"{len(found)} golden numbers moved beyond their tolerances")


def update_command(project: Path, paper: Sequence[str], reason: str) -> None:
    """Renew golden numbers: refuses without a reason, in CI and on a dirty tree."""
    check_may_renew(project, reason)
    moved = renew(project, paper or known_papers(project))
    print("\n".join(moved) if moved else "nothing moved beyond its tolerance")
    keep_reason(project, reason, f"{len(moved)} moved")


def renew(project: Path, papers: Sequence[str]) -> list[str]:
    """Write the golden numbers of these papers anew; what moved, a line each, old and new."""
    moved: list[str] = []
    for name in papers:
        evaluator = Evaluator(_default_ledger(project, name))
        refined = evaluator.refined()
        for part in _parts(evaluator, golden.folder(project, name)):
            try:
                moved += map(str, part.compare())
            except InputError as error:
                moved.append(f"{name} {part.name}: written anew ({error})")
            part.write(refined)
    return moved


def _parts(evaluator: Evaluator, kept: Path) -> Iterator[_Part]:
    """Everything of a paper that golden numbers are kept of."""
    paper, tree = evaluator.ledger.paper, evaluator.ledger.tree

    def figure(name: str) -> _Part:
        return _Part(
            name,
            lambda: golden.compare(evaluator.figure(name), paper, name, kept),
            lambda refined: golden.write(evaluator, refined, name, kept),
        )

    def table(name: str) -> _Part:
        return _Part(
            name,
            lambda: golden_tables.compare(evaluator, name, kept),
            lambda _: golden_tables.write(evaluator, name, kept),
        )

    yield from map(figure, tree["figures"])
    yield from map(table, tree.get("tables", {}))
    if golden.THEORY in tree:
        yield _Part(
            golden.THEORY,
            lambda: golden.compare_metrics(evaluator.theory(), paper, golden.THEORY, kept),
            lambda refined: golden.write_theory(evaluator, refined, kept),
        )


def _default_ledger(project: Path, paper: str) -> Ledger:
    seed = read_yaml(project / "config" / "config.yaml")["seed"]
    return Ledger.load(project, paper, seed=seed)

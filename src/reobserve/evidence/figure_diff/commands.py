"""The commands `figdiff`, which compares a build with what was accepted, and `accept`."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.claims.draws_command import keep
from reobserve.evidence.claims.robustness_file import read_robustness
from reobserve.evidence.claims.verdict_table import put_into
from reobserve.evidence.figure_diff import pixels
from reobserve.evidence.figure_diff.comparison import compare_all, figures
from reobserve.evidence.figure_diff.page import counts, render, to_markdown
from reobserve.evidence.figure_diff.project_copy import build, copy_project
from reobserve.evidence.golden import claims as golden_claims
from reobserve.evidence.golden.acceptance import renew
from reobserve.evidence.golden.guard import check_may_accept, keep_reason
from reobserve.evidence.meanings import write_lists
from reobserve.ledger.config import known_papers, named_papers
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.files import write_text

_BUILD_LOG = "build.log"


def figdiff_command(
    project: Path, reference: Path, results: Path, output: Path, build: bool, cores: int
) -> None:
    """Compare, write page and summary to ``output``; fail if anything does not agree.

    With ``build`` everything is built from scratch in a temporary folder, and ``results`` is not
    looked at.
    """
    if not build:
        _compare(project, reference, results, output, [])
        return
    with _built_copy(project, cores, output / _BUILD_LOG) as (copy, problems):
        _compare(project, reference, copy / "results", output, problems)


def accept_command(project: Path, paper: Sequence[str], reason: str, cores: int) -> None:
    """Accept figures, golden numbers, verdicts, and the table of the README, of some or all papers.

    Refuses without a reason, in CI and on a dirty tree. Everything is built first: if the build
    fails, what was accepted stays.
    """
    check_may_accept(project, reason)
    known = known_papers(project)
    chosen = named_papers(known, paper)
    with _built_copy(project, cores, project / "figdiff" / _BUILD_LOG, paper) as (copy, problems):
        if problems:
            raise ReobserveError(f"nothing is accepted: {problems[0]}")
        results, moved = copy / "results", []
        for one in chosen:
            tree = Ledger.load(project, one).tree
            moved += renew(project, results / one, tree, one, cores)
            _keep_samples(project, results, one)
        moved += golden_claims.renew(project, results, paper)
        put_into(project / "README.md", results / "verdicts.md", known if paper else ())
        write_lists(project)
        redrawn = _renew_references(project / "tests" / "reference", results, chosen)
    print("\n".join([*moved, *redrawn]) if moved or redrawn else "nothing moved")
    keep_reason(project, reason, f"{len(moved)} numbers and {len(redrawn)} figures moved")


@contextmanager
def _built_copy(
    project: Path, cores: int, log: Path, papers: Sequence[str] = ()
) -> Iterator[tuple[Path, list[str]]]:
    """A copy of the project with everything built that can be; what failed, in a sentence."""
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        copy = Path(folder)
        copy_project(project, copy)
        what = ", ".join(papers) or "everything"
        print(f"building {what} from scratch in a temporary folder, some minutes", flush=True)
        whole = build(copy, project, cores, log, papers)
        yield copy, [] if whole else [f"the build failed in part; {log} has what it said"]


def _compare(
    project: Path, reference: Path, results: Path, output: Path, problems: list[str]
) -> None:
    for option, path in (("--reference", reference), ("--results", results)):
        if not path.is_dir():
            problems = [*problems, f"{option}: there is no folder {path}"]
    items = compare_all(project, reference, results)
    write_text(output / "summary.md", to_markdown(items, problems))
    write_text(output / "index.html", render(items, problems, project / "workflow" / "report"))
    failed = [item for item in items if item.verdict != "agrees"]
    for item in failed:
        print(f"{item.paper} {item.name}: {item.verdict}")
        for sentence in (*item.problems, *map(str, item.moved[:3])):
            print(f"  {sentence}")
    print(f"{len(items)} figures, tables, theories and papers' claims: {counts(items)}")
    if failed or problems:
        said = "; ".join([f"{len(failed)} do not agree with what was accepted", *problems])
        raise ReobserveError(f"{said}; see {output / 'index.html'}")


def _keep_samples(project: Path, results: Path, paper: str) -> None:
    """Keep the Monte Carlo samples of the build, if the paper has claims."""
    path = results / paper / "robustness.json"
    if path.exists():
        keep(project, paper, read_robustness(path, paper))


def _renew_references(reference: Path, results: Path, papers: Sequence[str]) -> list[str]:
    """Put the figures in place of the accepted ones; what is different, a line for each."""
    said = []
    for paper in papers:
        built = figures(results / paper)
        for name, path in built.items():
            accepted, title = reference / paper / path.name, f"{paper} {name}"
            try:
                old, new = map(pixels.read_pixels, (accepted, path))
                found = pixels.compare(old, new, title)
            except InputError as error:
                said.append(f"{title}: the figure is new ({error})")
            else:
                if found.place is None:
                    continue
                said.append(
                    f"{title}: RMS {found.rms:.3g} grey levels, "
                    f"least local similarity {found.similarity:.4f}"
                )
            accepted.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, accepted)
        for name, path in figures(reference / paper).items():
            if name not in built:
                path.unlink()
                said.append(f"{paper} {name}: removed, the figure is no longer built")
    return said

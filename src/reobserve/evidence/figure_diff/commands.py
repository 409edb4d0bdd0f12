"""The commands: compare what is built with what was accepted, and accept what is built."""

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
from reobserve.evidence.figure_diff import page, pixels, summary
from reobserve.evidence.figure_diff.built import drawings
from reobserve.evidence.figure_diff.comparison import compare_all
from reobserve.evidence.figure_diff.model import Diff, Origin
from reobserve.evidence.figure_diff.origin import origin_here, read_origin, write_origin
from reobserve.evidence.figure_diff.project_copy import build, copy_project
from reobserve.evidence.golden import claims as golden_claims
from reobserve.evidence.golden.commands import renew
from reobserve.evidence.golden.files import folder
from reobserve.evidence.golden.guard import check_may_renew, keep_reason
from reobserve.evidence.golden.kept import part_names, record_names
from reobserve.evidence.meanings import write_lists
from reobserve.ledger.config import known_papers, named_papers
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.files import write_text

_BUILD_LOG = "build.log"


def figdiff_command(
    project: Path, reference: Path, results: Path, output: Path, build: bool, cores: int
) -> None:
    """Compare, write page and summaries to ``output``; fail if anything does not agree.

    With ``build`` everything is built from nothing in a temporary folder, and ``results`` is not
    looked at.
    """
    if not build:
        _compare(project, reference, results, output, [])
        return
    with _built_copy(project, cores, output / _BUILD_LOG) as (copy, gaps):
        _compare(project, reference, copy / "results", output, gaps)


def accept_command(project: Path, paper: Sequence[str], reason: str, cores: int) -> None:
    """Renew reference figures, golden numbers and verdicts, and the table of the README.

    Of some papers, or of all. Refuses without a reason, in CI and on a dirty tree, and some papers
    alone where the figures of the others were made under something else. All is built first, so
    that a build that fails leaves what was accepted as it was.
    """
    check_may_renew(project, reason)
    known = known_papers(project)
    chosen = named_papers(known, paper)
    reference = project / "tests" / "reference"
    if paper:
        _check_same_origin(project, reference)
    with _built_copy(project, cores, project / "figdiff" / _BUILD_LOG, paper) as (copy, gaps):
        if gaps:
            raise ReobserveError(f"nothing is accepted: {gaps[0]}")
        moved = renew(project, chosen, cores)
        moved += golden_claims.renew(project, copy / "results", paper)
        _keep_draws(project, copy / "results", chosen)
        put_into(project / "README.md", copy / "results" / "verdicts.md", known if paper else ())
        write_lists(project)
        redrawn = _renew_references(reference, copy / "results", chosen)
        _drop_golden_of_no_figure(project, chosen)
    write_origin(reference, origin_here(project))
    print("\n".join([*moved, *redrawn]) if moved or redrawn else "nothing moved")
    keep_reason(project, reason, f"{len(moved)} numbers and {len(redrawn)} figures moved")


def _check_same_origin(project: Path, reference: Path) -> None:
    """Refuse where reference figures are of another origin: it is kept once for those of all."""
    for name, here, there in read_origin(reference).differing(origin_here(project)):
        raise ReobserveError(
            f"the reference figures were made under {name} {here or 'unknown'}, not "
            f"{there or 'unknown'}; accept all papers together"
        )


@contextmanager
def _built_copy(
    project: Path, cores: int, log: Path, papers: Sequence[str] = ()
) -> Iterator[tuple[Path, list[str]]]:
    """A copy of the project with everything built that can be; what failed, in a sentence."""
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        copy = Path(folder)
        copy_project(project, copy)
        what = ", ".join(papers) or "everything"
        print(f"building {what} from nothing in a temporary folder, some minutes", flush=True)
        whole = build(copy, project, cores, log, papers)
        yield copy, [] if whole else [f"the build failed in part; {log} has what it said"]


def _compare(project: Path, reference: Path, results: Path, output: Path, gaps: list[str]) -> None:
    for name, path in (("--reference", reference), ("--results", results)):
        if not path.is_dir():
            gaps = [*gaps, f"{name}: there is no folder {path}"]
    try:
        accepted = read_origin(reference)
    except InputError as error:
        accepted, gaps = Origin({}), [*gaps, str(error)]
    items = compare_all(project, reference, results)
    diff = Diff(items, accepted, origin_here(project), gaps)
    write_text(output / "summary.json", summary.to_json(diff))
    write_text(output / "summary.md", summary.to_markdown(diff))
    write_text(output / "index.html", page.render(diff, project / "workflow" / "report"))
    for item in diff.failed:
        print(f"{item.paper} {item.name}: {item.verdict}")
        for sentence in (item.why_missing, *item.gaps, *map(str, item.deviations[:3])):
            if sentence:
                print(f"  {sentence}")
    print(f"{len(items)} figures, tables, theories and papers' claims: {summary.counts(diff)}")
    if diff.failed or gaps:
        said = "; ".join([f"{len(diff.failed)} do not agree with what was accepted", *gaps])
        raise ReobserveError(f"{said}; see {output / 'index.html'}")


def _keep_draws(project: Path, results: Path, papers: Sequence[str]) -> None:
    """Keep the draws that the build made or took, of papers that have claims."""
    for paper in papers:
        path = results / paper / "robustness.json"
        if path.exists():
            keep(project, paper, read_robustness(path, paper))


def _renew_references(reference: Path, results: Path, papers: Sequence[str]) -> list[str]:
    """Put the drawings in place of the references; what is different about each, a line each."""
    said = []
    drawn = [path for paper in papers for path in drawings(results / paper)]
    built = {path.relative_to(results): path for path in drawn}
    for name, path in built.items():
        kept, title = reference / name, f"{name.parent} {name.stem}"
        try:
            found = pixels.compare(pixels.read_pixels(kept), pixels.read_pixels(path), title)
        except InputError as error:
            said.append(f"{title}: accepted anew ({error})")
        else:
            if found.place is None:
                continue
            said.append(
                f"{title}: RMS {found.rms:.3g} grey levels, "
                f"least local similarity {found.similarity:.4f}"
            )
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, kept)
    for path in sorted(reference.glob("*/*.png")):
        if path.relative_to(reference) not in built and path.parent.name in papers:
            path.unlink()
            said.append(f"{path.parent.name} {path.stem}: taken out, it is built no longer")
    return said


def _drop_golden_of_no_figure(project: Path, papers: Sequence[str]) -> None:
    """Remove the golden numbers of what the ledgers have no longer."""
    for paper in papers:
        tree, golden = Ledger.load(project, paper).tree, folder(project, paper)
        names = {*part_names(tree), *record_names(tree)}
        for path in golden.rglob("*.csv"):
            if path.relative_to(golden).as_posix().partition(".")[0] not in names:
                path.unlink()

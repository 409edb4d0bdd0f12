"""The commands: compare what is built with what was accepted, and accept what is built."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.claims.gallery import put_into
from reobserve.evidence.figure_diff import page, pixels, summary
from reobserve.evidence.figure_diff.comparison import compare_all
from reobserve.evidence.figure_diff.model import Diff, Origin
from reobserve.evidence.figure_diff.origin import origin_here, read_origin, write_origin
from reobserve.evidence.figure_diff.project_copy import build, copy_project
from reobserve.evidence.golden import claims as golden_claims
from reobserve.evidence.golden.commands import renew
from reobserve.evidence.golden.files import folder
from reobserve.evidence.golden.guard import check_may_renew, keep_reason
from reobserve.evidence.golden.kept import part_names
from reobserve.ledger.config import known_papers
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


def accept_command(project: Path, reason: str, cores: int) -> None:
    """Renew reference figures, golden numbers and verdicts, and the gallery of the README.

    Refuses without a reason, in CI and on a dirty tree. All is built first, so that a build that
    fails leaves what was accepted as it was.
    """
    check_may_renew(project, reason)
    reference = project / "tests" / "reference"
    with _built_copy(project, cores, project / "figdiff" / _BUILD_LOG) as (copy, gaps):
        if gaps:
            raise ReobserveError(f"nothing is accepted: {gaps[0]}")
        moved = renew(project, known_papers(project), cores)
        moved += golden_claims.renew(project, copy / "results")
        put_into(project / "README.md", copy / "results" / "verdicts.md")
        redrawn = _renew_references(reference, copy / "results")
        _drop_golden_of_no_figure(project)
    write_origin(reference, origin_here(project))
    print("\n".join([*moved, *redrawn]) if moved or redrawn else "nothing moved")
    keep_reason(project, reason, f"{len(moved)} numbers and {len(redrawn)} figures moved")


@contextmanager
def _built_copy(project: Path, cores: int, log: Path) -> Iterator[tuple[Path, list[str]]]:
    """A copy of the project with everything built that can be; what failed, in a sentence."""
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        copy = Path(folder)
        copy_project(project, copy)
        print("building everything from nothing in a temporary folder, some minutes", flush=True)
        whole = build(copy, cores, log)
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


def _renew_references(reference: Path, results: Path) -> list[str]:
    """Put the drawings in place of the references; what is different about each, a line each."""
    said = []
    built = {path.relative_to(results): path for path in sorted(results.glob("*/*.png"))}
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
        if path.relative_to(reference) not in built:
            path.unlink()
            said.append(f"{path.parent.name} {path.stem}: taken out, it is built no longer")
    return said


def _drop_golden_of_no_figure(project: Path) -> None:
    """Remove the golden numbers of what the ledgers have no longer."""
    for paper in known_papers(project):
        names = part_names(Ledger.load(project, paper).tree)
        for path in folder(project, paper).glob("*.csv"):
            if path.name.partition(".")[0] not in names:
                path.unlink()

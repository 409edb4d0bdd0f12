"""The commands `figdiff`, which compares a build with what was accepted, and `accept`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import InputError, ReobserveError
from reobserve.core.files import write_text
from reobserve_papers.claims.registry import claims_file
from reobserve_papers.claims.sample_command import sample_again
from reobserve_papers.claims.sample_table import keep, read_samples
from reobserve_papers.claims.verdict_table import put_into
from reobserve_papers.figure_diff import pixels
from reobserve_papers.figure_diff.build_comparison import Chosen, compare_all, figures
from reobserve_papers.figure_diff.folders import Tolerances, compare_folders, copy_results
from reobserve_papers.figure_diff.page import render, summary
from reobserve_papers.figure_diff.provenance_diff import differences
from reobserve_papers.golden import golden_bench, golden_claims
from reobserve_papers.golden.acceptance import renew
from reobserve_papers.golden.acceptance_rules import (
    add_reason,
    check_may_accept,
    check_reason,
    keep_reason,
)
from reobserve_papers.golden.comparison import number_of
from reobserve_papers.golden.number_files import write_parameters
from reobserve_papers.parameters.config import known_papers, known_tasks, named_papers
from reobserve_papers.parameters.names import shared_texts
from reobserve_papers.parameters.parameters import Parameters, default_parameters
from reobserve_papers.steps.freshness import can_tell, check_code

_SECONDS = 60.0  # CPU s of samples for each claim, when a change is accepted


def figdiff_command(
    project: Path, part: Sequence[str], cores: int, reference: Path, results: Path, output: Path,
    tolerances: Path | None,
) -> None:  # fmt: skip
    """Compare, write page and summary to ``output``, and fail if anything does not agree.

    Of some papers, or figures of papers, if ``part`` names them. What a build would make again is
    not up to date, and agrees with nothing. With ``cores`` they are built first. Folders without a
    paper are compared file by file.
    """
    check_code(project)
    of_papers = _of_papers(project, part, reference, results, tolerances)
    if of_papers and cores:
        parts = Chosen.read(project, part).parts if part else ()
        papers = [name for name in part if "/" not in name]
        _build(project, papers, cores, parts, keep_going=True)
    folders = (("--reference", reference), ("--results", results))
    problems = [f"{name}: there is no folder {path}" for name, path in folders if not path.is_dir()]
    if of_papers:
        items = compare_all(project, reference, results, part)
    else:
        items = compare_folders(reference, results, Tolerances.read(tolerances))
    failed = [item for item in items if item.verdict != "agrees"]
    page = output / "index.html"
    context = differences(project, {item.paper for item in failed}) if failed and of_papers else []
    if of_papers and not can_tell(project, results):
        context.append(
            "not checked: whether these are up to date, which only a build in `results` tells"
        )
    said = summary(items, problems, context)
    write_text(page, render(items, problems, shared_texts(project), context))
    write_text(output / "summary.md", said + "\n")
    print(said)
    if failed or problems:
        do = "does" if len(failed) == 1 else "do"
        raise ReobserveError(f"{len(failed)} {do} not agree with what was accepted; see {page}")


def _of_papers(
    project: Path, named: Sequence[str], reference: Path, results: Path, tolerances: Path | None
) -> bool:
    """True unless there are two folders without any paper of a project."""
    if not (project / "config" / "papers").is_dir():
        for name, path in (("--reference", reference), ("--results", results)):
            if not path.is_dir():
                problem = f"there is no folder {path}, nor config/papers, the papers of a project"
                raise InputError(name, problem)
        papers = False
    else:
        known = {*known_papers(project), "bench"}
        sides = [side for side in (reference, results) if side.is_dir()]
        papers = len(sides) < 2 or any(
            known & {side.resolve().name, *os.listdir(side)} for side in sides
        )
    if papers and tolerances is not None:
        raise InputError("--tolerances", "is for folders of other files; papers have their own")
    if named and not papers:
        raise InputError(named[0], "is for papers of a project, not for two folders")
    return papers


def accept_command(
    project: Path, paper: Sequence[str], reason: str, cores: int, reference: Path, results: Path,
    tolerances: Path | None,
) -> None:  # fmt: skip
    """Accept figures, golden numbers, verdicts, and the table of the README, of some or all papers.

    If no paper is named, results of the bench are accepted, too; of PAPER/FIGURE only its numbers
    and its drawing are, and no verdicts. Refuses without a reason, in CI and on a dirty tree. What
    is not up to date is built first; if that fails, what was accepted stays. Claims whose cached
    samples do not apply any more are sampled again, and keep their verdict if that decides nothing.
    """
    check_code(project)
    if not _of_papers(project, paper, reference, results, tolerances):
        check_reason(reason)
        items = compare_folders(reference, results, Tolerances.read(tolerances))
        for item in items:
            if item.problems and not item.missing:
                raise InputError("--results", f"nothing is accepted: {item.problems[0]}")
        moved = [f"{item.title}: {item.verdict}" for item in items if item.verdict != "agrees"]
        copy_results(reference, results)
        print("\n".join(moved) or "nothing moved")
        if moved:
            add_reason(reference / "REASONS.md", reason, f"{number_of(moved, 'file')} moved")
        return
    check_may_accept(project, reason)
    known, results, moved = known_papers(project), project / results, []
    references = project / reference
    parts = Chosen.read(project, paper).parts if paper else ()
    whole = [name for name in paper if "/" not in name]
    chosen = named_papers(known, whole) if whole or not paper else []
    _build(project, whole, cores, parts)
    if chosen and _sample_again(project, results, chosen):
        _build(project, whole, cores, parts)
    for owner, part in parts:
        tree = Parameters.load(project, owner).tree
        moved += renew(project, results / owner, tree, owner, cores, only=part)
    redrawn = [line for pair in parts for line in _renew_references(references, results, *pair)]
    for name in chosen:
        parameters = Parameters.load(project, name)
        moved += renew(project, results / name, parameters.tree, name, cores)
        write_parameters(project, parameters)
        _keep_samples(project, results, name)
    tasks = [] if paper else known_tasks(project)
    moved += [line for task in tasks for line in golden_bench.renew(project, results, task)]
    if chosen:
        moved += golden_claims.renew(project, results, whole)
        table = golden_claims.accepted_table(project, results)
        put_into(project / "README.md", table, known)
    for name in (*chosen, *(f"bench/{task}" for task in tasks)):
        redrawn += _renew_references(references, results, name)
    print("\n".join([*moved, *redrawn]) if moved or redrawn else "nothing moved")
    said = f"{number_of(moved, 'number')} and {number_of(redrawn, 'figure')} moved"
    keep_reason(project, reason, said)


def _sample_again(project: Path, results: Path, papers: Sequence[str]) -> bool:
    """Sample the claims whose cached samples do not apply any more: False if there are none."""
    built, golden = golden_claims.read_built(results), golden_claims.read_accepted(project)
    again = [
        sample_again(
            project,
            default_parameters(project, paper),
            {claim for claim, _ in golden_claims.lacking(golden, built, paper)},
            _SECONDS,
        )
        for paper in papers
        if claims_file(project, paper).is_file()
    ]
    return any(again)


def _build(
    project: Path, papers: Sequence[str], cores: int, parts: Sequence[tuple[str, str]] = (),
    *, keep_going: bool = False,
) -> None:  # fmt: skip
    """Bring results up to date: of these papers and parts, or of the bench and all papers."""
    options = ["--cores", str(cores), *["--keep-going"] * keep_going]
    asked_for = [["--config", f"papers=[{','.join(papers)}]"]] if papers else []
    if parts:
        asked_for.append([path for pair in parts for path in _files(project, *pair)])
    for asked in asked_for or [["bench"], []]:
        command = [sys.executable, "-m", "snakemake", *options, *asked]
        if subprocess.run(command, cwd=project, check=False).returncode and not keep_going:
            raise ReobserveError("nothing is accepted: the build failed")


def _files(project: Path, paper: str, part: str) -> list[str]:
    """The files of a figure, a table or the theory."""
    tree = Parameters.load(project, paper).tree
    if part in tree["figures"]:
        return [f"results/{paper}/{part}.metrics.csv", f"results/{paper}/{part}.png"]
    return [f"results/{paper}/{part}{'' if part in tree.get('tables', {}) else '.metrics'}.csv"]


def _keep_samples(project: Path, results: Path, paper: str) -> None:
    """Keep the Monte Carlo samples of the build, if the paper has claims."""
    path = results / paper / "robustness.json"
    if path.exists():
        keep(project, default_parameters(project, paper), read_samples(path, paper).claims)


def _renew_references(reference: Path, results: Path, paper: str, only: str = "") -> list[str]:
    """Put the figures in place of the accepted ones, and return what is different, a line each."""
    said = []
    built = figures(results / paper)
    for name, path in built.items():
        if only not in ("", name):
            continue
        accepted, title = reference / paper / path.name, f"{paper} {name}"
        try:
            old, new = map(pixels.read_pixels, (accepted, path))
            rms = pixels.rms_difference(old, new, title)
        except InputError as error:
            said.append(f"{title}: the figure is new ({error})")
        else:
            if rms == 0:
                continue
            said.append(f"{title}: RMS {rms:.3g} grey levels")
        accepted.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, accepted)
    for name, path in figures(reference / paper).items():
        if name not in built and not only:
            path.unlink()
            said.append(f"{paper} {name}: removed, the figure is no longer built")
    return said

"""Command `check`: it reads everything under ``config/``, in one process, and writes nothing."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from reobserve.core.documents import check_plain
from reobserve.core.errors import ReobserveError
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.parameters.config import known_papers, known_styles, named_papers
from reobserve_papers.parameters.names import DEFAULT_STYLE, style_sheet
from reobserve_papers.parameters.parameter_checks import check_parameters
from reobserve_papers.parameters.parameters import Parameters


def run(project: Path, paper: Sequence[str], overrides: dict[str, Any]) -> None:
    """Check all files, and construct what the parameters state.

    Parameters
    ----------
    project
        The folder with the folder ``config``.
    paper
        The papers to check; all if there are none, and then the tasks and the style sheets, too.
    overrides
        Overrides of each paper by its name.
    """
    check_plain(overrides, "config")
    known = known_papers(project)
    named_papers(known, [*overrides])
    problems: list[ReobserveError] = []

    @contextmanager
    def checked(said: str) -> Iterator[None]:
        try:
            yield
            print(said, end="", file=sys.stderr)
        except ReobserveError as error:
            problems.append(error)

    for name in named_papers(known, paper):
        with checked(f"{name}: parameters, claims, conventions and errata are sound\n"):
            parameters = Parameters.load(project, name, overrides.get(name))
            check_parameters(parameters)
            check_evidence(project, parameters)
    if not paper:
        for path in sorted((project / "config" / "bench").glob("*.yaml")):
            with checked(f"bench, {path.stem}: the task is sound\n"):
                PackagedTask.read(path)
        from reobserve_papers.plotting.style_sheet import read_sheet

        for style in known_styles(project):
            with checked(""):
                if style != DEFAULT_STYLE:
                    read_sheet(project / style_sheet(project, style))
    for problem in problems[:-1]:
        print(f"reobserve-papers: {problem}", file=sys.stderr)
    if problems:
        raise problems[-1]

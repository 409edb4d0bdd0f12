"""A report, gathered from what a build left in a project; what is missing becomes a gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.meanings import Meanings, meanings
from reobserve.evidence.report.assumptions import entries
from reobserve.evidence.report.drawings import drawing
from reobserve.evidence.report.environment import environment, package_versions
from reobserve.evidence.report.errata import read_errata, read_obstacles
from reobserve.evidence.report.jobs import Runs, stage_code
from reobserve.evidence.report.markup import first_sentence, to_html, without_title
from reobserve.evidence.report.model import (
    Claim,
    Figure,
    Gap,
    Paper,
    PaperTable,
    Picture,
    Report,
    Run,
    Table,
    Timing,
)
from reobserve.evidence.report.numbers import (
    MOST_ROWS,
    metrics_table,
    plain_table,
)
from reobserve.evidence.report.reading import Project, need
from reobserve.evidence.report.timings import timings
from reobserve.evidence.report.verdicts import paper_claims, read_claims
from reobserve.ledger.config import known_papers
from reobserve.ledger.ledger import Ledger
from reobserve.ledger.names import caption_template, stored_parameters

# What is drawn of the claims of a paper, and what each shows.
_PICTURES = {
    "specification": "Headline claims over all draws in order, their bounds, and the choices drawn",
    "sensitivity": "Which choices decide the claims that turn over",
}

# How the source of a figure begins that no paper has.
_BEYOND = "beyond the paper"


def gather(
    folder: Path,
    page: Path,
    papers: Sequence[str] | None = None,
    formats: Sequence[str] | None = None,
) -> Report:
    """Everything that a page at ``page`` says of the project in ``folder``.

    ``papers`` and the ``formats`` of their figures are those of `config/config.yaml` if not given.

    Raises
    ------
    InputError
        If `config/config.yaml` cannot be read, or a paper has no ledger, built or not.
    """
    project = Project(folder, page)
    path = "config/config.yaml"
    config = need(path, project.yaml(path), "formats")
    rows = read_claims(project)
    told, measured = [], []
    for name in papers or config.get("papers") or known_papers(folder):
        ledger, gaps = _ledger(project, name, config.get("seed", 0))
        claims, undrawn = paper_claims(project, name, rows)
        known = () if isinstance(claims, Gap) else claims
        parts = _Parts(project, ledger, formats or config["formats"], known, meanings(name))
        paper = parts.paper(claims, undrawn, gaps)
        told.append(paper)
        measured += _timings(project, paper)
    return Report(
        tuple(told),
        tuple(project.gaps.found),
        environment(folder),
        package_versions(),
        tuple(measured),
    )


def _ledger(project: Project, paper: str, seed: int) -> tuple[Ledger, tuple[Gap, ...]]:
    """The ledger as built, or else as it stands in config."""
    path = stored_parameters(paper)
    try:
        project.bytes(path)
        return Ledger.read(project.folder / path), ()
    except InputError as error:
        gap = project.gaps.add(paper, str(error))
        return Ledger.load(project.folder, paper, seed=seed), (gap,)


def _timings(project: Project, paper: Paper) -> list[Timing]:
    jobs = _all_jobs(paper.figures, paper.tables, (*paper.theory_jobs, *paper.claims_jobs))
    return timings(project, paper.name, jobs)


def _all_jobs(
    figures: tuple[Figure, ...], tables: tuple[PaperTable, ...], others: tuple[Run, ...]
) -> list[Run]:
    jobs = [job for figure in figures for job in figure.jobs]
    return [*jobs, *(job for table in tables for job in table.jobs), *others]


@dataclass(frozen=True)
class _Parts:
    """The parts of one paper."""

    project: Project
    ledger: Ledger
    formats: Sequence[str]
    claims: tuple[Claim, ...]
    meanings: Meanings

    def paper(
        self, claims: tuple[Claim, ...] | Gap, undrawn: Gap | None, gaps: tuple[Gap, ...]
    ) -> Paper:
        tree, name = self.ledger.tree, self.ledger.paper
        about = tree["about"]
        runs = Runs(self.project, self.ledger)
        obstacles = read_obstacles(self.project, name)
        figures = tuple(
            self._figure(figure, body, runs.behind("plot", figure))
            for figure, body in tree["figures"].items()
        )
        tables = tuple(
            self._table(table, body, runs.behind("table", table))
            for table, body in tree.get("tables", {}).items()
        )
        theory, theory_jobs = self._theory(runs)
        claims_jobs = () if isinstance(claims, Gap) else runs.claims()
        made = _all_jobs(figures, tables, (*theory_jobs, *claims_jobs))
        stages = dict.fromkeys(job.stage for job in made)
        shared, code = stage_code(name, list(stages))
        return Paper(
            name=name,
            title=about["title"],
            authors=tuple(about["authors"]),
            year=about.get("year"),
            doi=about.get("doi", ""),
            obstacles=obstacles,
            gaps=gaps,
            figures=figures,
            tables=tables,
            theory=theory,
            theory_jobs=theory_jobs,
            claims=claims,
            claims_jobs=claims_jobs,
            robustness=undrawn,
            pictures=() if isinstance(claims, Gap) else self._pictures(),
            errata=read_errata(self.project, name),
            entries=entries(self.ledger, self.claims),
            shared_code=shared,
            code=code,
        )

    def _path(self, name: str) -> str:
        return f"results/{self.ledger.paper}/{name}"

    def _figure(self, figure: str, body: Mapping[str, Any], jobs: tuple[Run, ...]) -> Figure:
        place = f"{self.ledger.paper}-{figure}"
        image, links, gaps = drawing(
            self.project, self._path(figure), self.formats, place, jobs[-1].log
        )
        caption, source = self._caption(self._path(f"{figure}.caption.rst"), body["title"], place)
        metrics = self._path(f"{figure}.metrics.csv")
        return Figure(
            name=figure,
            title=body["title"],
            source=source or body["source"],
            beyond=str(body["source"]).startswith(_BEYOND),
            image=image,
            caption=caption,
            summary="" if isinstance(caption, Gap) else first_sentence(caption),
            links=links,
            gaps=gaps,
            numbers=self._numbers(metrics, place, jobs[-2].log),
            numbers_link=self.project.link(metrics, "CSV"),
            jobs=jobs,
            decides=tuple(claim.name for claim in self.claims if figure in claim.figures),
        )

    def _pictures(self) -> tuple[Picture, ...]:
        paper = self.ledger.paper
        log = f"logs/{paper}/sensitivity.log"
        return tuple(
            Picture(
                name,
                title,
                *drawing(self.project, self._path(name), self.formats, f"{paper}-claims", log),
            )
            for name, title in _PICTURES.items()
        )

    def _table(self, table: str, body: Mapping[str, Any], jobs: tuple[Run, ...]) -> PaperTable:
        place = f"{self.ledger.paper}-{table}"
        path = self._path(f"{table}.csv")
        template = caption_template(self.project.folder, self.ledger.paper, table, "table")
        content: Table | Gap
        try:
            content = plain_table(self.project, path)
        except InputError as error:
            content = self.project.gaps.add(place, error)
        return PaperTable(
            name=table,
            title=body["title"],
            source=body["source"],
            content=content,
            caption=self._caption(template, body["title"], place)[0],
            link=self.project.link(path, "CSV"),
            jobs=jobs,
        )

    def _theory(self, runs: Runs) -> tuple[Table | Gap | None, tuple[Run, ...]]:
        if "theory" not in self.ledger.tree:
            return None, ()
        place = f"{self.ledger.paper}-theory"
        made = runs.behind("theory")
        path = self._path("theory.metrics.csv")
        return self._numbers(path, place, made[-1].log, most=None), made

    def _numbers(
        self, path: str, place: str, log: str, most: int | None = MOST_ROWS
    ) -> Table | Gap:
        try:
            return metrics_table(self.project, path, self.meanings, most)
        except InputError as error:
            reason = "" if self.project.exists(path) else self.project.reason(log)
            return self.project.gaps.add(place, f"{error}{reason}")

    def _caption(self, path: str, title: str, place: str) -> tuple[str | Gap, str]:
        try:
            return without_title(to_html(path, self.project.text(path)), title)
        except ReobserveError as error:
            return self.project.gaps.add(place, error), ""

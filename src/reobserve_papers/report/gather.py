"""Content of the report as values for its templates, read from the files of a build.

Whatever is missing or damaged becomes a `Gap` in its place, and the rest is complete.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.core.files import read_table, read_text
from reobserve.core.validation import parse
from reobserve_papers.claims.claims_table import HEADER, KINDS
from reobserve_papers.claims.entries import PaperFigure
from reobserve_papers.claims.errata import read_errata
from reobserve_papers.claims.registry import has_claims, read_claims
from reobserve_papers.claims.sample_table import read_samples
from reobserve_papers.claims.title import Title, read_alternatives
from reobserve_papers.claims.verdict_rules import BROKEN, count
from reobserve_papers.claims.verdict_table import sentence
from reobserve_papers.metrics.metrics import Metric, read_metrics
from reobserve_papers.parameters.config import known_papers, known_tasks
from reobserve_papers.parameters.names import caption_template, claims_path, stored_parameters
from reobserve_papers.parameters.parameter_file import Configuration
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.assumptions import AssumptionRow, entries
from reobserve_papers.report.embedded_files import csv_table, image, metrics_table
from reobserve_papers.report.environment import environment, package_versions
from reobserve_papers.report.markup import first_sentence, to_html, without_title
from reobserve_papers.report.paper_figures import FigureRow, figure_rows
from reobserve_papers.report.report_gaps import Gap, ReportGaps
from reobserve_papers.report.reported_claims import ReportedClaim, claim_of_row
from reobserve_papers.steps.chain import log
from reobserve_papers.steps.freshness import FOR_INPUTS, can_tell, out_of_date
from reobserve_papers.steps.glossary import glossary

CLAIMS_FILE = "results/claims.csv"

# Figures of a task of the bench; not all tasks have the last one.
_OF_A_TASK = ("heatmap", "levels", "evaluations", "detection")
_TASK_TABLE = "results/bench/{}/table.csv"

# What is drawn of the claims of a paper, and what each shows.
_PLOTS = {
    "alternatives": "Verdicts on main claims and the title over all alternatives, each alone",
    "sensitivity": "Which choices separate the outcomes of claims",
}

# How the source of a figure begins that no paper has.
_BEYOND = "beyond the paper"

# Rows of a figure's table; sweeps of studies have hundreds, which only files serve well.
MAX_ROWS = 40

_STALE = "not up to date, a build would make it again"

# How the command line begins the sentence that says why it failed.
_SAID = "reobserve-papers: "

Data = dict[str, Any]


def gather(
    folder: Path,
    page: Path,
    papers: Sequence[str] | None = None,
    formats: Sequence[str] | None = None,
    bench: Sequence[str] | None = None,
    *,
    fresh: bool = True,
) -> Data:
    """Read everything that a page at ``page`` says of the project in ``folder``.

    ``papers``, the ``formats`` of their figures and the tasks of the ``bench`` are those of
    `config/config.yaml` if not given. A task without a table was not built, and is left out.
    Unless all is known to be ``fresh``, what a build would make again is marked.
    """
    path = folder / "config/config.yaml"
    config = parse(Configuration, read_yaml(path), str(path))
    gaps = ReportGaps(folder)
    rows = gaps.attempt(
        "summary", read_table, folder / CLAIMS_FILE, HEADER, KINDS, ("paper", "claim")
    )
    names = papers or config.papers or known_papers(folder)
    tasks = bench if bench is not None else config.bench
    if tasks is None:
        tasks = [] if papers or config.papers else known_tasks(folder)
    built = [name for name in tasks if (folder / _TASK_TABLE.format(name)).is_file()]
    stale: Any = {}
    if not fresh and can_tell(folder, folder / "results"):
        asked = gaps.attempt("summary", lambda: out_of_date(folder, names, bench=False))
        stale = {} if isinstance(asked, Gap) else asked
    if (why := stale.get(folder / CLAIMS_FILE, "")) and why not in FOR_INPUTS:
        gaps.add("summary", f"{CLAIMS_FILE}: {_STALE} ({why})")
    build = _Build(folder, page, formats or config.formats, gaps, config.seed, stale)
    return {
        "papers": [build.paper(name, rows) for name in names],
        "bench": [build.task(name) for name in built],
        "gaps": gaps.entries,
        "environment": environment(folder),
        "versions": package_versions(),
    }


def cited(about: Mapping[str, Any]) -> str:
    """Return authors and year of a paper as one cites them."""
    names = [author.split()[-1] for author in about["authors"]]
    if len(names) > 3:
        text = f"{names[0]} et al."
    else:
        text = " & ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
    return f"{text} ({about['year']})" if about.get("year") else text


@dataclass(frozen=True)
class _Build:
    """Files that a build left in a project, and the gaps found so far."""

    folder: Path
    page: Path
    formats: Sequence[str]
    gaps: ReportGaps
    seed: int
    stale: Mapping[Path, str] = field(default_factory=dict)

    def paper(self, name: str, rows: list[dict[str, str]] | Gap) -> Data:
        """Everything about one paper."""
        stored = self.gaps.attempt(name, Parameters.read, self.folder / stored_parameters(name))
        parameters = stored
        if isinstance(parameters, Gap):
            parameters = Parameters.load(self.folder, name, seed=self.seed)
        tree = parameters.tree
        own = rows if isinstance(rows, Gap) else [row for row in rows if row["paper"] == name]
        if not own and has_claims(self.folder, name):
            own = self.gaps.add(f"{name}-claims", f"{CLAIMS_FILE}: has no claim of {name}")
        scored = self._scored(name, own)
        claims = [] if isinstance(own, Gap) else scored["claims"]
        page = _Paper(self, parameters, claims)
        theory = f"results/{name}/theory.metrics.csv"
        assumed = entries(parameters, claims)
        registry = self.gaps.attempt(name, read_claims, self.folder, name)
        if claims and not has_claims(self.folder, name):
            registry = self.gaps.add(name, f"{claims_path(name)}: has no claims, {CLAIMS_FILE} has")
        statuses = [entry.status for entry in assumed for _ in entry.keys]
        return {
            "name": name,
            **{key: tree["about"][key] for key in ("title", "authors")},
            **{key: tree["about"].get(key, "") for key in ("year", "doi")},
            "short": cited(tree["about"]),
            "gaps": [stored] if isinstance(stored, Gap) else [],
            "limitations": registry if isinstance(registry, Gap) else registry.limitations,
            "result": sentence(scored["replication"], registry.result)
            if isinstance(scored["replication"], Title) and not isinstance(registry, Gap)
            else "",
            "rows": registry if isinstance(registry, Gap) else page.rows(registry.figures, assumed),
            "corrections": {}
            if isinstance(registry, Gap)
            else {claim: body.errata for claim, body in registry.claims.items() if body.errata},
            "figures": [page.figure(*figure) for figure in tree["figures"].items()],
            "tables": [page.table(*table) for table in tree.get("tables", {}).items()],
            "theory": page.numbers(theory, "theory") if "theory" in tree else None,
            **scored,
            "verdicts": {claim.name: claim.verdict for claim in claims},
            "plots": [page.plot(*plot) for plot in _PLOTS.items()] if claims else [],
            "errata": self.gaps.attempt(f"{name}-errata", read_errata, self.folder, name),
            "entries": assumed,
            "known_keys": [key for entry in assumed for key in entry.keys],
            "statuses": {key: statuses.count(key) for key in ("assumed", "overridden", "stated")},
        }

    def _scored(self, paper: str, rows: list[dict[str, str]] | Gap) -> Data:
        """The claims of a paper, what they add up to, and the gap where robustness is missing."""
        if isinstance(rows, Gap) or not rows:
            return {
                "claims": rows, "undrawn": None, "counts": {}, "replication": None, "readings": []
            }  # fmt: skip
        path = self.folder / f"results/{paper}/robustness.json"
        drawn = self.gaps.attempt(f"{paper}-claims", read_samples, path, paper)
        known = {} if isinstance(drawn, Gap) else drawn.claims
        claims = []
        for row in rows:
            problem = None
            if row["verdict"] == BROKEN:
                sentence = row["problem"] or f"{paper}.{row['claim']}: cannot be decided"
                problem = self.gaps.add(f"{paper}-claim-{row['claim']}", sentence)
            cached = known[row["claim"]].cached if row["claim"] in known else 0
            claims.append(claim_of_row(row, cached, problem))
        return {
            "claims": claims,
            "undrawn": drawn if isinstance(drawn, Gap) else None,
            "counts": count(rows)[paper],
            **self._replication(paper),
        }

    def _replication(self, paper: str) -> Data:
        """The title of a paper's replication, and the readings that change verdicts."""
        path = f"results/{paper}/alternatives.csv"
        found = self.read(
            f"{paper}-title", path, f"logs/{paper}/alternatives.log", read_alternatives
        )
        title, rows = (found, []) if isinstance(found, Gap) else found
        changing = [row for row in rows if row["claim"] and row["other"] != row["verdict"]]
        return {"replication": title, "readings": changing}

    def read(self, place: str, path: str, logged: str, read: Any, *arguments: Any) -> Any:
        """Read a file that a job with this log should have made, or add a gap."""
        if not (self.folder / path).is_file():
            return self.gaps.add(place, f"{path}: not built{self.reason(logged)}")
        return self.gaps.attempt(place, read, self.folder / path, *arguments)

    def reason(self, logged: str) -> str:
        """The reason that a job's log gives for its failure, empty if it gives none."""
        try:
            last = read_text(self.folder / logged).rstrip().rpartition("\n")[2]
        except InputError:
            return ""
        return f"; {logged} says: {last.removeprefix(_SAID)}" if last.startswith(_SAID) else ""

    def link(self, path: str) -> Data:
        """A link from the page to a file."""
        target = os.path.relpath(self.folder.resolve() / path, self.page.resolve().parent)
        return {"label": path.rpartition(".")[2].upper(), "target": Path(target).as_posix()}

    def task(self, name: str) -> Data:
        """A task of the bench: its figures, and a link to its table."""
        texts, logged = self.folder / "workflow/report/bench", f"logs/bench/{name}/figures.log"
        settings = self.gaps.attempt(
            f"bench-{name}", read_yaml, self.folder / f"config/bench/{name}.yaml"
        )
        figures = []
        for figure in _OF_A_TASK:
            base, place = f"results/bench/{name}/{figure}", f"bench-{name}-{figure}"
            if figure in _OF_A_TASK[:3] or list((self.folder / base).parent.glob(f"{figure}.*")):
                caption = self.gaps.attempt(place, read_text, texts / f"{figure}.rst")
                figures.append(
                    {"name": figure, "caption": caption, **self.drawing(base, place, logged)}
                )
        title = name if isinstance(settings, Gap) else settings.get("title", name)
        link = self.link(_TASK_TABLE.format(name))
        return {"name": name, "title": title, "figures": figures, "link": link}

    def drawing(self, base: str, place: str, logged: str) -> Data:
        """The image of a figure, links to its files, and what is missing of either.

        Vectors are preferred, then PNG; a PDF can only be linked.
        """
        shown: Any = None
        gaps = []
        files = [f"{base}.{kind}" for kind in self.formats]
        missing = [path for path in files if not (self.folder / path).is_file()]
        if missing:
            sentence = f"{', '.join(missing)}: not built{self.reason(logged)}"
            gaps.append(self.gaps.add(place, sentence))
        there = [path for path in files if path not in missing]
        old = [path for path in there if self.folder / path in self.stale]
        if old:
            why = self.stale[self.folder / old[0]]
            gaps.append(self.gaps.add(place, f"{', '.join(old)}: {_STALE} ({why})"))
        for path in sorted(there, key=lambda path: path.endswith(".png")):
            if shown is None and path.endswith((".svg", ".png")):
                picture = self.gaps.attempt(place, image, self.folder / path)
                if isinstance(picture, Gap):
                    gaps.append(picture)
                else:
                    shown = picture
        return {"image": shown, "links": [*map(self.link, there)], "gaps": gaps}


@dataclass(frozen=True)
class _Paper:
    """The parts of one paper."""

    build: _Build
    parameters: Parameters
    claims: Sequence[ReportedClaim]

    def _place(self, name: str) -> str:
        return f"{self.parameters.paper}-{name}"

    def _log(self, *step: str) -> str:
        return log(self.parameters.paper, *step)

    def figure(self, name: str, body: Mapping[str, Any]) -> Data:
        """A figure, what it shows and what it decides."""
        base, logged = f"results/{self.parameters.paper}/{name}", self._log("plot", name)
        caption, source = self._caption(f"{base}.caption.rst", body["title"], name, logged)
        summary = "" if isinstance(caption, Gap) else first_sentence(caption)
        return {
            "name": name,
            "title": body["title"],
            "source": source or body["source"],
            "beyond": str(body["source"]).startswith(_BEYOND),
            "caption": caption,
            # What is read to those who do not see it.
            "alternative": f"{body['title'].rstrip('.')}. {summary}".strip(),
            "numbers": self.numbers(f"{base}.metrics.csv", "metrics", name),
            "decides": [claim.name for claim in self.claims if name in claim.figures],
            **self.build.drawing(base, self._place(name), logged),
        }

    def rows(
        self, figures: Mapping[str, PaperFigure], rows: Sequence[AssumptionRow]
    ) -> list[FigureRow] | Gap:
        """The figures of the paper, one by one."""

        def metrics(name: str) -> list[Metric] | None:
            path = self.build.folder / f"results/{self.parameters.paper}/{name}.metrics.csv"
            try:
                return read_metrics(path)
            except InputError:
                return None  # a gap where the numbers of that figure are

        place = self._place("figures")
        return self.build.gaps.attempt(place, figure_rows, figures, self.parameters, rows, metrics)

    def plot(self, name: str, title: str) -> Data:
        """A plot of the samples that decided the claims."""
        base, logged = f"results/{self.parameters.paper}/{name}", self._log("sensitivity")
        drawing = self.build.drawing(base, self._place("claims"), logged)
        return {"name": name, "title": title, **drawing}

    def table(self, name: str, body: Mapping[str, Any]) -> Data:
        """A table of the paper, computed here."""
        path, logged = f"results/{self.parameters.paper}/{name}.csv", self._log("table", name)
        template = caption_template(self.build.folder, self.parameters.paper, name, "table")
        return {
            "name": name,
            "title": body["title"],
            "source": body["source"],
            "content": self.build.read(self._place(name), path, logged, csv_table),
            "caption": self._caption(template, body["title"], name, logged)[0],
            "link": self.build.link(path),
        }

    def numbers(self, path: str, *step: str) -> Data | Gap:
        """The metrics of a figure, or all of the theory, and a link to their file."""
        most = MAX_ROWS if step[1:] else None
        known = glossary(self.parameters.package)
        place, logged = self._place(step[-1]), self._log(*step)
        rows: Data | Gap = self.build.read(place, path, logged, metrics_table, known, most)
        return rows if isinstance(rows, Gap) else rows | {"link": self.build.link(path)}

    def _caption(self, path: str, title: str, name: str, logged: str) -> tuple[str | Gap, str]:
        """The caption without the title, and the source that it names."""

        def read(file: Path) -> tuple[str, str]:
            return without_title(to_html(path, read_text(file)), title)

        caption: tuple[str, str] | Gap = self.build.read(self._place(name), path, logged, read)
        return (caption, "") if isinstance(caption, Gap) else caption

"""The graph of jobs: which runs of which stages stand behind what is built.

A job is one run of a stage of `reobserve.ledger.stages`. Snakemake's rules, the evaluation in one
process, the report and the figure diff all ask a `Graph` for the jobs of their ledgers.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from reobserve.ledger.ledger import Ledger
from reobserve.ledger.stages import AGELESS, DEFAULT_STYLE, SECTIONS, STAGES, kept_file, style_sheet
from reobserve.pipeline.chunks import chunks_of, earlier
from reobserve.timeseries.signals import sample_files

# Roles in which a job reads what all jobs of a stage make.
_ALL_OF = {"designs": "design", "studies": "study"}


@dataclass(frozen=True, eq=False)
class Job:
    """One run of a stage; ``names`` are those that the braces in the stage's paths stand for."""

    graph: Graph = field(repr=False)
    stage: str
    names: Mapping[str, str]

    @property
    def ledger(self) -> Ledger:
        """The ledger of its paper; `KeyError` where it is of all papers."""
        return self.graph.ledgers[self.names["paper"]]

    @property
    def about(self) -> tuple[str, ...]:
        """The names of what it is about."""
        return tuple(self.names[word] for word in STAGES[self.stage].about)

    @property
    def name(self) -> str:
        """The stage and what the job is about, as ``observe constant sampled``."""
        return " ".join((self.stage, *self.about))

    @property
    def body(self) -> Mapping[str, Any]:
        """The branch of the ledger that it is about, with entries as they stand."""
        *_, word = STAGES[self.stage].about
        body: Mapping[str, Any] = self.ledger.tree[SECTIONS[word]][self.names[word]]
        return body

    @cached_property
    def settings(self) -> dict[str, Any]:
        """What it depends on of the ledger; see `Ledger.settings`."""
        return self.ledger.settings(self.stage, *self.about)

    @cached_property
    def reads(self) -> dict[str, tuple[Job | str, ...]]:
        """By role: the jobs whose files it reads, or files that no job makes."""
        return {role: tuple(self.graph.read(self, role)) for role in STAGES[self.stage].reads}

    @property
    def needs(self) -> list[Job]:
        """The jobs whose files it reads."""
        return [one for read in self.reads.values() for one in read if isinstance(one, Job)]

    @property
    def files(self) -> dict[str, list[str]]:
        """By role: the paths of all that it reads."""
        return {
            role: [
                path for one in read for path in (one.outputs if isinstance(one, Job) else [one])
            ]
            for role, read in self.reads.items()
        }

    @property
    def inputs(self) -> dict[str, list[str]]:
        """The same of those files alone whose age counts."""
        ageless = (*AGELESS, "style")
        return {role: paths for role, paths in self.files.items() if role not in ageless}

    @property
    def outputs(self) -> list[str]:
        """The files that it writes; of a figure its drawings, then its caption."""
        return [path.format_map(self.names) for path in self.graph.makes(self.stage)]

    @property
    def log(self) -> str:
        """The file that it writes its command to, and what goes wrong."""
        return STAGES[self.stage].log.format_map(self.names)

    @property
    def command(self) -> str:
        """What is asked of `reobserve`, quoted for a shell."""
        outputs, graph = self.outputs, self.graph
        words: dict[str, Sequence[object]] = {
            **{word: [name] for word, name in self.names.items()},
            **self.files,
            "output": outputs, "drawings": outputs[:-1], "caption": outputs[-1:],
            "notes": [] if graph.notes else ["--no-notes"],
            "draws": [graph.draws], "flips": [] if graph.flips else ["--no-flips"],
            "papers": graph.papers, "claimed": graph.claimed, "formats": graph.formats,
        }  # fmt: skip
        usage = re.sub(
            r"\[(.*?\{(\w+)\})\] ",
            lambda found: f"{found[1]} " if words[found[2]] else "",
            STAGES[self.stage].command,
        )
        quoted = {word: shlex.join(map(str, listed)) for word, listed in words.items()}
        return usage.format_map(quoted)


@dataclass(frozen=True, eq=False)
class Graph:
    """The jobs of some ledgers, by paper.

    ``papers`` are those that are built (without any: all), in these ``formats``, their claims
    decided over ``draws``, made in ``chunks`` if in more than one, with or without a look for
    ``flips``; figures are drawn in a ``style``, with or without ``notes`` in them. ``project`` is
    the folder that paths are relative to: what is there of captions, styles and claims decides who
    reads what.
    """

    ledgers: Mapping[str, Ledger]
    papers: Sequence[str] = ()
    formats: Sequence[str] = ("svg",)
    draws: int = 0
    flips: bool = True
    kept: bool = True
    chunks: int = 1
    style: str = DEFAULT_STYLE
    notes: bool = True
    project: Path = Path()
    _jobs: dict[tuple[str, frozenset[tuple[str, str]]], Job] = field(
        default_factory=dict, init=False, repr=False
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "papers", tuple(self.papers) or tuple(self.ledgers))

    def job(self, stage: str, **names: str) -> Job:
        """The job of a stage for these names, as ``job("plant", paper="ilo", scenario="a")``."""
        key = (stage, frozenset(names.items()))
        if key not in self._jobs:
            self._jobs[key] = Job(self, stage, names)
        return self._jobs[key]

    def makes(self, stage: str) -> list[str]:
        """The paths that jobs of a stage write, with names in braces but for the formats."""
        return [
            path.replace("{format}", kind)
            for path in STAGES[stage].makes
            for kind in (self.drawn if "{format}" in path else [""])
        ]

    @property
    def drawn(self) -> list[str]:
        """The formats as they are drawn, first that which reports show: vectors where there are."""
        shown = next((kind for kind in ("svg", "png", "pdf") if kind in self.formats), "")
        return sorted(self.formats, key=lambda kind: kind != shown)

    @property
    def claimed(self) -> list[str]:
        """The papers that have a registry of claims; one of the user's own need not."""
        return [
            one
            for one in self.papers
            if (self.project / AGELESS["registry"].format(paper=one)).is_file()
        ]

    def all_of(self, stage: str, paper: str) -> list[Job]:
        """The jobs of a stage that is about one thing, in the order of the ledger."""
        (word,) = STAGES[stage].about
        bodies = self.ledgers[paper].tree.get(SECTIONS[word], {})
        return [self.job(stage, paper=paper, **{word: name}) for name in bodies]

    def numbers(self, paper: str) -> list[Job]:
        """The jobs whose numbers claims may name: of all figures and of the theory."""
        theory = [self.job("theory", paper=paper)] if "theory" in self.ledgers[paper].tree else []
        return [*self.all_of("metrics", paper), *theory]

    def products(self) -> list[Job]:
        """The jobs that make figures, their numbers, and tables."""
        stages = ("plot", "metrics", "table")
        return [job for one in self.papers for stage in stages for job in self.all_of(stage, one)]

    def in_latex(self) -> dict[str, str]:
        """The captions and tables of what is built, by where they are in LaTeX."""
        jobs = [*self.products(), *(job for one in self.papers for job in self.numbers(one))]
        paths = [path for job in jobs for path in job.outputs if path.endswith((".csv", ".rst"))]
        return {str(Path(path).with_suffix(".tex")): path for path in paths}

    def behind(self, *jobs: Job) -> list[Job]:
        """These jobs and all that they need, those of one stage together, the first ones first."""
        found: dict[int, Job] = {}

        def visit(job: Job) -> None:
            if id(job) not in found:
                for need in job.needs:
                    visit(need)
                found[id(job)] = job

        for job in jobs:
            visit(job)
        order = list(STAGES)
        return sorted(found.values(), key=lambda job: order.index(job.stage))

    def read(self, job: Job, role: str) -> Iterable[Job | str]:
        """What a job reads in a role: jobs that make it, or files."""
        if "paper" not in job.names:
            return self._read_of_all(role)
        return self._read_of_paper(job, role, job.names["paper"])

    def _read_of_all(self, role: str) -> Iterable[Job | str]:
        papers = self.claimed
        if role in AGELESS:
            return (AGELESS[role].format(paper=paper) for paper in papers)
        if role == "numbers":
            return [job for paper in papers for job in self.numbers(paper)]
        if role in ("robustness", "sensitivity"):
            return [self.job(role, paper=paper) for paper in papers]
        if role == "products":
            return self.products()
        return [self.job(role)]

    def _read_of_paper(self, job: Job, role: str, paper: str) -> Iterator[Job | str]:
        if role in AGELESS:
            yield AGELESS[role].format(paper=paper)
        elif role == "plant":
            scenario = job.names.get("scenario") or job.body["scenario"]
            yield self.job("plant", paper=paper, scenario=scenario)
        elif role == "estimates":
            for one in job.body["observers"]:
                names = {"scenario": job.body["scenario"], "observer": one}
                yield self.job("observe", paper=paper, **names)
        elif role in _ALL_OF:
            yield from self.all_of(_ALL_OF[role], paper)
        elif role in ("design", "study"):
            if role in job.body:
                yield self.job(role, paper=paper, **{role: job.body[role]})
        elif role == "metrics":
            yield self.job("metrics", paper=paper, figure=job.names["figure"])
        elif role == "robustness":
            yield self.job(role, paper=paper)
        elif role == "chunks":
            chunks = self._chunks_for(job)
            yield from (self.job("draw", paper=paper, chunk=one) for one in chunks)
        else:
            yield from self._read_of_project(job, role, paper)

    def _chunks_for(self, job: Job) -> Iterable[str]:
        """Of draws: those before a chunk, or all for who gathers them."""
        if "chunk" in job.names:
            return earlier(job.names["chunk"])
        return chunks_of(self.draws, self.chunks) if self.chunks > 1 else ()

    def _read_of_project(self, job: Job, role: str, paper: str) -> Iterator[str]:
        """Files that no job makes."""
        if role == "signals":  # samples of the user's own
            values = {**job.ledger.section("plant"), **job.ledger.section("scenarios", *job.about)}
            yield from (file for value in values.values() for file in sample_files(value))
        elif role == "files":  # that entries name, such as what a search has found
            entries = [entry for entry in job.body.values() if isinstance(entry, Mapping)]
            yield from (str(entry["value"]) for entry in entries if entry["unit"] == "file")
        elif role == "kept":  # draws of claims, if there are any
            path = kept_file(paper)
            if self.kept and (self.project / path).exists():
                yield path
        elif role == "style":  # the default may have no sheet: it is the look of the house
            path = style_sheet(self.style)
            if (self.project / path).is_file():
                yield path
        elif role == "template":
            yield self.caption(paper, job.names["figure"], "figure")
        elif role == "partials":  # what the captions of a paper share
            shared = (self.project / "workflow" / "report" / paper).glob("_*.rst")
            yield from sorted(path.relative_to(self.project).as_posix() for path in shared)

    def caption(self, paper: str, name: str, general: str) -> str:
        """The template of a caption: the figure's or table's own, or the ``general`` one."""
        own = f"workflow/report/{paper}/{name}.rst"
        return own if (self.project / own).is_file() else f"workflow/report/{general}.rst"


def moved(path: str, results: Path) -> Path:
    """Where a result of a job is if ``results`` is the folder of all results."""
    return results.joinpath(*Path(path).parts[1:])

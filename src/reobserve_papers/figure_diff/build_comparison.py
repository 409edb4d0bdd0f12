"""Everything that was built or accepted, compared: images, golden numbers and verdicts."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError, ReobserveError, nearest
from reobserve_papers.figure_diff import pixels
from reobserve_papers.golden import golden_bench, golden_claims
from reobserve_papers.golden.comparison import Moved, compare_built, number_of
from reobserve_papers.golden.number_files import golden_files
from reobserve_papers.golden.values import part_names
from reobserve_papers.parameters.config import known_papers, known_tasks, named_papers
from reobserve_papers.parameters.names import stored_parameters
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.freshness import FOR_INPUTS, can_tell, out_of_date

# Plots of Monte Carlo samples, whose verdicts are compared.
_OF_SAMPLES = ("alternatives", "sensitivity")

# Results of one paper, from which the table of the claims of all papers is put together.
_OF_CLAIMS = ("robustness.json", "alternatives.csv")


@dataclass
class Item:
    """A figure, a table, the theory or the claims of a paper, and what is different about it.

    ``reference`` and ``new`` are the images of a figure, None where there is none, ``rms`` is the
    difference of their panels in grey levels, and ``note_rms`` that of what is printed below.
    ``problems`` are sentences on what is missing or cannot be compared. ``stale`` says why a build
    would make it again, if it would. ``lacking`` are claims that samples do not decide any more.
    ``allowed`` is the tolerance of the images. ``missing`` says that one of two files is.
    """

    paper: str
    name: str
    reference: Path | None = None
    new: Path | None = None
    rms: float | None = None
    note_rms: float = 0.0
    moved: list[Moved] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    stale: str = ""
    lacking: Sequence[str] = ()
    allowed: float = pixels.TOLERANCE
    missing: bool = False

    @property
    def title(self) -> str:
        """The paper and the name, or the name of a file."""
        return f"{self.paper} {self.name}".strip()

    @property
    def verdict(self) -> str:
        """The verdict in a few words, the gravest first."""
        if self.problems:
            return "not compared"
        if self.stale:
            return "not up to date"
        if self.moved or self.redrawn:
            return "moved"
        return "lacks samples" if self.lacking else "agrees"

    @property
    def gravity(self) -> float:
        """The farthest change in tolerances, infinite for what cannot be compared."""
        if self.verdict == "agrees":
            return -1.0
        if self.problems:
            return math.inf
        drawn = self.rms / (self.allowed or 1e-9) if self.rms and self.redrawn else 0.0
        return max((move.excess for move in self.moved), default=drawn)

    @property
    def redrawn(self) -> bool:
        """True if the images differ by more than the tolerance."""
        return not max(self.rms or 0.0, self.note_rms) <= self.allowed

    @property
    def lack(self) -> str:
        """Sentence on the claims that must be sampled again, empty if there are none."""
        if not self.lacking:
            return ""
        claims = f"{number_of(self.lacking, 'claim')} lack{'s' * (len(self.lacking) == 1)}"
        return f"{claims} samples: `make samples PAPER={self.paper}` ({', '.join(self.lacking)})"

    @contextmanager
    def problem_noted(self) -> Iterator[None]:
        """Note an error as a problem, so that the rest is compared all the same."""
        try:
            yield
        except ReobserveError as error:
            self.problems.append(str(error))


def figures(folder: Path) -> dict[str, Path]:
    """The images in a folder, by figure."""
    paths = sorted(folder.glob("*.png"))
    return {path.stem: path for path in paths if path.stem not in _OF_SAMPLES}


@dataclass(frozen=True)
class Chosen:
    """Parts to compare: papers, or single figures, tables and theories of them, and tasks."""

    papers: tuple[str, ...]
    parts: tuple[tuple[str, str], ...] = ()
    tasks: tuple[str, ...] = ()

    @classmethod
    def read(cls, project: Path, named: Sequence[str]) -> Chosen:
        """Parts that are named, PAPER or PAPER/FIGURE, or all that the configuration builds."""
        if not named:
            listed = read_yaml(project / "config" / "config.yaml").get("papers", [])
            tasks = [] if listed else known_tasks(project)
            return cls(tuple(listed or known_papers(project)), tasks=tuple(tasks))
        split = [name.partition("/") for name in named]
        papers = named_papers(known_papers(project), [paper for paper, _, _ in split])
        parts = [(paper, part) for paper, slash, part in split if slash]
        for paper, part in parts:
            known = part_names(Parameters.load(project, paper).tree)
            if part not in known:
                raise InputError(paper, f"there is no {part!r}{nearest(part, known)}")
        whole = {paper for paper, slash, _ in split if not slash}
        return cls(tuple(papers), tuple(pair for pair in parts if pair[0] not in whole))

    def has(self, paper: str, part: str) -> bool:
        """True if that part of a paper was asked for."""
        asked = [name for owner, name in self.parts if owner == paper]
        return not asked or part in asked


def compare_all(
    project: Path, reference: Path, results: Path, named: Sequence[str] = ()
) -> list[Item]:
    """An item for each figure, table and theory that is ``named``, and for the claims of papers.

    If nothing is, those of all papers to build, and each task of the bench.
    """
    chosen = Chosen.read(project, named)
    items = [
        item
        for paper in chosen.papers
        for item in _compare_paper(project, reference / paper, results / paper, paper)
        if chosen.has(paper, item.name)
    ]
    whole = [paper for paper in chosen.papers if chosen.has(paper, "claims")]
    items += _compare_claims(project, results, whole) if whole else []
    for task in chosen.tasks:
        items += compare_task(project, reference, results, task)
    if can_tell(project, results):
        stale = out_of_date(project, chosen.papers, bench=bool(chosen.tasks))
        for item in items:
            reasons = (why for path, why in stale.items() if _makes(path, why, item))
            item.stale = next(reasons, "")
    return sorted(items, key=lambda item: -item.gravity)


def _makes(path: Path, why: str, item: Item) -> bool:
    """True if an item is compared by a file that would be made again.

    Claims are decided by numbers and by samples; that these were cached again changes nothing.
    """
    if item.name == "claims":
        decisive = path.name in _OF_CLAIMS and why not in FOR_INPUTS
        return path.parts[-2] == item.paper and (decisive or path.name.endswith(".metrics.csv"))
    if item.paper == "bench":
        task, _, figure = item.name.partition("_")
        return path.parts[-3:-1] == ("bench", task) and path.stem == (figure or "table")
    return path.parts[-2] == item.paper and path.name.partition(".")[0] == item.name


def _compare_paper(project: Path, reference: Path, built: Path, paper: str) -> Iterator[Item]:
    tree: Mapping[str, Any] = {"figures": {}}
    no_parameters = ""
    try:
        tree = Parameters.read(built / Path(stored_parameters(paper)).name).tree
    except InputError as error:
        no_parameters = str(error)
    accepted, drawn, golden = figures(reference), figures(built), golden_files(project, paper)
    for name in sorted({*accepted, *drawn, *golden, *part_names(tree)}):
        item = _drawn(paper, name, accepted.get(name), drawn.get(name))
        if no_parameters:
            item.problems.append(no_parameters)
        elif name not in part_names(tree):
            item.problems.append("is not in the parameter file")
        else:
            with item.problem_noted():
                item.moved = compare_built(project, built, tree, paper, name)
        yield item


def _drawn(paper: str, name: str, reference: Path | None, new: Path | None) -> Item:
    """An item with its images compared, if there are any."""
    item = Item(paper, name, reference, new)
    if reference and new:
        with item.problem_noted():
            item.rms, item.note_rms = pixels.compare_images(reference, new, f"{paper} {name}")
    elif reference:
        item.problems.append("the figure was not built")
    elif new:
        item.problems.append("there is no accepted figure")
    return item


def compare_task(project: Path, reference: Path, results: Path, task: str) -> Iterator[Item]:
    """The table of a task of the bench, and its figures.

    Where all numbers agree and a figure does not, it is drawn again from the accepted numbers, and
    from those of the build: a number that moves within its tolerance may move the end of an axis,
    and with it every line. Then both figures must be those of their numbers.
    """
    table = Item("bench", task)
    with table.problem_noted():
        table.moved = golden_bench.compare_task(project, results, task)
    yield table
    accepted, drawn = (figures(folder / "bench" / task) for folder in (reference, results))
    golden = golden_bench.golden_table(project, task)
    built = golden_bench.built_table(results, task)
    for name in sorted({*accepted, *drawn}):
        item = _drawn("bench", f"{task}_{name}", accepted.get(name), drawn.get(name))
        if item.redrawn and table.verdict == "agrees":
            with item.problem_noted():
                sides = ((golden, accepted[name]), (built, drawn[name]))
                item.rms = max(_rms_of_numbers(project, task, *side) for side in sides)
        yield item


def _rms_of_numbers(project: Path, task: str, table: Path, image: Path) -> float:
    """The difference of a figure of a task from the one that is drawn of these numbers."""
    task_file, tuned = project / f"config/bench/{task}.yaml", project / f"config/bench/tuned/{task}"
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        drawn = Path(folder) / image.name
        options = ("--table", table, "--tuned", tuned, "--outputs", drawn)
        golden_bench.run_module(task, "reobserve_papers", "bench", "plot", task_file, *options)
        expected, actual = map(pixels.read_pixels, (drawn, image))
        return pixels.rms_difference(expected, actual, f"bench {task}_{image.stem}")


def _compare_claims(project: Path, results: Path, papers: list[str]) -> list[Item]:
    """The verdicts on the claims of each paper that has some, accepted or built."""
    try:
        golden = golden_claims.read_golden(project)
        built = golden_claims.read_built(results)
    except InputError as error:
        return [Item("all papers", "claims", problems=[str(error)])]
    return [
        Item(
            paper,
            "claims",
            moved=list(golden_claims.compare(golden, built, paper)),
            lacking=[claim for claim, _ in golden_claims.lacking(golden, built, paper)],
        )
        for paper in papers
        if paper in golden or paper in built
    ]

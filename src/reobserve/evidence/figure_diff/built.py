"""What a build left in the results folder of a paper: the numbers of a figure, or why none."""

from __future__ import annotations

from pathlib import Path

from reobserve.ledger.ledger import Ledger
from reobserve.ledger.stages import STAGES
from reobserve.pipeline.evaluation import Evaluation
from reobserve.pipeline.jobs import Graph, Job, moved
from reobserve.timeseries.series import Series

# Drawings that are no figures: what they show are draws, and the verdicts on them are compared.
_OF_DRAWS = {Path(path).stem for path in STAGES["sensitivity"].makes}

# The stage that makes an item, by the item's kind.
_STAGES = {"figure": "plot", "table": "table", "theory": "theory"}


def drawings(folder: Path) -> list[Path]:
    """The figures that are drawn in a folder."""
    return [path for path in sorted(folder.glob("*.png")) if path.stem not in _OF_DRAWS]


def built_series(ledger: Ledger, figure: str, results: Path) -> Evaluation:
    """The record and the estimates behind a figure, from their files, without metrics.

    Raises
    ------
    InputError
        If the ledger has no such figure, or a file is missing or damaged.
    """
    observers = ledger.section("figures", figure)["observers"]
    read = Graph({ledger.paper: ledger}).job("metrics", paper=ledger.paper, figure=figure).files
    plant, *series = (
        Series.read(moved(path, results)) for path in (*read["plant"], *read["estimates"])
    )
    return Evaluation(plant, dict(zip(observers, series, strict=True)), None, [])


def why_missing(ledger: Ledger, name: str, kind: str, results: Path) -> str:
    """The sentence with which the first job on the road to an item failed.

    ``results`` is the folder of all papers, beside that of the logs.
    """
    for job in _road(ledger, name, kind):
        if not all(moved(path, results).exists() for path in job.outputs):
            said = _last_sentence(results.parent / job.log)
            if said:
                return said
    return "was not built, and no log says why"


def _road(ledger: Ledger, name: str, kind: str) -> list[Job]:
    """The jobs that an item needs, in the order in which they run; none if nothing makes it."""
    graph, stage = Graph({ledger.paper: ledger}, formats=["png"]), _STAGES[kind]
    if stage == "theory":
        return graph.behind(graph.job(stage, paper=ledger.paper))
    return graph.behind(*(job for job in graph.all_of(stage, ledger.paper) if name in job.about))


def _last_sentence(log: Path) -> str:
    """The last line of a log that is not the command itself; nothing if there is no log."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    said = [line.strip() for line in lines if line.strip() and not line.startswith("+ ")]
    return said[-1].removeprefix("reobserve: ") if said else ""

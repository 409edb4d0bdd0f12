"""What a build left in the results folder of a paper: the numbers of a figure, or why none."""

from __future__ import annotations

from pathlib import Path

from reobserve.errors import InputError
from reobserve.ledger.ledger import Ledger
from reobserve.replication.chain import behind, log
from reobserve.replication.evaluation import Replication
from reobserve.replication.logs import read_log
from reobserve.timeseries.series import Series

# Drawings that are no figures: what they show are draws, and the verdicts on them are compared.
_OF_DRAWS = ("specification", "sensitivity")

# The step that makes an item, by the item's kind.
_STEPS = {"figure": "plot", "table": "table", "theory": "theory"}


def drawings(folder: Path) -> list[Path]:
    """The figures that are drawn in a folder."""
    return [path for path in sorted(folder.glob("*.png")) if path.stem not in _OF_DRAWS]


def built_series(ledger: Ledger, figure: str, results: Path) -> Replication:
    """The record and the estimates behind a figure, from their files, without metrics.

    Raises
    ------
    InputError
        If there is no such figure, or a file is missing or damaged.
    """
    body = ledger.section("figures", figure)
    folder = results / ledger.paper / body["scenario"]
    plant = Series.read(folder / "plant.parquet")
    estimates = {one: Series.read(folder / f"{one}.parquet") for one in body["observers"]}
    return Replication(ledger, figure, plant, estimates, None, [])


def why_missing(ledger: Ledger, name: str, kind: str, results: Path) -> str:
    """The sentence with which the first step behind an item failed.

    ``results`` is the folder of all papers, beside that of the logs.
    """
    project, names = results.parent, [] if kind == "theory" else [name]
    if names and name not in ledger.tree.get(f"{kind}s", {}):
        return "is not in the parameter file"
    for step in behind(ledger, _STEPS[kind], *names):
        path = log(ledger.paper, *step)
        try:
            job = read_log(project, path)
        except InputError:
            continue
        if not all((project / file).exists() for file in job.outputs):
            return _last_sentence(project / path)
    return "was not built, and no log says why"


def _last_sentence(log: Path) -> str:
    """The last line of a log that is not the command itself; nothing if there is no log."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    said = [line.strip() for line in lines if line.strip() and not line.startswith("+ ")]
    return said[-1].removeprefix("reobserve: ") if said else ""

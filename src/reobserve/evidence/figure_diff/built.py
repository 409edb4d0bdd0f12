"""What a build left in the results folder of a paper: the numbers of a figure, or why none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.evaluation import Evaluation
from reobserve.timeseries.series import Series


def built_series(ledger: Ledger, figure: str, results: Path) -> Evaluation:
    """The record and the estimates behind a figure, from their files, without metrics.

    Raises
    ------
    InputError
        If the ledger has no such figure, or a file is missing or damaged.
    """
    body = ledger.section("figures", figure)
    folder = results / body["scenario"]
    estimates = {name: Series.read(folder / f"{name}.parquet") for name in body["observers"]}
    return Evaluation(Series.read(folder / "plant.parquet"), estimates, None, [])


def why_missing(ledger: Ledger, name: str, kind: str, results: Path, logs: Path) -> str:
    """The sentence with which the first job on the road to an item failed.

    ``results`` and ``logs`` are the folders of the paper.
    """
    for product, log in _road(ledger, name, kind):
        if not (results / product).exists():
            said = _last_sentence(logs / log)
            if said:
                return said
    return "was not built, and no log says why"


def _road(ledger: Ledger, name: str, kind: str) -> list[tuple[str, str]]:
    """The files that an item needs, each with the log of its job, in the order they are made."""
    if kind == "theory":
        designs = ledger.tree.get("designs", {})
        return [*map(_design, designs), ("theory.metrics.csv", "theory.log")]
    if kind == "table":
        body: dict[str, Any] = ledger.tree.get("tables", {}).get(name, {})
        designs = [body["design"]] if "design" in body else []
        return [*map(_design, designs), (f"{name}.csv", f"{name}.table.log")]
    if name not in ledger.tree["figures"]:
        return []
    body = ledger.tree["figures"][name]
    scenario, study = body["scenario"], body.get("study")
    road = [(f"{scenario}/plant.parquet", f"{scenario}/plant.log")]
    road += map(_design, ledger.settings("plot", name).get("designs", ()))
    road += [(f"{scenario}/{one}.parquet", f"{scenario}/{one}.log") for one in body["observers"]]
    road += [(f"{study}.study.csv", f"{study}.study.log")] if study else []
    road += [(f"{name}.metrics.csv", f"{name}.metrics.log"), (f"{name}.png", f"{name}.plot.log")]
    return road


def _design(name: str) -> tuple[str, str]:
    return f"{name}.design.json", f"{name}.design.log"


def _last_sentence(log: Path) -> str:
    """The last line of a log that is not the command itself; nothing if there is no log."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    said = [line.strip() for line in lines if line.strip() and not line.startswith("+ ")]
    return said[-1].removeprefix("reobserve: ") if said else ""

"""The calibrated banks with one thing changed: what the quoted values hang on."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from reobserve.errors import located
from reobserve.papers.imm import plant as plant_stage
from reobserve.papers.imm.study_neighbourhood import QUANTITIES
from reobserve.papers.imm.tuning import Calibration
from reobserve.series import Series

Row = tuple[str, str, float, int, str, float, str]
Change = tuple[str, float, dict[str, Any], dict[str, Any]]

THREADS = 2


def run(settings: dict[str, Any], plant: Series) -> list[Row]:
    """Mean probabilities of all banks for each change of the scenario or of the observers.

    Raises
    ------
    InputError
        If a changed value cannot be used.
    """
    found = list(_changes(settings["study"]))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = pool.map(lambda change: _rows(settings, plant, change), found)
        return [row for part in parts for row in part]


def _changes(study: dict[str, Any]) -> Iterator[Change]:
    """Name, level, and what differs in the scenario and in the observers."""
    yield "as_stated", 1.0, {}, {}
    yield "unmixed", 1.0, {}, {"mixing": False}
    yield "prbs", 1.0, {"input": study["prbs"]}, {}
    yield "square", 1.0, {"input": study["square"]}, {}
    yield "sweep", 1.0, {"input": study["sweep"]}, {}
    yield "friction", 1.0, {"fault": "friction"}, {}
    for period in study["periods"]:
        yield "period", period, {"period": period}, {}
    for share in study["shares"]:
        yield "share", share, {"share": share}, {}
    for factor in study["layer_factors"]:
        yield "layer", factor, {}, {"layer_factor": factor}
    yield "noise", 1.0, {"noise": study["noise"]}, {}


def _rows(settings: dict[str, Any], plant: Series, change: Change) -> list[Row]:
    sweep, level, scenario, observer = change
    if scenario:
        whole = {
            "plant": settings["plant"],
            "scenario": {**settings["scenario"], **scenario},
            "seed": settings["seed"],
        }
        with located(f"studies.{sweep}"):
            record = plant_stage.simulate(whole)
    else:
        record = plant
    observers = {name: {**body} for name, body in settings["observers"].items()}
    for body in observers.values():
        if "layer_factor" in observer and "layer_factor" in body:
            body["layer_factor"] *= observer["layer_factor"]
        elif "layer_factor" not in observer:
            body.update(observer)
    calibration = Calibration(settings["plant"], observers, settings["metrics"], record)
    trial = calibration.try_out(calibration.stated())
    rows: list[Row] = [("all", sweep, level, 0, "distance", trial.distance, "1")]
    for name, means in trial.means.items():
        rows += [
            (name, sweep, level, 0, quantity, mean, "1")
            for quantity, mean in zip(QUANTITIES, means, strict=True)
        ]
    return rows

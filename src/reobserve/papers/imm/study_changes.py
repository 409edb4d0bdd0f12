"""The calibrated banks with one thing changed: what the quoted values hang on."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from reobserve.errors import InputError
from reobserve.papers.imm import plant as plant_stage
from reobserve.papers.imm.study_neighbourhood import trial_rows
from reobserve.papers.imm.tuning import Calibration
from reobserve.series import Series

Row = tuple[str, str, float, int, str, float, str]
Change = tuple[str, float, dict[str, Any], dict[str, Any]]

# The study's keys for what changes the scenario, where it is not the name of the change.
_KEYS = {"period": "periods", "share": "shares"}

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


def check(settings: dict[str, Any]) -> None:
    """Build the plant of each change and run none.

    Raises
    ------
    InputError
        With the key of the study whose value cannot be used.
    """
    for sweep, _, scenario, _ in _changes(settings["study"]):
        for changed in scenario:
            try:
                plant_stage.build(_changed(settings, scenario))
            except InputError as error:
                key, own = _KEYS.get(sweep, sweep), f"scenario.{changed}"
                if error.parameter.startswith(own):
                    place = key + error.parameter.removeprefix(own)
                    raise InputError(place, error.problem) from None
                raise InputError(key, f"with it, {error}") from None


def _changed(settings: dict[str, Any], scenario: dict[str, Any]) -> dict[str, Any]:
    """The settings of the plant's stage with something else in the scenario."""
    return {
        "plant": settings["plant"],
        "scenario": {**settings["scenario"], **scenario},
        "seed": settings["seed"],
    }


def _rows(settings: dict[str, Any], plant: Series, change: Change) -> list[Row]:
    sweep, level, scenario, observer = change
    record = plant_stage.simulate(_changed(settings, scenario)) if scenario else plant
    observers = {name: {**body} for name, body in settings["observers"].items()}
    for body in observers.values():
        if "layer_factor" in observer and "layer_factor" in body:
            body["layer_factor"] *= observer["layer_factor"]
        elif "layer_factor" not in observer:
            body.update(observer)
    calibration = Calibration(settings["plant"], observers, settings["metrics"], record)
    trial = calibration.try_out(calibration.stated())
    return list(trial_rows(sweep, level, trial))

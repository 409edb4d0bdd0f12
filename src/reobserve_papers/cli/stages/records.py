"""Read records and estimates, and check them against the parameters before they are used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, located, shown
from reobserve.core.validation import parse
from reobserve_papers.parameters.job import AnyJob, declared_keys, read_job, record_axis
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import ChannelShape, Series
from reobserve_papers.steps.compute import Provenance, paper_module

_ROUNDING = 1e-9  # of a step: how far a sample may be from its place on the axis


def read_record(path: Path, parameters: Parameters, scenario: str | None = None) -> Series:
    """A plant's record, of ``scenario`` or of whichever scenario of the parameter file it is.

    Raises
    ------
    InputError
        If the file is damaged, the record is another, its time is not on the step and horizon of
        the parameter file, or channels are missing, of other units or not finite.
    """
    series = Series.read(path)
    job = _job(path, series, parameters, "plant", scenario)
    stated, settings = _stated(parameters, parameters.settings("plant", job))
    horizon, step = getattr(stated, "axis", record_axis)(settings)
    count = round(horizon / step) + 1
    _check_axis(path, series, np.arange(count, dtype=np.float64) * step, step)
    _check_channels(path, series, stated.plant(settings))
    for event in getattr(stated, "EVENTS", ()):
        if event not in series.events:
            raise InputError(str(path), f"has no event {event!r}")
    return series


def read_estimates(
    observers: Sequence[str], paths: list[Path], parameters: Parameters, plant: Series
) -> dict[str, Series]:
    """The estimates of a figure by observer, from the files in the same order.

    Raises
    ------
    InputError
        If there are more or fewer files than observers, or one is not that observer's on the time
        of ``plant``; as `read_record`.
    """
    if len(paths) != len(observers):
        wanted = ", ".join(observers)
        raise InputError("--estimate-files", f"{len(paths)} given, must be one each for {wanted}")
    found = {}
    for name, path in zip(observers, paths, strict=True):
        stated, settings = _stated(parameters, parameters.settings("observe", name))
        series = found[name] = Series.read(path)
        _job(path, series, parameters, "observe", name)
        rows, samples = len(series.time), len(plant.time)
        every = (samples - 1) // max(rows - 1, 1)
        _check_axis(path, series, plant.time[::every], plant.step)
        _check_channels(path, series, stated.estimates(settings))
    return found


def _stated(parameters: Parameters, settings: dict[str, Any]) -> tuple[Any, AnyJob]:
    """What the paper says of its files, and the settings of a job as it declares them."""
    with located(parameters.paper):
        return paper_module(parameters.package, "record"), read_job(
            declared_keys(parameters), settings
        )


def _job(path: Path, series: Series, parameters: Parameters, stage: str, name: str | None) -> str:
    """The scenario or observer that a series says it is of; the wanted one, if one is wanted."""
    made = parse(Provenance, series.provenance, f"{path}: provenance")
    known = parameters.tree["scenarios" if stage == "plant" else "observers"]
    wanted = known if name is None else (name,)
    if (made.paper, made.stage) != (parameters.paper, stage) or made.job not in wanted:
        kind = "a record" if stage == "plant" else "an estimate"
        raise InputError(
            str(path),
            f"is {shown(made.job)} of stage {made.stage} of {made.paper}, must be {kind} of "
            f"{' or '.join(wanted)} of {parameters.paper}",
        )
    return made.job


def _check_axis(path: Path, series: Series, wanted: Any, step: float) -> None:
    if len(series.time) != len(wanted):
        raise InputError(
            str(path),
            f"has {len(series.time)} samples up to {series.time[-1:].sum():g} s, must have "
            f"{len(wanted)} up to {wanted[-1]:g} s, the horizon of the parameter file",
        )
    off = np.abs(series.time - wanted)
    worst = int(np.argmax(off))
    if not off[worst] <= _ROUNDING * step * len(wanted):
        raise InputError(
            str(path),
            f"has a sample at {series.time[worst]:.9g} s, must have it at {wanted[worst]:.9g} s",
        )


def _check_channels(path: Path, series: Series, shapes: Mapping[str, ChannelShape]) -> None:
    for name, shape in shapes.items():
        if name not in series.channels and not shape.optional:
            raise InputError(str(path), f"has no channel {name!r}")
    for name, channel in series.channels.items():
        if name not in shapes:
            raise InputError(str(path), f"has the unknown channel {shown(name)}")
        shape, values = shapes[name], channel.values
        components = values.shape[1] if values.ndim == 2 else None
        if (channel.unit, components) != (shape.unit, shape.components):
            raise InputError(
                str(path),
                f"{name} has the unit {shown(channel.unit)} and {components or 1} components, "
                f"must have {shape.unit!r} and {shape.components or 1}",
            )
        if not np.all(np.isfinite(values)):
            row = int(np.argmin(np.isfinite(values.reshape(len(values), -1)).all(axis=1)))
            raise InputError(
                str(path), f"{name} is not finite at {series.time[row]:g} s, must be a number"
            )

"""Read records and estimates that a stage wrote, and refuse those of other parameters.

What a stage writes has been checked then, and the file carries a digest of it. What it was made
from stands in its provenance, which is compared with what the parameters state now.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import InputError, shown
from reobserve.core.seals import digest
from reobserve.core.validation import parse
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.compute import Provenance


def read_record(path: Path, parameters: Parameters, scenario: str | None = None) -> Series:
    """A plant's record, of ``scenario`` or of whichever scenario of the parameter file it is."""
    series, _ = _read(path, parameters, "plant", scenario)
    return series


def read_estimates(
    observers: Sequence[str], paths: list[Path], parameters: Parameters, plant: Series
) -> dict[str, Series]:
    """The estimates of a figure by observer, from the files in the same order."""
    if len(paths) != len(observers):
        wanted = ", ".join(observers)
        raise InputError("--estimate-files", f"{len(paths)} given, must be one each for {wanted}")
    found = {}
    for name, path in zip(observers, paths, strict=True):
        found[name], made = _read(path, parameters, "observe", name)
        if made.record != plant.provenance["settings_digest"]:
            raise InputError(str(path), "is an estimate on another record, must be on that given")
    return found


def _read(
    path: Path, parameters: Parameters, stage: str, name: str | None
) -> tuple[Series, Provenance]:
    """A series of a scenario or an observer, of any if none is wanted, and what made it."""
    series = Series.read(path)
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
    if made.settings_digest != digest(parameters.settings(stage, made.job)):
        raise InputError(
            str(path),
            f"was made from other parameters than {parameters.paper} has now; run the stage "
            f"{stage} again",
        )
    return series, made

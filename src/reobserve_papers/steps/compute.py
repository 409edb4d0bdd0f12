"""The steps of the chain: each calls its paper's own function with the settings that it reads."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, located, shown
from reobserve.core.files import read_table
from reobserve.core.seals import digest
from reobserve.core.validation import parse
from reobserve_papers.parameters.job import Settings, declared_keys, read_job
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS, SEED
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.provenance import code_digest, versions


def paper_module(package: str, part: str) -> Any:
    """The module of a part in the package of a paper: its own, or that of the whole paper."""
    module = paper_part(package, part)
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if not f"{module}.".startswith(f"{error.name}."):
            raise
        problem = f"has no {part}" if error.name == module else "there is no such package"
        raise InputError(package, problem) from None


def compute(parameters: Parameters, stage: str, name: str, settings: Settings, *inputs: Any) -> Any:
    """The result of a job: the paper's own function of typed settings and of inputs.

    ``name`` is that of the branch that the job is about, ``inputs`` are records and designs.
    """
    kind = KINDS[stage]
    # What is wrong with a plant, a study or a search, it says of which section itself.
    section = "" if SEED in kind.values else kind.section or stage
    place = (parameters.paper, section, section and name)
    with located(".".join(part for part in place if part)):
        job = read_job(declared_keys(parameters), settings)
        return getattr(paper_module(parameters.package, stage), kind.function)(job, *inputs)


def run_step(
    parameters: Parameters, step: str, name: str, inputs: list[Any],
    say: Callable[[str], object] = str,
) -> Any:  # fmt: skip
    """The result of a step from those that it reads, in the order of `reads`.

    ``say`` takes the lines in which a long step tells how it goes on.
    """
    if step == "design":
        return compute_design(parameters, name)
    settings = parameters.settings(step, name)
    if step == "theory":
        inputs = [dict(zip(settings["designs"], inputs, strict=True))]
    if KINDS[step].progress:
        inputs = [*inputs, say]
    return compute(parameters, step, name, settings, *inputs)


def signed(
    series: Series, parameters: Parameters, stage: str, job: str, settings: Any,
    record: Series | None = None,
) -> Series:  # fmt: skip
    """``series`` with its provenance: step, settings, record and digest of the code."""
    for name, channel in series.channels.items():
        finite = np.isfinite(channel.values.reshape(len(series.time), -1)).all(axis=1)
        if not finite.all():
            time = series.time[int(np.argmin(finite))]
            problem = f"{name} is not finite at {time:g} s, must be a number"
            raise InputError(f"{parameters.paper}.{job}", problem)
    made = provenance(parameters, stage, job, settings)
    if record is not None:
        made["record"] = record.provenance["settings_digest"]
    return replace(series, provenance=made)


def provenance(parameters: Parameters, stage: str, job: str, settings: Any) -> dict[str, Any]:
    """The origin of a result: its maker, the settings, code and packages."""
    return {
        "paper": parameters.paper,
        "stage": stage,
        "job": job,
        "settings": settings,
        "settings_digest": digest(settings),
        "code_digest": code_digest(stage, parameters.package),
        "packages": versions(),
    }


def compute_design(parameters: Parameters, design: str) -> dict[str, Any]:
    """A design as the steps that read it get it: what the paper computes, by way of JSON."""
    computed = compute(parameters, "design", design, parameters.settings("design", design))
    try:
        read_back: dict[str, Any] = json.loads(json.dumps(computed, allow_nan=False))
    except ValueError:
        place = f"{parameters.paper}.designs.{design}"
        raise InputError(place, "gives a number that is not finite") from None
    return read_back


@dataclass(frozen=True)
class Provenance:
    """Statement of a stage on what it made: which paper and job, from which settings, by what."""

    paper: str
    stage: str
    job: str
    settings: dict[str, Any]
    settings_digest: str
    code_digest: str
    packages: dict[str, str]
    record: str = ""  # of an estimate: the digest of the settings of the plant's record


@dataclass(frozen=True)
class _StoredDesign:
    design: dict[str, Any]
    provenance: Provenance


def read_design(path: Path, paper: str, name: str) -> dict[str, Any]:
    """A design of a paper from the file that its stage wrote.

    Its own keys are those of its paper, which checks them where it takes the design.
    """
    stored = parse(_StoredDesign, read_json(path), str(path))
    made = stored.provenance
    if (made.stage, made.paper, made.job) != ("design", paper, name):
        raise InputError(
            str(path), f"is {shown(made.job)} of {made.paper}, must be {name!r} of {paper}"
        )
    return stored.design


def read_study(package: str, path: Path) -> list[dict[str, str]]:
    """The rows of a study."""
    module = paper_module(package, "study_rows")
    return read_table(path, module.HEADER, module.KINDS)

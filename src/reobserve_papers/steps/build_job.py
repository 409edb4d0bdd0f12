"""A step as a job of a build: what it reads comes from files beside its parameters, as its result.

What a job wrote had been checked, and the file carries a digest of it. What it was made from stands
in its provenance, which is compared with what the parameters state now.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve.core.files import write_table, write_text
from reobserve.core.seals import digest, sealed
from reobserve.core.validation import parse
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.chain import Step, project_of, reads, result
from reobserve_papers.steps.compute import (
    Provenance,
    paper_module,
    provenance,
    read_design,
    read_study,
    run_step,
    signed,
)


def run(step: str, parameter_file: Path, **named: str) -> None:
    """Compute and write. Nothing is written if the step cannot be computed."""
    names, parameters = tuple(named.values()), Parameters.read(parameter_file)
    project, name = project_of(parameter_file, parameters), ("", *names)[-1]
    settings = parameters.settings(step, name)
    output = project / result(parameters.paper, step, *names)
    inputs = stored(parameters, project, step, *names)
    if step == "metrics":
        from reobserve_papers.steps.figures import behind_figure, figure_data, measure, rows_from
        from reobserve_papers.steps.glossary import check_explained

        plant, estimates, rows = behind_figure(inputs)
        data = figure_data(parameters, settings, plant, estimates, rows)
        with rows_from(study_file(parameters, project, inputs)):
            results: Any = measure(parameters, data)
        check_explained(parameters, name, results)
    else:
        results = run_step(parameters, step, name, [*inputs.values()], _say)
    match step:
        case "plant" | "observe":
            signed(results, parameters, step, name, settings, *[*inputs.values()][:1]).write(output)
        case "metrics" | "theory":
            from reobserve_papers.metrics.metrics import write_metrics

            write_metrics(output, results)
        case "study" | "table":
            module = paper_module(parameters.package, "study_rows" if step == "study" else step)
            write_table(output, results, module.HEADER, seal=True)
        case _:
            kept = {step: results, "provenance": provenance(parameters, step, name, settings)}
            write_text(output, json.dumps(sealed(kept), indent=1, ensure_ascii=False) + "\n")


def stored(parameters: Parameters, project: Path, step: str, *names: str) -> dict[Step, Any]:
    """The results that a step reads, by the steps that made them, from their files."""
    return {
        need: _read(parameters, project / result(parameters.paper, *need), *need)
        for need in reads(parameters, step, *names)
    }


def study_file(parameters: Parameters, project: Path, inputs: Iterable[Step]) -> Path | None:
    """The file of the study among what a figure reads, if there is one."""
    paths = (result(parameters.paper, *need) for need in inputs if need[0] == "study")
    return next((project / path for path in paths), None)


def _read(parameters: Parameters, path: Path, step: str, *names: str) -> Any:
    match step:
        case "design":
            return read_design(path, parameters.paper, *names)
        case "study":
            return read_study(parameters.package, path)
        case "metrics":
            from reobserve_papers.metrics.metrics import read_metrics

            return read_metrics(path)
    return read_series(path, parameters, step, *names)


def read_series(path: Path, parameters: Parameters, step: str, *names: str) -> Series:
    """The record of a scenario, or the estimates of an observer on it."""
    series = Series.read(path)
    made = parse(Provenance, series.provenance, f"{path}: provenance")
    if (made.paper, made.stage, made.job) != (parameters.paper, step, names[-1]):
        problem = (
            f"is {shown(made.job)} of stage {made.stage} of {made.paper}, must be "
            f"{names[-1]!r} of stage {step} of {parameters.paper}"
        )
        raise InputError(str(path), problem)
    if made.settings_digest != digest(parameters.settings(step, names[-1])):
        problem = f"was made from other parameters than {parameters.paper} has now"
        raise InputError(str(path), f"{problem}; run the stage {step} again")
    if step == "observe" and made.record != digest(parameters.settings("plant", names[0])):
        raise InputError(str(path), f"is an estimate on another record than that of {names[0]}")
    return series


def _say(line: str) -> None:
    """Show how a long step goes on."""
    print(line, file=sys.stderr, flush=True)

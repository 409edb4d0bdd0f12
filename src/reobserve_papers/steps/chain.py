"""Dependencies between the steps, plant -> observers -> metrics -> plot and the others, by files.

A step is named by a tuple such as ``("plant", "constant")`` or ``("observe", "constant",
"sampled")``: a scenario, or a scenario and an observer, or a design, study, search, table or
figure; the theory has no name. What each reads follows from `KINDS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError
from reobserve_papers.parameters.names import caption_template, stored_parameters
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS
from reobserve_papers.signals.inputs import sample_files

Step = tuple[str, ...]


def reads(parameters: Parameters, step: str, *names: str) -> list[Step]:
    """The steps whose results a step reads, in the order of its paper's function."""
    kind, tree = KINDS[step], parameters.tree
    body = tree[kind.section][names[-1]] if kind.about else {}
    scenario: str = names[0] if step == "observe" else body.get("scenario", "")
    if step == "observe" and scenario not in tree["scenarios"]:
        parameters.section("scenarios", scenario)  # refuses it, by the names that there are
    found: list[Step] = []
    for result in kind.results:
        if result == "plant" and scenario:
            found.append(("plant", scenario))
        elif result == "estimates":
            found += [("observe", scenario, observer) for observer in body["observers"]]
        elif result == "designs":
            found += [("design", name) for name in tree.get("designs", {})]
        elif result == "metrics":
            found.append(("metrics", *names))
        elif result in body:  # a design or a study, if the branch names one
            found.append((result, body[result]))
    return found


def behind(parameters: Parameters, *step: str) -> list[Step]:
    """A step and all that it needs, each after what it reads."""
    found: dict[Step, None] = {}
    for need in reads(parameters, *step):
        found |= dict.fromkeys(behind(parameters, *need))
    return [*found, step]


def inputs(parameters: Parameters, project: Path, step: str, *names: str) -> list[str]:
    """The files, by paths in a project, that a job of a step reads beside the parameters."""
    settings = parameters.settings(step, names[-1] if names else "")
    found = [result(parameters.paper, *need) for need in reads(parameters, step, *names)]
    found += [file for value in _values(settings) for file in sample_files(value)]
    if step == "study":
        for entry in parameters.tree["studies"][names[0]].values():
            found += [entry["value"]] if isinstance(entry, dict) and entry["unit"] == "file" else []
    if step == "plot":
        found.append(caption_template(project, parameters.paper, names[0], "figure"))
        texts = Path(f"workflow/report/{parameters.paper}")
        found += sorted(str(texts / path.name) for path in (project / texts).glob("_*.rst"))
    return list(dict.fromkeys(found))


def _values(settings: dict[str, Any]) -> Iterator[Any]:
    """The values of all branches."""
    for value in settings.values():
        yield value
        if isinstance(value, dict):
            yield from _values(value)


def project_of(parameter_file: Path, parameters: Parameters) -> Path:
    """The project in which a build has stored the parameters of a paper."""
    place = stored_parameters(parameters.paper)
    if not parameter_file.absolute().as_posix().endswith(f"/{place}"):
        problem = f"must be {place} in a project, beside which results are"
        raise InputError(str(parameter_file), problem)
    near = len(parameter_file.parts) > 2  # then messages have paths as typed
    return (parameter_file if near else parameter_file.absolute()).parents[2]


def log(paper: str, step: str, *names: str) -> str:
    """The path of the log that the workflow writes for a step."""
    if step in ("plant", "observe"):
        scenario, observer = (*names, "plant")[:2]
        return f"logs/{paper}/{scenario}/{observer}.log"
    return f"logs/{paper}/{'.'.join((*names, step))}.log"


def result(paper: str, step: str, *names: str) -> str:
    """The path of the result of a step, in a project, and that of the caption of a plot."""
    folder = f"results/{paper}"
    match step:
        case "plant" | "observe":
            scenario, observer = (*names, "plant")[:2]
            return f"{folder}/{scenario}/{observer}.parquet"
        case "metrics" | "theory":
            return f"{folder}/{(*names, 'theory')[0]}.metrics.csv"
        case "table":
            return f"{folder}/{names[0]}.csv"
        case "plot":
            return f"{folder}/{names[0]}.caption.rst"
    kind = "csv" if step == "study" else "json"
    return f"{folder}/{names[0]}.{step}.{kind}"

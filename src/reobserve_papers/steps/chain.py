"""Dependencies between the steps, plant -> observers -> metrics -> plot and the others, by files.

A step is named by a tuple such as ``("plant", "constant")`` or ``("observe", "constant",
"sampled")``: a scenario, or a scenario and an observer, or a design, study, search, table or
figure; the theory has no name. What each reads follows from `KINDS`, and for jobs on the claims of
papers from `EVIDENCE`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError
from reobserve_papers.parameters.names import (
    CONVENTIONS,
    caption_template,
    claims_path,
    samples_path,
    stored_parameters,
    style_sheet,
)
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS
from reobserve_papers.signals.inputs import sample_files

Step = tuple[str, ...]

# Jobs on the claims of a paper, and the steps whose results each reads: those of all names. The
# verdicts on all papers are in one table.
EVIDENCE = {
    "robustness": ("study",),
    "alternatives": ("metrics", "robustness"),
    "sensitivity": ("metrics", "robustness", "alternatives"),
    "claims": ("metrics", "robustness"),
    "verdicts": ("claims", "alternatives"),
}

# What the job `sensitivity` draws.
CLAIM_PLOTS = ("alternatives", "sensitivity")


def reads(parameters: Parameters, step: str, *names: str) -> list[Step]:
    """The steps whose results a step reads, in the order of its paper's function."""
    if step in EVIDENCE:
        return [need for kind in EVIDENCE[step] for need in _each(parameters, kind)]
    kind, tree = KINDS[step], parameters.tree
    body = parameters.section(kind.section, names[-1]) if kind.about else {}
    scenario: str = names[0] if step == "observe" else body.get("scenario", "")
    if step == "observe":
        parameters.section("scenarios", scenario)  # refuses one that there is not
    needs: list[Step] = []
    for result in kind.results:
        if result == "plant" and scenario:
            needs.append(("plant", scenario))
        elif result == "estimates":
            needs += [("observe", scenario, observer) for observer in body["observers"]]
        elif result == "designs":
            needs += [("design", name) for name in tree.get("designs", {})]
        elif result == "metrics":
            needs.append(("metrics", *names))
        elif result in body:  # a design or a study, if the branch names one
            needs.append((result, body[result]))
    return needs


def _each(parameters: Parameters, kind: str) -> list[Step]:
    """The steps of a kind in a paper."""
    tree = parameters.tree
    if kind not in KINDS:
        return [(kind,)]
    steps: list[Step] = [(kind, name) for name in tree.get(KINDS[kind].section, {})]
    return [*steps, ("theory",)] if kind == "metrics" and "theory" in tree else steps


def behind(parameters: Parameters, *step: str) -> list[Step]:
    """A step and all that it needs, each after what it reads."""
    steps: dict[Step, None] = {}
    for need in reads(parameters, *step):
        steps |= dict.fromkeys(behind(parameters, *need))
    return [*steps, step]


def inputs(
    parameters: Parameters, project: Path, step: str, *names: str, cached: bool = True,
    style: str = "",
) -> list[str]:  # fmt: skip
    """The files, by paths in a project, that a job of a step reads beside the parameters.

    Samples in ``config/samples`` are among them if a job takes ``cached`` ones, and the sheet of a
    ``style`` if it plots.
    """
    paper, tree = parameters.paper, parameters.tree
    files = [result(paper, *need) for need in reads(parameters, step, *names)]
    if step not in EVIDENCE:
        settings = parameters.settings(step, names[-1] if names else "")
    else:
        samples = step == "robustness"
        settings = tree if samples else {}
        texts = [claims_path(paper), CONVENTIONS, *[samples_path(paper)] * (samples and cached)]
        files += [path for path in texts if (project / path).is_file()]
    files += [file for value in _values(settings) for file in sample_files(value)]
    if step in ("study", "robustness"):
        studies = tree.get("studies", {})
        for study in [studies[names[0]]] if step == "study" else studies.values():
            entries = [entry for entry in study.values() if isinstance(entry, dict)]
            files += [entry["value"] for entry in entries if entry["unit"] == "file"]
    if step == "plot":
        sheets = [style_sheet(project, style)] if style else []
        files += [sheet for sheet in sheets if (project / sheet).is_file()]
        files.append(caption_template(project, paper, names[0], "figure"))
        folder = Path(f"workflow/report/{paper}")
        files += sorted(str(folder / path.name) for path in (project / folder).glob("_*.rst"))
    return list(dict.fromkeys(files))


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
    return _RESULTS[step].format(*names, paper=paper)


_RESULTS = {
    "plant": "results/{paper}/{0}/plant.parquet",
    "observe": "results/{paper}/{0}/{1}.parquet",
    "design": "results/{paper}/{0}.design.json",
    "study": "results/{paper}/{0}.study.csv",
    "search": "results/{paper}/{0}.search.json",
    "table": "results/{paper}/{0}.csv",
    "metrics": "results/{paper}/{0}.metrics.csv",
    "theory": "results/{paper}/theory.metrics.csv",
    "plot": "results/{paper}/{0}.caption.rst",
    "robustness": "results/{paper}/robustness.json",
    "alternatives": "results/{paper}/alternatives.csv",
    "claims": "results/claims.csv",
    "verdicts": "results/verdicts.md",
}


def outputs(paper: str, step: str, *names: str, formats: Iterable[str] = ()) -> tuple[str, ...]:
    """The paths of all files that a job writes, in a project."""
    if step == "sensitivity":
        plots = (f"{name}.{kind}" for name in CLAIM_PLOTS for kind in formats)
        return tuple(f"results/{paper}/{plot}" for plot in plots)
    made = result(paper, step, *names)
    kinds = formats if step == "plot" else ()
    return (*(f"{made.removesuffix('caption.rst')}{kind}" for kind in kinds), made)


def all_outputs(parameters: Parameters, formats: Iterable[str]) -> list[str]:
    """The files that the jobs of a paper write."""
    return [
        path
        for step in (*KINDS, *EVIDENCE)
        for kind, *names in _each(parameters, step)
        for scenario in (parameters.tree["scenarios"] if kind == "observe" else [()])
        for path in outputs(
            parameters.paper, kind, *filter(None, [scenario]), *names, formats=formats
        )
    ]

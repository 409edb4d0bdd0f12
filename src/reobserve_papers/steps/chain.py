"""Dependencies between the steps: plant -> observers -> metrics -> plot, and the others.

A step is named by a tuple such as ``("plant", "constant")`` or ``("observe", "constant",
"sampled")``: a scenario, or a scenario and an observer, or a design, study, table or figure; the
theory has no name.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve_papers.parameters.parameters import Parameters

Step = tuple[str, ...]


def reads(parameters: Parameters, step: str, *names: str) -> list[Step]:
    """The steps whose results a step reads, in the order of its paper's function."""
    tree = parameters.tree
    if step == "theory":
        return [("design", name) for name in tree.get("designs", {})]
    if step == "observe":
        scenario, observer = names
        return [("plant", scenario), *_design(tree["observers"][observer])]
    if step == "table":
        return _design(tree["tables"][names[0]])
    if step == "study":
        body = tree["studies"][names[0]]
        return [("plant", body["scenario"]), *_design(body)]
    if step in ("metrics", "plot"):
        body = tree["figures"][names[0]]
        scenario = body["scenario"]
        observers = [("observe", scenario, observer) for observer in body["observers"]]
        studies = [("study", body["study"])] if "study" in body else []
        metrics = [("metrics", names[0])] if step == "plot" else []
        return [("plant", scenario), *observers, *studies, *metrics]
    return []


def behind(parameters: Parameters, *step: str) -> list[Step]:
    """A step and all that it needs, each after what it reads."""
    found: dict[Step, None] = {}
    for need in reads(parameters, *step):
        found |= dict.fromkeys(behind(parameters, *need))
    return [*found, step]


def log(paper: str, step: str, *names: str) -> str:
    """The path of the log that the workflow writes for a step."""
    if step in ("plant", "observe"):
        scenario, observer = (*names, "plant")[:2]
        return f"logs/{paper}/{scenario}/{observer}.log"
    return f"logs/{paper}/{'.'.join((*names, step))}.log"


def _design(body: Mapping[str, Any]) -> list[Step]:
    """The design that an observer, a study or a table names, if it does."""
    return [("design", body["design"])] if "design" in body else []

"""Dependencies between the steps: plant -> observers -> metrics -> plot, and the others.

A step is named by a tuple such as ``("plant", "constant")`` or ``("observe", "constant",
"sampled")``: a scenario, or a scenario and an observer, or a design, study, search, table or
figure; the theory has no name. What each reads follows from `KINDS`.
"""

from __future__ import annotations

from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS

Step = tuple[str, ...]


def reads(parameters: Parameters, step: str, *names: str) -> list[Step]:
    """The steps whose results a step reads, in the order of its paper's function."""
    kind, tree = KINDS[step], parameters.tree
    body = tree[kind.section][names[-1]] if kind.about else {}
    scenario: str = names[0] if step == "observe" else body.get("scenario", "")
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


def log(paper: str, step: str, *names: str) -> str:
    """The path of the log that the workflow writes for a step."""
    if step in ("plant", "observe"):
        scenario, observer = (*names, "plant")[:2]
        return f"logs/{paper}/{scenario}/{observer}.log"
    return f"logs/{paper}/{'.'.join((*names, step))}.log"


def result(paper: str, step: str, *names: str) -> str:
    """The path of the result of a step, in a project."""
    folder = f"results/{paper}"
    match step:
        case "plant" | "observe":
            scenario, observer = (*names, "plant")[:2]
            return f"{folder}/{scenario}/{observer}.parquet"
        case "metrics" | "theory":
            return f"{folder}/{(*names, 'theory')[0]}.metrics.csv"
        case "table":
            return f"{folder}/{names[0]}.csv"
    kind = "csv" if step == "study" else "json"
    return f"{folder}/{names[0]}.{step}.{kind}"

"""The parameter values that each step of the chain reads.

A step gets these and nothing else, so a digest of them tells whether its result is out of date.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from reobserve_papers.parameters.names import SECTIONS

if TYPE_CHECKING:
    from reobserve_papers.parameters.parameters import Parameters

# The branch that a step is about, where it has not the name of the step.
_ABOUT = {"plant": "scenario", "observe": "observer", "metrics": "figure", "plot": "figure"}


def settings(parameters: Parameters, step: str, name: str = "") -> dict[str, Any]:
    """The branches of a parameter file that a step reads, as plain values by name.

    Parameters
    ----------
    parameters
        The parameters of a paper.
    step
        ``plant``, ``design``, ``observe``, ``study``, ``search``, ``table``, ``theory``,
        ``metrics`` or ``plot``.
    name
        The scenario, design, observer, study, search, table or figure; the theory has none. An
        observer depends on its scenario through the record of the plant alone.

    Raises
    ------
    InputError
        If there is nothing of that name.
    """
    section = parameters.section
    if step == "theory":
        named = ("observers", "designs", "metrics", "theory")
        sections = {word: section(word) if word in parameters.tree else {} for word in named}
        return {"plant": section("plant"), **sections}
    about = _ABOUT.get(step, step)
    body = section(SECTIONS[about], name)
    found: dict[str, Any] = {"plant": section("plant"), about: body}
    if step in ("observe", "table") and "design" in body:
        found["design"] = section("designs", body["design"])
    if step in ("plant", "study", "search"):
        found["seed"] = parameters.seed
    if "observers" in body:  # a study, a search or a figure
        found["scenario"] = section("scenarios", body["scenario"])
        found["observers"] = {one: section("observers", one) for one in body["observers"]}
        found["metrics"] = section("metrics")
        if about == "figure" and "study" in body:
            found["study"] = section("studies", body["study"])
        if designs := list(_designs_of(parameters, body, found.get("study", {}))):
            found["designs"] = {one: section("designs", one) for one in designs}
    return found


def _designs_of(parameters: Parameters, *bodies: Mapping[str, Any]) -> Iterable[str]:
    """The designs that figures or studies use themselves or through their observers."""
    users = [
        user
        for body in bodies
        for user in (
            *(parameters.section("observers", one) for one in body.get("observers", ())),
            body,
        )
    ]
    return dict.fromkeys(user["design"] for user in users if "design" in user)

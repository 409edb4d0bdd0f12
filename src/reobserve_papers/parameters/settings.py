"""The parameter values that each step of the chain reads.

A step gets these and nothing else, so a digest of them tells whether its result is out of date.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from reobserve_papers.parameters.step_kinds import KINDS, SECTIONS, SEED

if TYPE_CHECKING:
    from reobserve_papers.parameters.parameters import Parameters


def settings(parameters: Parameters, step: str, name: str = "") -> dict[str, Any]:
    """The branches of a parameter file that a step reads, as plain values by name.

    Parameters
    ----------
    parameters
        The parameters of a paper.
    step
        One of `KINDS`.
    name
        The scenario, design, observer, study, search, table or figure; the theory has none. An
        observer depends on its scenario through the record of the plant alone.
    """
    kind, section = KINDS[step], parameters.section
    if not kind.about:
        sections = {word: section(word) if word in parameters.tree else {} for word in kind.values}
        return {"plant": section("plant"), **sections}
    body = section(kind.section, name)
    found: dict[str, Any] = {"plant": section("plant"), kind.about: body}
    for word in kind.values:
        if word == SEED:
            found[SEED] = parameters.seed
        elif word != "design" and "observers" not in body:
            continue  # a search of something else
        elif word == "observers":
            found[word] = {one: section(word, one) for one in body[word]}
        elif word == "metrics":
            found[word] = section(word)
        elif word == "designs":
            if named := list(_designs_of(parameters, body, found.get("study", {}))):
                found[word] = {one: section(word, one) for one in named}
        elif word in body:
            found[word] = section(SECTIONS[word], body[word])
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

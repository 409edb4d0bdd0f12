"""Digests by which a build sees that claims or conventions have changed, for each kind of job."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from reobserve.core.seals import digest
from reobserve_papers.claims.conventions import conventions_text
from reobserve_papers.claims.registry import claims_text, deciding, decisive
from reobserve_papers.parameters.parameters import Parameters

Part = Literal["samples", "bounds", "verdicts", "table"]


def claims_digest(part: Part, project: Path, parameters: Parameters) -> str:
    """A digest of what decides one kind of job about the claims of a paper.

    `samples` are the parameters with their ranges and what is sampled, `bounds` also what says when
    samples are enough, `verdicts` are all texts, `table` also all parameters.
    """
    claims, conventions = claims_text(project, parameters.paper), conventions_text(project)
    seed = parameters.seed
    sampled = [parameters.decisive(), seed, decisive(claims, conventions)]
    if part == "samples":
        return digest(sampled)
    if part == "bounds":
        return digest([sampled, deciding(claims, conventions)])
    entries = dict(parameters.entries()) if part == "table" else {}
    return digest([claims, conventions, seed, entries])

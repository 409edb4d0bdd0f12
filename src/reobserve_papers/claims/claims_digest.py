"""Digests by which a build sees that claims or conventions have changed, for each kind of job."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from reobserve.core.seals import digest
from reobserve_papers.claims.conventions import conventions_text
from reobserve_papers.claims.registry import claims_text, deciding, decisive
from reobserve_papers.parameters.parameters import Parameters

Part = Literal["samples", "verdicts", "table"]


def claims_digest(part: Part, project: Path, parameters: Parameters) -> str:
    """A digest of what decides one kind of job about the claims of a paper.

    `samples` are the parameters with their ranges, what is sampled and when samples are enough,
    `verdicts` are all texts, `table` also all parameters.
    """
    claims, conventions = claims_text(project, parameters.paper), conventions_text(project)
    seed = parameters.seed
    if part == "samples":
        sampled = [parameters.decisive(), seed, decisive(claims, conventions)]
        return digest([sampled, deciding(claims, conventions)])
    entries = dict(parameters.entries()) if part == "table" else {}
    return digest([claims, conventions, seed, entries])

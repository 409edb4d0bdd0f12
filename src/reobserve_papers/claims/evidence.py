"""Checks of the configuration beside the parameters: claims, errata, cached samples."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, located
from reobserve_papers.claims.cached_samples import read_cached
from reobserve_papers.claims.errata import errata_file, read_errata
from reobserve_papers.claims.registry import amiss, claims_file, read_registry
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters


def check_evidence(project: Path, parameters: Parameters) -> None:
    """Check the files of a paper, those that there are.

    Raises
    ------
    InputError
        With the file and the key of the first thing that is wrong.
    """
    paper = parameters.paper
    if claims_file(project, paper).exists():
        for problem in amiss(read_registry(project, parameters).claims):
            place, _, rest = problem.partition(": ")
            raise InputError(place, rest)
    if errata_file(project, paper).exists():
        read_errata(project, paper)
    for key, entry in parameters.entries():
        if entry["unit"] == "file" and str(entry["value"]).endswith(".json"):
            with located(f"{paper}.{key}"):
                read_json(project / entry["value"])
    if (samples := project / samples_path(paper)).exists():
        read_cached(samples, paper)

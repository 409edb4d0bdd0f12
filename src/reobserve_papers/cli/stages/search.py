"""Stage search: values that a paper leaves open, sought so that its numbers come out.

It is no part of a build. What it finds is kept with the config and in the parameter file, as an
assumption that was chosen for the claim that it serves.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from reobserve.core.files import write_text
from reobserve.core.seals import sealed
from reobserve_papers.cli.stages.records import read_record
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute, provenance


def run(parameter_file: Path, plant_file: Path, search: str, output: Path) -> None:
    """Search, say how it goes on stderr, and write what was found."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("search", search)
    plant = read_record(plant_file, parameters, settings["search"]["scenario"])
    found = compute(parameters, "search", search, settings, plant, _tell)
    stored = {"search": found, "provenance": provenance(parameters, "search", search, settings)}
    write_text(output, json.dumps(sealed(stored), indent=1, ensure_ascii=False) + "\n")


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)

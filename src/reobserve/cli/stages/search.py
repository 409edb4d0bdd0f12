"""Stage search: values that a paper leaves open, sought so that its numbers come out.

It is no part of a build. What it finds is kept with the config and in the ledger, as an assumption
that was chosen for the claim that it serves.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from reobserve.cli.stages.records import read_record
from reobserve.core.files import write_text
from reobserve.replication.parameters.ledger import Ledger
from reobserve.replication.steps import compute, provenance


def run(ledger_file: Path, plant_file: Path, search: str, output: Path) -> None:
    """Search, say how it goes on stderr, and write what was found."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("search", search)
    plant = read_record(plant_file, ledger, settings["search"]["scenario"])
    found = compute(ledger.paper, "search", search, settings, plant, _tell)
    stored = {"search": found, "provenance": provenance(ledger, "search", search, settings)}
    write_text(output, json.dumps(stored, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)

"""Stage theory: the numbers of a paper's theory, from the ledger and its designs to a table."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.replication.metrics.metrics import write_metrics
from reobserve.replication.parameters.ledger import Ledger
from reobserve.replication.steps import compute, read_design


def run(ledger_file: Path, design_files: list[Path], output: Path) -> None:
    """Compute and write; the designs come in the order of the ledger.

    Raises
    ------
    InputError
        If a design is another than the ledger names, or a value cannot be used.
    """
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("theory")
    names = list(settings["designs"])
    if len(design_files) != len(names):
        wanted = ", ".join(names) or "no design"
        given = len(design_files)
        raise InputError("--design-files", f"{given} given, must be one each for {wanted}")
    designs = {
        name: read_design(path, (ledger.paper, name))
        for name, path in zip(names, design_files, strict=True)
    }
    found = compute(ledger.paper, "theory", "", settings, designs)
    write_metrics(output, found)

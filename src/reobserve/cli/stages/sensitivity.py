"""Stage sensitivity: pictures of the draws that decided the claims of a paper."""

from __future__ import annotations

from pathlib import Path

from reobserve.plotting.fitting import fix_layout
from reobserve.plotting.formats import save
from reobserve.replication.claims.plot import sensitivity_bars, specification_curves
from reobserve.replication.claims.registry import read_registry
from reobserve.replication.claims.robustness_file import read_robustness
from reobserve.replication.parameters.ledger import Ledger

_PICTURES = {"specification": specification_curves, "sensitivity": sensitivity_bars}


def run(ledger_file: Path, robustness_file: Path, outputs: list[Path], project: Path) -> None:
    """Draw and save; the name of an output, without its suffix, says which picture it is."""
    ledger = Ledger.read(ledger_file)
    claims = read_registry(project, ledger).claims
    found = read_robustness(robustness_file, ledger.paper)
    for name, draw in _PICTURES.items():
        picture = draw(claims, found)
        fix_layout(picture)
        for output in outputs:
            if output.stem == name:
                save(picture, output)

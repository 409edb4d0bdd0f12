"""Computes figures and draws them in all formats, in one process and without a file.

Run as a script, with the names of figures of a paper, as ``ilo fig1 fig2``; without any it is all
figures of all papers.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable
from pathlib import Path

from reobserve.core.code_paths import pin_code_paths

pin_code_paths()  # as the command line does it

from reobserve.core.documents import read_yaml  # noqa: E402
from reobserve_papers.parameters.config import known_papers  # noqa: E402
from reobserve_papers.parameters.parameters import Parameters  # noqa: E402
from reobserve_papers.steps.evaluation import Evaluator, draw  # noqa: E402

PROJECT = Path(__file__).parents[1]


def make(paper: str, figures: Iterable[str] = ()) -> None:
    """Make these figures of a paper, or all."""
    config = read_yaml(PROJECT / "config" / "config.yaml")
    parameters = Parameters.load(PROJECT, paper, seed=config["seed"])
    evaluator = Evaluator(parameters)
    for figure in figures or parameters.tree["figures"]:
        drawing = draw(evaluator.figure(figure), notes=True)
        for kind in config["formats"]:
            drawing.savefig(io.BytesIO(), format=kind)


if __name__ == "__main__":
    if sys.argv[1:]:
        make(sys.argv[1], sys.argv[2:])
    else:
        for one in known_papers(PROJECT):
            make(one)

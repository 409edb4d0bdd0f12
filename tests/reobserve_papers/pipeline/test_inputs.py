"""The files that rules give to jobs are those of the one list of what steps read."""

from __future__ import annotations

import re
from collections.abc import Iterator

from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS
from reobserve_papers.steps.chain import reads, result
from tests.reobserve_papers.pipeline.conftest import PARAMETER_FILES, Project

WRITTEN = ("--output", "--outputs")  # what follows is written, the caption last


def steps(parameters: Parameters) -> Iterator[tuple[str, ...]]:
    """All steps of a paper: an observer on each record on which a figure has it."""
    tree = parameters.tree
    figures = tree["figures"].values()
    yield from dict.fromkeys(
        ("observe", figure["scenario"], name) for figure in figures for name in figure["observers"]
    )
    if "theory" in tree:
        yield ("theory",)
    for step, kind in KINDS.items():
        if step not in ("observe", "theory"):
            yield from ((step, name) for name in tree.get(kind.section, {}))


def test_rules_read_what_the_list_says(fresh: Project) -> None:
    """In a dry run of everything, and of all searches, on which nothing else depends."""
    wanted, asked = {}, []
    for paper, parameters in PARAMETER_FILES.items():
        for step in steps(parameters):
            product = f"results/{paper}/{step[1]}.caption.rst" if step[0] == "plot" else ""
            product = product or result(paper, *step)
            asked.append(product)
            wanted[product] = {result(paper, *need) for need in reads(parameters, *step)}
    output = fresh.snakemake("--dry-run", "--printshellcmds", *asked).stdout
    found = {}
    for line in re.findall(r"\(set -x; reobserve-papers stage (.*?)\) ", output):
        step, parameter_file, *words = line.split()
        if step in KINDS:
            begin = next(place for place, word in enumerate(words) if word in WRITTEN)
            read = {word for word in words[:begin] if word.startswith("results/")}
            found[words[-1]] = read - {parameter_file}
    assert found == wanted

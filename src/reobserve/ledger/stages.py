"""The stages: what the jobs of each see of the ledger, which files they read and write, and how.

It is written here once; `reobserve.pipeline.jobs` finds the jobs of a ledger by it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reobserve.ledger.ledger import Ledger

# Sections of a ledger by what jobs call the one branch that they are about.
SECTIONS = {
    "scenario": "scenarios",
    "design": "designs",
    "observer": "observers",
    "study": "studies",
    "search": "searches",
    "table": "tables",
    "figure": "figures",
}

# The room of papers: a package for each, or a module.
_PAPERS = Path(__file__).parents[1] / "papers"

# By role: files of which what a job sees of them counts, and not how old they are.
AGELESS = {"ledger": "results/{paper}/ledger.json", "registry": "config/claims/{paper}.yaml"}


def kept_file(paper: str) -> str:
    """Where the draws of a paper's claims are kept, in the project."""
    return f"config/draws/{paper}.json"


DEFAULT_STYLE = "default"  # the look of the house, with a sheet or without


def style_sheet(name: str) -> str:
    """Where the sheet of a style is, in the project."""
    return f"config/styles/{name}.mplstyle"


@dataclass(frozen=True)
class Stage:
    """What the jobs of a stage have in common.

    Parameters
    ----------
    about
        What tells its jobs apart, by the words of `SECTIONS`, or a chunk of draws; a theory, and
        what is told of claims, there is one of.
    sees
        The branches of the ledger, see `seen`.
    reads
        The roles of the files that it reads, see `reobserve.pipeline.jobs.Graph.read`.
    command
        How `reobserve` takes it: ``{role}`` stands for files, ``{word}`` for what it is about, and
        what is in brackets is left out where a job has no file in that role.
    makes, log
        Paths, the same words in braces.
    """

    about: tuple[str, ...]
    sees: tuple[str, ...]
    reads: tuple[str, ...]
    command: str
    makes: tuple[str, ...]
    log: str


_RUNS = ("plant", "scenario", "observers", "metrics")  # what all see that run or judge observers

# In the order in which they need each other.
# fmt: off
STAGES = {
    "design": Stage(
        ("design",), ("plant", "design"), ("ledger",),
        "stage design {ledger} {design} --output {output}",
        ("results/{paper}/{design}.design.json",), "logs/{paper}/{design}.design.log",
    ),
    "plant": Stage(
        ("scenario",), ("plant", "scenario", "seed"), ("ledger", "signals"),
        "stage plant {ledger} {scenario} --output {output}",
        ("results/{paper}/{scenario}/plant.parquet",), "logs/{paper}/{scenario}/plant.log",
    ),
    "observe": Stage(
        ("scenario", "observer"), ("plant", "observer", "design"), ("ledger", "plant", "design"),
        "stage observe {ledger} {plant} {observer} [--design-file {design}] --output {output}",
        ("results/{paper}/{scenario}/{observer}.parquet",),
        "logs/{paper}/{scenario}/{observer}.log",
    ),
    "study": Stage(
        ("study",), (*_RUNS, "study", "seed", "designs"), ("ledger", "plant", "files", "design"),
        "stage study {ledger} {plant} {study} [--design-file {design}] --output {output}",
        ("results/{paper}/{study}.study.csv",), "logs/{paper}/{study}.study.log",
    ),
    "search": Stage(
        ("search",), (*_RUNS, "search", "seed", "designs"), ("ledger", "plant"),
        "stage search {ledger} {plant} {search} --output {output}",
        ("results/{paper}/{search}.search.json",), "logs/{paper}/{search}.search.log",
    ),
    "table": Stage(
        ("table",), ("plant", "table", "design"), ("ledger", "design"),
        "stage table {ledger} {table} --design-file {design} --output {output}",
        ("results/{paper}/{table}.csv",), "logs/{paper}/{table}.table.log",
    ),
    "theory": Stage(
        (), ("plant", "observers", "designs", "metrics", "theory"), ("ledger", "designs"),
        "stage theory {ledger} --design-files {designs} --output {output}",
        ("results/{paper}/theory.metrics.csv",), "logs/{paper}/theory.log",
    ),
    "metrics": Stage(
        ("figure",), (*_RUNS, "figure", "study", "designs"),
        ("ledger", "plant", "estimates", "study"),
        "stage metrics {ledger} {figure} --plant-file {plant} --estimate-files {estimates}"
        " [--study-file {study}] --output {output}",
        ("results/{paper}/{figure}.metrics.csv",), "logs/{paper}/{figure}.metrics.log",
    ),
    "plot": Stage(
        ("figure",), (*_RUNS, "figure", "study", "designs"),
        ("ledger", "plant", "estimates", "study", "metrics", "template", "partials", "style"),
        "stage plot {ledger} {figure} --plant-file {plant} --estimate-files {estimates}"
        " [--study-file {study}] --metrics-file {metrics} [--style {style}] [{notes}]"
        " --template {template}"
        " --caption {caption} --outputs {drawings}",
        ("results/{paper}/{figure}.{format}", "results/{paper}/{figure}.caption.rst"),
        "logs/{paper}/{figure}.plot.log",
    ),
    "draw": Stage(
        ("chunk",), (), ("ledger", "registry", "kept", "chunks", "studies"),
        "stage draw {ledger} {chunk} [--kept {kept}] [--chunk-files {chunks}]"
        " [--study-files {studies}] --output {output}",
        ("results/{paper}/draws/{chunk}.json",), "logs/{paper}/draws/{chunk}.log",
    ),
    "robustness": Stage(
        (), (), ("ledger", "registry", "kept", "chunks", "studies"),
        "stage robustness {ledger} --draws {draws} [{flips}] [--kept {kept}]"
        " [--chunk-files {chunks}] [--study-files {studies}] --output {output}",
        ("results/{paper}/robustness.json",), "logs/{paper}/robustness.log",
    ),
    "sensitivity": Stage(
        (), (), ("ledger", "registry", "robustness"),
        "stage sensitivity {ledger} {robustness} --outputs {output}",
        ("results/{paper}/specification.{format}", "results/{paper}/sensitivity.{format}"),
        "logs/{paper}/sensitivity.log",
    ),
    "claims": Stage(
        (), (), ("ledger", "registry", "numbers", "robustness"),
        "stage claims {claimed} --output {output}",
        ("results/claims.csv",), "logs/claims.log",
    ),
    "report": Stage(
        (), (), ("products", "claims", "sensitivity"),
        "report --papers {papers} --formats {formats} --output {output}",
        ("results/report.html",), "logs/report.log",
    ),
    "verdicts": Stage(
        (), (), ("claims", "report"),
        "stage verdicts {claims} --output {output}",
        ("results/verdicts.md",), "logs/verdicts.log",
    ),
    "archive": Stage(
        (), (), ("products", "claims", "report", "verdicts"),
        "stage archive --papers {papers} --formats {formats} --output {output}",
        ("results/archive.zip",), "logs/archive.log",
    ),
}
# fmt: on


def paper_part(paper: str, part: str) -> str:
    """The name of the module in which a paper has a part: its own, or that of the whole paper."""
    whole = (_PAPERS / f"{paper}.py").is_file()
    return f"reobserve.papers.{paper}" if whole else f"reobserve.papers.{paper}.{part}"


def seen(ledger: Ledger, stage: str, name: str = "") -> dict[str, Any]:
    """The branches of the ledger that a job sees, as plain values.

    ``name`` is the last of what it is about: an observer sees nothing of the scenario that it runs
    in, which is in the record. A theory sees sections whole, those that the paper lacks as empty.

    Raises
    ------
    InputError
        If the ledger has nothing of that name.
    """
    about = (STAGES[stage].about or ("",))[-1]
    body = ledger.section(SECTIONS[about], name) if about else {}
    branches: dict[str, Any] = {}
    for word in STAGES[stage].sees:
        if word == about:
            branches[word] = body
        elif word == "seed":
            branches[word] = ledger.seed
        elif word in ("plant", "metrics"):
            branches[word] = ledger.section(word)
        elif not about:
            branches[word] = ledger.section(word) if word in ledger.tree else {}
        elif word == "observers":
            branches[word] = {one: ledger.section(word, one) for one in body[word]}
        elif word != "designs":
            if word in body:
                branches[word] = ledger.section(SECTIONS[word], body[word])
        elif found := _designs_behind(ledger, body, branches.get("study", {})):
            branches[word] = {one: ledger.section(word, one) for one in found}
    return branches


def _designs_behind(ledger: Ledger, *bodies: Mapping[str, Any]) -> Iterable[str]:
    """The designs of a figure or a study, its own and its observers'."""
    users = [
        user
        for body in bodies
        for user in (*(ledger.section("observers", one) for one in body.get("observers", ())), body)
    ]
    return dict.fromkeys(user["design"] for user in users if "design" in user)

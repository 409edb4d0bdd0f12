# What the rules need to know: the checked ledgers, and what each job depends on.

import re
import shlex
import sys
from functools import cache
from pathlib import Path

from reobserve.errors import InputError, ReobserveError, shown
from reobserve.ledger.config import check_config, known_papers, read_yaml, take_truths
from reobserve.evidence.claims.registry import claims_file, decisive
from reobserve.ledger.ledger import Ledger, digest
from reobserve.ledger.types import read_ledger
from reobserve.pipeline.provenance import code_digest, closure_digest, versions
from reobserve.timeseries.signals import sample_files

PROJECT = Path()  # the working directory, as everywhere in Snakemake

# Jobs run what runs Snakemake, also where its environment is not activated. With conda they run
# what the environment of their rule holds. A prefix takes the place of Snakemake's strict mode,
# so that must be said here: without it the failure of a step before a pipe goes unnoticed.
if not workflow.deployment_settings.deployment_method:
    shell.prefix(
        f"set -euo pipefail; export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH; "
    )


def load_ledgers():
    """The ledgers of all papers, with the overrides of this call; one sentence if one is wrong.

    Every key is checked here, also for a dry run; `write_ledgers` builds what they state.
    """
    try:
        papers = known_papers(PROJECT)
        take_truths(config)
        check_config(PROJECT, config, papers)
        ledgers = {
            paper: Ledger.load(PROJECT, paper, config.get(paper), config["seed"])
            for paper in papers
        }
        for ledger in ledgers.values():
            read_ledger(ledger)
            check_files(ledger)
        return ledgers
    except ReobserveError as error:
        sys.exit(f"reobserve: {error}")


def check_files(ledger):
    """Refuse names of files that Snakemake takes for patterns, wherever entries state them."""
    for key, entry in ledger.entries():
        files = sample_files(entry["value"])
        if entry["unit"] == "file":
            files.append(str(entry["value"]))
        for file in files:
            if set(file) & set("{}"):
                problem = (
                    f"{shown(file)} has braces in its name, which stand for wildcards"
                )
                raise InputError(f"{ledger.paper}.{key}", problem)


LEDGERS = load_ledgers()

# The report shows one format of each drawing: vectors where there are any.
REPORTED = next(kind for kind in ("svg", "png", "pdf") if kind in config["formats"])


# Papers that are built and have a registry of claims; one of the user's own need not.
CLAIMED = [paper for paper in config["papers"] if claims_file(PROJECT, paper).exists()]


def products():
    """The figures with their numbers, and the tables."""
    figures = [
        f"results/{paper}/{figure}.{suffix}"
        for paper in config["papers"]
        for figure in LEDGERS[paper].tree["figures"]
        for suffix in (*config["formats"], "metrics.csv")
    ]
    tables = [
        f"results/{paper}/{table}.csv"
        for paper in config["papers"]
        for table in LEDGERS[paper].tree.get("tables", {})
    ]
    return figures + tables


def numbers():
    """The numbers that claims may name: those of all figures and of the theory."""
    figures = [
        f"results/{paper}/{figure}.metrics.csv"
        for paper in CLAIMED
        for figure in LEDGERS[paper].tree["figures"]
    ]
    return figures + [
        f"results/{paper}/theory.metrics.csv"
        for paper in CLAIMED
        if "theory" in LEDGERS[paper].tree
    ]


@cache
def claims_of(paper):
    """A registry as it stands; what is wrong with one is said by those who read it in earnest."""
    try:
        return read_yaml(claims_file(PROJECT, paper))
    except ReobserveError as error:
        return {"problem": str(error)}


def drawn_from(paper):
    """What the robustness of a paper's claims depends on: the ledger, its ranges, the checks."""
    entries = {
        key: {
            name: part for name, part in entry.items() if name not in ("why", "source")
        }
        for key, entry in LEDGERS[paper].entries()
    }
    return [entries, LEDGERS[paper].seed, decisive(claims_of(paper))]


def told_of_claims():
    """What the table of claims depends on besides numbers."""
    return [[claims_of(paper), dict(LEDGERS[paper].entries())] for paper in CLAIMED]


def told_in_report():
    """What the report shows besides results: the wording of config and its own template."""
    folders = [PROJECT / "config", PROJECT / "workflow" / "report"]
    files = sorted(path for folder in folders for path in folder.rglob("*.*"))
    return [
        [path.as_posix(), path.read_text(encoding="utf-8")]
        for path in files
        if path.is_file()
    ]


def report_options():
    """What this call builds, where it may differ from the config."""
    return ["--papers", *config["papers"], "--formats", *config["formats"]]


def all_designs(paper):
    """All designs of a paper, in the order of its ledger."""
    return [
        f"results/{paper}/{design}.design.json"
        for design in LEDGERS[paper].tree.get("designs", {})
    ]


def names(section):
    """A wildcard constraint: the names that any paper has in a section of its ledger."""
    found = {
        name for ledger in LEDGERS.values() for name in ledger.tree.get(section, {})
    }
    return any_of(found) or "none"


def any_of(names):
    """A pattern that matches these names and nothing else."""
    return "|".join(map(re.escape, sorted(names)))


def settings(stage, name, observer=None):
    """A params function: the digest of all that a job of this stage takes from the ledger."""

    def inner(wildcards):
        tree = LEDGERS[wildcards.paper].settings(
            stage, wildcards[name], wildcards[observer] if observer else ""
        )
        return digest(tree)

    return inner


def code(stage):
    """A params function: the digest of all modules that the stage of this paper imports."""
    return lambda wildcards: code_digest(stage, wildcards.paper)


def digest_of(module):
    """A params function: the digest of a module that serves all papers, and of its imports."""
    return lambda wildcards: closure_digest(["reobserve.__main__", module])


def packages(wildcards):
    """A params function: the installed versions of what can move a number or a picture."""
    return digest(versions())


def ledger_file(wildcards):
    """The ledger as this build resolves it; `write_ledgers` puts it there."""
    return ledger_path(wildcards.paper)


def ledger_path(paper):
    return f"results/{paper}/ledger.json"


def signal_files(wildcards):
    """The user's files that the signals of a scenario read."""
    ledger = LEDGERS[wildcards.paper]
    values = {
        **ledger.section("plant"),
        **ledger.section("scenarios", wildcards.scenario),
    }
    return [file for value in values.values() for file in sample_files(value)]


def record_of(section, wildcard):
    """An input function: the plant record that a study, a search or a figure runs on."""

    def inner(wildcards):
        body = LEDGERS[wildcards.paper].tree[section][wildcards[wildcard]]
        return f"results/{wildcards.paper}/{body['scenario']}/plant.parquet"

    return inner


def study_files(wildcards):
    """The files that entries of a study name, such as what a search has found."""
    body = LEDGERS[wildcards.paper].tree["studies"][wildcards.study]
    entries = [entry for entry in body.values() if isinstance(entry, dict)]
    return [entry["value"] for entry in entries if entry["unit"] == "file"]


def named_design(section, wildcard):
    """An input function: the design that an observer, a study or a table names, if it does."""

    def inner(wildcards):
        body = LEDGERS[wildcards.paper].section(section, wildcards[wildcard])
        if "design" not in body:
            return []
        return f"results/{wildcards.paper}/{body['design']}.design.json"

    return inner


def design_option(wildcards, input):
    return ["--design-file", input.design] if input.design else []


def figure_estimates(wildcards):
    """The estimates behind a figure, in the order in which it names its observers."""
    body = LEDGERS[wildcards.paper].tree["figures"][wildcards.figure]
    folder = f"results/{wildcards.paper}/{body['scenario']}"
    return [f"{folder}/{observer}.parquet" for observer in body["observers"]]


def figure_study(wildcards):
    """The study behind a figure, if it has one."""
    study = LEDGERS[wildcards.paper].tree["figures"][wildcards.figure].get("study")
    return [f"results/{wildcards.paper}/{study}.study.csv"] if study else []


def study_option(wildcards, input):
    return ["--study-file", *input.study] if input.study else []


def caption_template(wildcards):
    """The figure's own caption, or the general one for a figure that a user added."""
    own = PROJECT / "workflow" / "report" / wildcards.paper / f"{wildcards.figure}.rst"
    name = f"{wildcards.paper}/{wildcards.figure}" if own.exists() else "figure"
    return f"workflow/report/{name}.rst"


def table_caption(wildcards):
    """The table's own caption in the report, or the general one."""
    own = f"workflow/report/{wildcards.paper}/{wildcards.table}.rst"
    return own if (PROJECT / own).exists() else "workflow/report/table.rst"


def caption_partials(wildcards):
    """What the captions of a paper share."""
    folder = PROJECT / "workflow" / "report" / wildcards.paper
    return sorted(str(path) for path in folder.glob("_*.rst"))

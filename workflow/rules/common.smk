# What the rules need to know: the checked ledgers, what each job depends on, and who builds.

import fcntl
import json
import shlex
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

from reobserve.errors import ReobserveError
from reobserve.ledger import Ledger, check_schema, digest, known_papers
from reobserve.provenance import code_digest, versions
from reobserve.signals import sample_files

PROJECT = Path()  # the working directory, as everywhere in Snakemake

# Jobs find the interpreter that runs Snakemake, also where the environment is not activated.
shell.prefix(f"export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH; ")


def load_ledgers():
    """The ledgers of all papers, with the overrides of this call."""
    try:
        check_schema(PROJECT, "config", config, "config")
        papers = known_papers(PROJECT)
        for key in set(config) - {"papers", "formats", "seed"} | set(config["papers"]):
            if key not in papers:
                raise WorkflowError(
                    f"config.{key}: there is no such key or paper; the keys are papers, "
                    f"formats and seed, the papers {', '.join(papers)}"
                )
        return {
            paper: Ledger.load(PROJECT, paper, config.get(paper), config["seed"])
            for paper in papers
        }
    except ReobserveError as error:
        raise WorkflowError(str(error)) from None


LEDGERS = load_ledgers()

# The report shows one format of each drawing: vectors where there are any.
REPORTED = next(kind for kind in ("svg", "png", "pdf") if kind in config["formats"])


def all_figures():
    """The files that a plain `snakemake` builds."""
    return [
        f"results/{paper}/{figure}.{suffix}"
        for paper in config["papers"]
        for figure in LEDGERS[paper].tree["figures"]
        for suffix in (*config["formats"], "metrics.csv")
    ]


def names(section):
    """A wildcard constraint: the names that any paper has in a section of its ledger."""
    found = {name for ledger in LEDGERS.values() for name in ledger.tree.get(section, {})}
    return "|".join(sorted(found)) or "none"


def overrides_of(wildcards):
    """The overrides of this call as an argument of `reobserve ledger`, empty if there are none."""
    tree = config.get(wildcards.paper)
    return f"--overrides {shlex.quote(json.dumps(tree, sort_keys=True))}" if tree else ""


def settings(stage, name, observer=None):
    """A params function: the digest of all that a job of this stage takes from the ledger."""

    def inner(wildcards):
        try:
            tree = LEDGERS[wildcards.paper].settings(
                stage, wildcards[name], wildcards[observer] if observer else ""
            )
        except ReobserveError as error:
            raise WorkflowError(str(error)) from None
        return digest(tree)

    return inner


def code(stage):
    """A params function: the digest of all modules that the stage of this paper imports."""
    return lambda wildcards: code_digest(stage, wildcards.paper)


def packages(wildcards):
    """A params function: the installed versions of what can move a number or a picture."""
    return digest(versions())


def ledger_file(wildcards):
    return f"results/{wildcards.paper}/ledger.json"


def signal_files(wildcards):
    """The user's files that the signals of a scenario read."""
    ledger = LEDGERS[wildcards.paper]
    values = {
        **ledger.section("plant"),
        **ledger.section("scenarios", wildcards.scenario),
    }
    return [file for value in values.values() for file in sample_files(value)]


def study_record(wildcards):
    """The plant record that a study runs on."""
    scenario = LEDGERS[wildcards.paper].tree["studies"][wildcards.study]["scenario"]
    return f"results/{wildcards.paper}/{scenario}/plant.parquet"


def figure_record(wildcards):
    """The plant record behind a figure."""
    scenario = LEDGERS[wildcards.paper].tree["figures"][wildcards.figure]["scenario"]
    return f"results/{wildcards.paper}/{scenario}/plant.parquet"


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
    return f"--study-file {input.study}" if input.study else ""


def caption_template(wildcards):
    """The figure's own caption, or the general one for a figure that a user added."""
    own = PROJECT / "workflow" / "report" / wildcards.paper / f"{wildcards.figure}.rst"
    name = f"{wildcards.paper}/{wildcards.figure}" if own.exists() else "figure"
    return f"workflow/report/{name}.rst"


def take_build_lock():
    """Hold the folder for this build, or say who holds it."""
    global build_lock
    build_lock = open(".snakemake/build.lock", "a+")
    try:
        fcntl.flock(build_lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise WorkflowError("another build is running in this folder; wait for it to end") from None

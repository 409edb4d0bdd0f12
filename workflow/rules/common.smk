# What the rules need to know: the checked ledgers, the graph of their jobs, and what these depend on.

import re
import shlex
import sys
from functools import cache
from pathlib import Path

from reobserve.errors import InputError, ReobserveError, shown
from reobserve.ledger.config import check_config, known_papers, read_yaml, take_truths
from reobserve.evidence.claims.registry import claims_file, decisive
from reobserve.ledger.ledger import Ledger, digest
from reobserve.ledger.stages import AGELESS, STAGES, paper_part, style_sheet
from reobserve.ledger.types import read_ledger
from reobserve.pipeline.jobs import Graph
from reobserve.pipeline.provenance import code_digest, closure_digest, versions
from reobserve.timeseries.signals import sample_files

PROJECT = Path()  # the working directory, as everywhere in Snakemake

# Jobs run what runs Snakemake, also where its environment is not activated. With conda they run
# what the environment of their rule holds. A prefix takes the place of Snakemake's strict mode,
# so that must be said here: without it the failure of a step before a pipe goes unnoticed.
PREFIX = f"set -euo pipefail; export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH; "
DEPLOYED = bool(workflow.deployment_settings.deployment_method)
if not DEPLOYED:
    shell.prefix(PREFIX)


def load_ledgers():
    """The ledgers of all papers, with the overrides of this call; one sentence if one is wrong.

    Every key is checked here, also for a dry run; `write_ledgers` builds what they state.
    """
    try:
        papers = known_papers(PROJECT)
        take_truths(config)
        check_config(PROJECT, config, papers)
        config.setdefault("papers", papers)
        for key, usual in {"style": "default", "notes": True, "latex": False}.items():
            config.setdefault(key, usual)
        check_style(config["style"])
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


def check_style(name):
    """Read the sheet of a style before the first job; only where one is chosen, for this takes matplotlib."""
    if name != "default":
        from reobserve.drawing.look import read_sheet

        read_sheet(PROJECT / style_sheet(name))


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

GRAPH = Graph(
    LEDGERS,
    **{
        key: config[key]
        for key in (
            "papers",
            "formats",
            "draws",
            "flips",
            "kept",
            "chunks",
            "style",
            "notes",
        )
    },
)

# What a job runs and what it leaves in its log: its one command first, then what it says.
RUN = "(set -x; reobserve {params.command}) > {log:q} 2>&1"
RUN_AND_TELL = "(set -x; reobserve {params.command}) 2>&1 | tee {log:q} >&2"


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


def drawn_of_claims(paper):
    """What the pictures of a paper's draws depend on: the checks, and which claims are main ones."""
    tree = claims_of(paper)
    return [
        decisive(tree),
        [name for name, body in tree.get("claims", {}).items() if body.get("headline")],
    ]


def told_of_claims():
    """What the table of claims depends on besides numbers."""
    return [
        [claims_of(paper), dict(LEDGERS[paper].entries())] for paper in GRAPH.claimed
    ]


def told_in_report():
    """What the report shows besides results: the wording of config and its own template."""
    folders = [PROJECT / "config", PROJECT / "workflow" / "report"]
    files = sorted(path for folder in folders for path in folder.rglob("*.*"))
    return [
        [path.as_posix(), path.read_text(encoding="utf-8")]
        for path in files
        if path.is_file()
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


def job(stage, wildcards):
    """The job of a stage that these wildcards stand for."""
    return GRAPH.job(stage, **dict(wildcards.items()))


def built(*jobs):
    """The files that these jobs write."""
    return [path for one in jobs for path in one.outputs]


def inputs(stage):
    """An input function: all files that a job reads and whose age counts, by role."""
    return lambda wildcards: job(stage, wildcards).inputs


def ageless_inputs(stage):
    """An input function: the same files, which must be there, but whose age does not count."""
    return lambda wildcards: {
        role: ancient(paths) for role, paths in job(stage, wildcards).inputs.items()
    }


def outputs(stage):
    """The paths that jobs of a stage write, with wildcards; of a figure that first that is shown."""
    return GRAPH.makes(stage)


def log_of(stage, suffix=".log"):
    """The log of a stage's jobs, with wildcards; what they take stands beside it."""
    return STAGES[stage].log.removesuffix(".log") + suffix


def command(stage):
    """A params function: what a job asks of `reobserve`."""
    return lambda wildcards: job(stage, wildcards).command


def settings(stage):
    """A params function: the digest of all that a job takes from the ledger."""
    return lambda wildcards: digest(job(stage, wildcards).settings)


def sheet(wildcards):
    """A params function: the digest of the style sheet that figures are drawn with."""
    path = PROJECT / style_sheet(config["style"])
    return digest(path.read_text(encoding="utf-8") if path.is_file() else "")


def code(stage):
    """A params function: the digest of all modules that the stage of this paper imports."""
    return lambda wildcards: code_digest(stage, wildcards.paper)


def digest_of(module):
    """A params function: the digest of a module that serves all papers, and of its imports."""
    return lambda wildcards: closure_digest(["reobserve.__main__", module])


def packages(wildcards):
    """A params function: the installed versions of what can move a number or a picture."""
    return digest(versions())


def table_caption(wildcards):
    """The table's own caption in the report, or the general one."""
    return GRAPH.caption(wildcards.paper, wildcards.table, "table")

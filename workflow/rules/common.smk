# The parameters of all papers, and what a job depends on besides its input files: the parameter
# values that it reads, the code that it imports, and the versions of packages.

import re
import shlex
import sys
from functools import cache
from pathlib import Path

from reobserve.errors import ReobserveError
from reobserve.evidence.claims.registry import decisive
from reobserve.ledger.config import check_config_files, read_yaml
from reobserve.ledger.names import caption_template, claims_path, samples_path, style_sheet
from reobserve.replication.prepare import check_metadata, load_parameters, write_parameters
from reobserve.replication.provenance import code_digest, closure_digest, versions
from reobserve.timeseries.signals import sample_files

# Jobs use the environment that runs Snakemake, activated or not; with conda, that of their rule.
if not workflow.deployment_settings.deployment_method:
    here = shlex.quote(str(Path(sys.executable).parent))
    shell.prefix(f"set -euo pipefail; export PATH={here}:$PATH; ")

try:
    check_metadata(Path())
    check_config_files("config/config.yaml", *workflow.configfiles)
    configfile: "config/config.yaml"
    PARAMETERS = load_parameters(Path(), config)
except ReobserveError as error:
    sys.exit(f"reobserve: {error}")

PAPERS = config["papers"]
CLAIMED = [paper for paper in PAPERS if Path(claims_path(paper)).is_file()]
FORMATS = sorted(config["formats"], key=["svg", "png", "pdf", "eps", "pgf"].index)
BUILT = f"--papers {' '.join(PAPERS)} --formats {' '.join(FORMATS)}"  # reports show the first format
PACKAGES = versions()

def names(section, paper):
    """The names in a section of a parameter file."""
    return list(PARAMETERS[paper].tree.get(section, {}))

def each(pattern, section):
    """The files of a pattern with {paper} and {name}: one for each name in a section."""
    return [pattern.format(paper=paper, name=name) for paper in PAPERS for name in names(section, paper)]

def each_of_paper(pattern, section):
    """An input function: the same for the paper of a job."""
    return lambda wildcards: expand(pattern, paper=wildcards.paper, name=names(section, wildcards.paper))

FIGURES = [path for kind in (*FORMATS, "caption.rst") for path in each("results/{paper}/{name}." + kind, "figures")]
TABLES = each("results/{paper}/{name}.csv", "tables")
THEORIES = [f"results/{paper}/theory.metrics.csv" for paper in PAPERS if "theory" in PARAMETERS[paper].tree]
NUMBERS = each("results/{paper}/{name}.metrics.csv", "figures") + THEORIES
WORDS = [path for path in (*FIGURES, *TABLES, *NUMBERS) if path.endswith((".rst", ".csv"))]
LATEX = [str(Path(path).with_suffix(".tex")) for path in WORDS if config["latex"]]

def one_of(section):
    return "|".join(sorted({name for paper in PARAMETERS for name in names(section, paper)})) or "none"

wildcard_constraints:
    paper="|".join(PARAMETERS), scenario=one_of("scenarios"), observer=one_of("observers"),
    design=one_of("designs"), study=one_of("studies"), search=one_of("searches"),
    table=one_of("tables"), figure=one_of("figures"), chunk=r"\d+-\d+"

def settings(step, about=None):
    """A params function: the parameter values that a step reads; a changed one reruns the job."""
    return lambda wildcards: PARAMETERS[wildcards.paper].settings(step, wildcards[about] if about else "")

def code(step):
    """A params function: a digest of all modules that a step of the paper imports."""
    return lambda wildcards: code_digest(step, wildcards.paper)

def code_of(module):
    """A digest of a module that serves all papers, and of its imports."""
    return closure_digest(["reobserve.__main__", module])

@cache
def claims_of(paper):
    """The claims of a paper; the step that decides them says what is wrong with the file."""
    try:
        return read_yaml(Path(claims_path(paper)))
    except ReobserveError as error:
        return {"problem": str(error)}

def text_of(*folders):
    """The text of all files in folders: what the report shows besides results."""
    files = sorted(path for folder in folders for path in Path(folder).rglob("*.*") if path.is_file())
    return {str(path): path.read_text(encoding="utf-8") for path in files}

# No rule makes these files: Snakemake does not see that the params of a job have changed while a
# job before it, whose output it takes as `ancient`, has yet to run.
onstart:
    write_parameters(Path(), PARAMETERS, config)

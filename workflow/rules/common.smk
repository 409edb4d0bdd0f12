# The parameters of papers, and what a job depends on besides input files: values that it reads,
# code, versions.

import shlex
import sys
from pathlib import Path

from reobserve.core.command_line import collect_rarely
from reobserve.core.documents import read_yaml
from reobserve.core.files import check_folder
from reobserve.core.import_closure import closure_digest
from reobserve_papers.claims.claims_digest import claims_digest
from reobserve_papers.claims.configuration_checks import checked_papers
from reobserve_papers.claims.registry import has_claims
from reobserve_papers.cli.job_lines import print_job_lines
from reobserve_papers.cli.options import FORMATS as ALL_FORMATS
from reobserve_papers.cli.own_modules import refused_in_one_sentence
from reobserve_papers.cli.targets import check_targets
from reobserve_papers.parameters.config import check_config_files, known_tasks
from reobserve_papers.parameters.names import caption_template
from reobserve_papers.parameters.names import style_sheet
from reobserve_papers.parameters.prepare import check_folders, load_parameters
from reobserve_papers.parameters.prepare import refuse_beside_another_build, write_parameters
from reobserve_papers.parameters.step_kinds import KINDS, SECTIONS
from reobserve_papers.steps.chain import CLAIM_PLOTS, all_outputs, inputs
from reobserve_papers.steps.freshness import check_code, mark_unrecorded
from reobserve_papers.steps.provenance import code_digest, files_digest
from reobserve_papers.steps.provenance import shared_digest, versions
from snakemake.logging import logger

collect_rarely()
print_job_lines(workflow, logger)

# Jobs use the environment that runs Snakemake, activated or not; with conda, that of their rule.
if not workflow.deployment_settings.deployment_method:
    here = shlex.quote(str(Path(sys.executable).parent))
    shell.prefix(f"set -euo pipefail; PS4='+ '; export PATH={here}:$PATH; ")


with refused_in_one_sentence():
    check_code(Path())
    check_folders(Path())
    check_config_files("config/config.yaml", *workflow.configfiles)


configfile: "config/config.yaml"


with refused_in_one_sentence():
    PARAMETERS = load_parameters(Path(), config)
    checked = checked_papers(Path(), PARAMETERS, config)
    if not workflow.dryrun and "--unlock" not in sys.argv:
        refuse_beside_another_build(Path(), PARAMETERS)
        if "--nolock" not in sys.argv:
            check_folder(Path(".snakemake/locks/0.input.lock"))
    if workflow.is_main_process:
        mark_unrecorded(Path())

PAPERS = config["papers"]
CLAIMED = [paper for paper in PAPERS if has_claims(Path(), paper)]
FORMATS = sorted(config["formats"], key=["svg", "png", "pdf", "eps", "pgf"].index)
BENCH = config["bench"]
BUILT = f"--papers {' '.join(PAPERS)} --formats {' '.join(FORMATS)} --bench {' '.join(BENCH)}"
PACKAGES = versions()


def names(section, paper):
    """The names in a section of a parameter file."""
    return list(PARAMETERS[paper].tree.get(section, {}))


def each(pattern, section):
    """The files of a pattern with {paper} and {name}: one for each name in a section."""
    return [
        pattern.format(paper=paper, name=name) for paper in PAPERS for name in names(section, paper)
    ]


FIGURES = [
    path
    for kind in (*FORMATS, "caption.rst")
    for path in each(f"results/{{paper}}/{{name}}.{kind}", "figures")
]
TABLES = each("results/{paper}/{name}.csv", "tables")
NUMBERS = each("results/{paper}/{name}.metrics.csv", "figures") + [
    f"results/{paper}/theory.metrics.csv" for paper in PAPERS if "theory" in PARAMETERS[paper].tree
]
WORDS = [path for path in (*FIGURES, *TABLES, *NUMBERS) if path.endswith((".rst", ".csv"))]
LATEX = [str(Path(path).with_suffix(".tex")) for path in WORDS if config["latex"]]


# What pages say, beside numbers: a digest of it is among the params of the report.
TEXTS = [
    str(path)
    for folder in ("config", "workflow/report")
    for path in sorted(Path(folder).rglob("*.*"))
    if path.is_file() and not path.name.startswith(".")
]


def of_task(task):
    """The figures of a task of the bench; of a detector also delays over false alarms."""
    rated = any(
        "rate" in one.get("plant", {})
        for one in read_yaml(f"config/bench/{task}.yaml")["conditions"].values()
    )
    return [
        f"results/bench/{task}/{name}"
        for name in ("heatmap", "levels", "evaluations", *["detection"] * rated)
    ]


def of_bench(tasks, formats):
    """The figures and tables of tasks."""
    figures = [f"{path}.{kind}" for task in tasks for path in of_task(task) for kind in formats]
    return figures + expand("results/bench/{task}/table.csv", task=tasks)


OF_BENCH = of_bench(BENCH, FORMATS)
# The report shows these, and builds none.
BENCH_BUILT = [path for path in OF_BENCH if Path(path).is_file()]


def all_results():
    """The files of all papers and tasks, figures in all formats."""
    files = [path for paper in PARAMETERS.values() for path in all_outputs(paper, ALL_FORMATS)]
    tasks = known_tasks(Path())
    files += expand("results/bench/{task}/{of}.csv", task=tasks, of=["scores", "moved"])
    return files + of_bench(tasks, ALL_FORMATS)


def one_of(section):
    return (
        "|".join(sorted({name for paper in PARAMETERS for name in names(section, paper)})) or "none"
    )


wildcard_constraints:
    **{about: one_of(section) for about, section in SECTIONS.items()},
    paper="|".join(PARAMETERS),
    task="|".join(known_tasks(Path())) or "none",
    method=r"\w+",


def settings(step, about=None):
    """A params function: the parameter values that a step reads; a changed one reruns the job."""
    return lambda wildcards: checked(wildcards.paper).settings(
        step, wildcards[about] if about else ""
    )


def code(step):
    """A params function: a digest of all modules that a step of the paper imports."""
    return lambda wildcards: code_digest(step, PARAMETERS[wildcards.paper].package)


def code_of(module):
    """A params function: the same of a module."""
    return lambda wildcards: shared_digest(module)


def inputs_of(step):
    """An input function: the files that a job of a step reads, beside the parameters.

    Of texts, digests in the params of a rule say whether they have changed; so they are `ancient`.
    """
    words = KINDS[step].names if step in KINDS else []

    def files(wildcards):
        papers = [wildcards.paper] if "paper" in wildcards.keys() else CLAIMED
        with refused_in_one_sentence():
            paths = [
                path
                for paper in papers
                for path in inputs(
                    checked(paper),
                    Path(),
                    step,
                    *[wildcards[word] for word in words],
                    cached=config["cached"],
                    style=config["style"],
                )
            ]
        if step == "verdicts":  # whose table may have no rows
            paths = ["results/claims.csv", *paths]
        return [ancient(path) if path.endswith(".yaml") else path for path in dict.fromkeys(paths)]

    return files


def table_caption(wildcards):
    """A params function: the caption of a table."""
    return caption_template(Path(), wildcards.paper, wildcards.table, "table")


def of_claims(part):
    """A params function: a digest of what decides claims."""
    return lambda wildcards: claims_digest(part, Path(), checked(wildcards.paper))


def tuned_settings(wildcards):
    """An input function: a file for each method of a task."""
    return expand(
        "config/bench/tuned/{task}/{method}.json",
        task=wildcards.task,
        method=methods_of(wildcards.task),
    )


def methods_of(task):
    return list(read_yaml(f"config/bench/{task}.yaml")["methods"])


def code_of_task(wildcards):
    """A params function: a digest of the task's module, of what scores and of all that they import."""
    task = f"reobserve_papers.bench.tasks.{wildcards.task}"
    return closure_digest(["reobserve.tuning.scoring", "reobserve.tuning.tuned_file", task])


# No job makes these files. Snakemake would not see that the params of a job have changed while a
# job before it, whose output it takes as `ancient`, has yet to run.
onstart:
    with refused_in_one_sentence():
        for job in workflow.dag.needrun_jobs():
            for file in (*job.output, *job.log):
                check_folder(Path(file))
    for paper in PARAMETERS:
        checked(paper)
    write_parameters(Path(), PARAMETERS, config)

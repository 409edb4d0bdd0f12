"""The stages of the pipeline as its jobs call them, or somebody who looks at one by hand."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from reobserve.cli.parts import FORMATS, add_command, add_output, add_project
from reobserve.cli.types import tree, whole

_EXAMPLES = """\
a chain, by hand:
  reobserve stage parameters ilo --output results/ilo/parameters.json
  reobserve stage plant results/ilo/parameters.json constant \\
      --output results/ilo/constant/plant.parquet
  reobserve stage observe results/ilo/parameters.json results/ilo/constant/plant.parquet sampled \\
      --output results/ilo/constant/sampled.parquet
Each command that `snakemake --printshellcmds` prints can be run the same way.
"""


def add_stages(commands: Any) -> None:
    """The stages of the pipeline, below ``reobserve stage``."""
    stages = commands.add_parser(
        "stage", help="run one stage of the pipeline by hand",
        description="Run one stage of the pipeline, as its jobs do.", epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    commands = stages.add_subparsers(title="stages", metavar="STAGE", required=True)
    _add_simulation(commands)
    _add_figures(commands)
    _add_evidence(commands)


def _add_simulation(commands: Any) -> None:
    parameters = add_command(
        commands,
        "parameters",
        "cli.stages.parameters:run",
        "check a parameter file with overrides, and write it for the other stages",
    )
    parameters.add_argument("paper", help="the name of a file in config/papers")
    parameters.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to override, such as \'{"observers": {"sampled": {"K2": 1500}}}\'',
    )  # fmt: skip
    parameters.add_argument(
        "--seed", type=whole(0), help="root of the random streams (default: that of the config)"
    )
    add_output(parameters, "the parameters, JSON")
    add_project(parameters)

    plant = add_command(
        commands, "plant", "cli.stages.plant:run", "simulate the plant of a scenario"
    )
    _parameter_file(plant)
    plant.add_argument("scenario", help="a scenario of the parameter file")
    add_output(plant, "the record, Parquet")

    design = add_command(
        commands, "design", "cli.stages.design:run", "compute a design: gains that observers share"
    )
    _parameter_file(design)
    design.add_argument("design", help="a design of the parameter file")
    add_output(design, "the design, JSON")

    observe = add_command(
        commands, "observe", "cli.stages.observe:run", "run an observer on a plant's record"
    )
    _parameter_file(observe)
    observe.add_argument("plant_file", type=Path, help="a record made by `reobserve stage plant`")
    observe.add_argument("observer", help="an observer of the parameter file")
    _design_file(observe)
    add_output(observe, "the estimates, Parquet")

    study = add_command(
        commands, "study", "cli.stages.study:run", "run a study: many runs, one table"
    )
    _parameter_file(study)
    study.add_argument("plant_file", type=Path, help="a record made by `reobserve stage plant`")
    study.add_argument("study", help="a study of the parameter file")
    _design_file(study)
    add_output(study, "the table, CSV")

    search = add_command(
        commands,
        "search",
        "cli.stages.search:run",
        "search for values that the paper does not state",
    )
    _parameter_file(search)
    search.add_argument("plant_file", type=Path, help="a record made by `reobserve stage plant`")
    search.add_argument("search", help="a search of the parameter file")
    add_output(search, "the result, JSON")


def _add_figures(commands: Any) -> None:
    table = add_command(
        commands, "table", "cli.stages.table:run", "compute a table of the paper from a design"
    )
    _parameter_file(table)
    table.add_argument("table", help="a table of the parameter file")
    _design_file(table, required=True)
    add_output(table, "the table, CSV")

    metrics = add_command(
        commands, "metrics", "cli.stages.metrics:run", "compute the metrics of a figure"
    )
    _figure_inputs(metrics)
    add_output(metrics, "the table, CSV")

    plot = add_command(
        commands, "plot", "cli.stages.plot:run", "plot a figure and write its caption"
    )
    _figure_inputs(plot)
    plot.add_argument(
        "--metrics-file", type=Path, required=True, help="from `reobserve stage metrics`"
    )
    plot.add_argument("--template", type=Path, required=True, help="the template of the caption")
    plot.add_argument("--caption", type=Path, required=True, help="the caption to write")
    plot.add_argument(
        "--outputs", type=Path, nargs="+", required=True,
        help=f"the figure, in any of {', '.join(FORMATS)}",
    )  # fmt: skip
    plot.add_argument(
        "--style", type=Path, nargs="?", metavar="FILE", help="a matplotlib style sheet"
    )
    plot.add_argument(
        "--no-notes", dest="notes", action="store_false", help="put the notes into the caption"
    )


def _add_evidence(commands: Any) -> None:
    theory = add_command(
        commands, "theory", "cli.stages.theory:run", "compute the metrics of a paper's theory"
    )
    _parameter_file(theory)
    theory.add_argument(
        "--design-files", type=Path, nargs="*", default=[],
        help="from `reobserve stage design`, in the order of the parameter file",
    )  # fmt: skip
    add_output(theory, "the table, CSV")

    robustness = add_command(
        commands, "robustness", "cli.stages.robustness:run",
        "decide a paper's claims with samples of what it leaves open",
    )  # fmt: skip
    _parameter_file(robustness)
    most = "maximum number of samples per claim"
    robustness.add_argument("--samples", type=whole(1, 1_000_000), required=True, help=most)
    robustness.add_argument(
        "--no-reversals", dest="reversals", action="store_false",
        help="skip the search for the smallest change that reverses a claim, the slowest part",
    )  # fmt: skip
    robustness.add_argument(
        "--chunk-files", type=Path, nargs="*", default=[], metavar="FILE",
        help="from `reobserve stage sample`; missing samples are computed here",
    )  # fmt: skip
    _what_is_known(robustness)
    add_output(robustness, "shares and smallest changes, JSON")
    add_project(robustness)

    sample = add_command(
        commands,
        "sample",
        "cli.stages.sample:run",
        "compute a chunk of samples for `robustness`",
    )
    _parameter_file(sample)
    sample.add_argument("chunk", help="numbers of its first and last sample, such as 50-99")
    _what_is_known(sample)
    add_output(sample, "the samples, JSON")
    add_project(sample)

    sensitivity = add_command(
        commands, "sensitivity", "cli.stages.sensitivity:run",
        "plot specification curves, and the choices that decide claims which depend on them",
    )  # fmt: skip
    _parameter_file(sensitivity)
    sensitivity.add_argument("robustness_file", type=Path, help="from `reobserve stage robustness`")
    text = "the figures specification and sensitivity, in any of the formats"
    sensitivity.add_argument("--outputs", type=Path, nargs="+", required=True, help=text)
    add_project(sensitivity)

    claims = add_command(commands, "claims", "cli.stages.claims:run", "decide all claims")
    claims.add_argument("paper", nargs="*", help="papers whose figures are built")
    claims.add_argument(
        "--results",
        type=Path,
        default=Path("results"),
        help="the folder of results (default: results)",
    )
    add_output(claims, "the table, CSV")
    add_project(claims)

    verdicts = add_command(
        commands, "verdicts", "cli.stages.verdicts:run", "count verdicts; fail if a claim is broken"
    )
    verdicts.add_argument("claims_file", type=Path, help="from `reobserve stage claims`")
    add_output(verdicts, "the counts, Markdown")

    archive = add_command(
        commands,
        "archive",
        "cli.stages.archive:run",
        "pack a build as an RO-Crate, for deposit",
    )
    archive.add_argument("products", nargs="+", help="files in results, made by a build")
    add_output(archive, "the crate, .zip")
    add_project(archive)


def _parameter_file(command: argparse.ArgumentParser) -> None:
    command.add_argument("parameter_file", type=Path, help="made by `reobserve stage parameters`")


def _design_file(command: argparse.ArgumentParser, *, required: bool = False) -> None:
    text = "from `reobserve stage design`" + (
        "" if required else ", if the parameter file names a design"
    )
    command.add_argument(
        "--design-file", type=Path, required=required, nargs=None if required else "?",
        metavar="FILE", help=text,
    )  # fmt: skip


def _what_is_known(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--cached", type=Path, nargs="?", metavar="FILE",
        help="cached samples, of which only some are repeated",
    )  # fmt: skip
    command.add_argument(
        "--study-files", type=Path, nargs="*", default=[], metavar="FILE",
        help="from `reobserve stage study`, in the order of the parameters; else computed here",
    )  # fmt: skip


def _figure_inputs(command: argparse.ArgumentParser) -> None:
    _parameter_file(command)
    command.add_argument("figure", help="a figure of the parameter file")
    command.add_argument(
        "--plant-file", type=Path, required=True, help="from `reobserve stage plant`"
    )
    command.add_argument(
        "--estimate-files", type=Path, nargs="+", required=True,
        help="from `reobserve stage observe`, in the order of the figure's observers",
    )  # fmt: skip
    command.add_argument(
        "--study-file",
        type=Path,
        nargs="?",
        metavar="FILE",
        help="from `reobserve stage study`, if the figure has one",
    )

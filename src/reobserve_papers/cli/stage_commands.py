"""The stages of the pipeline as its jobs call them, or somebody who looks at one by hand."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from reobserve.core.command_line import Command, CommandTable
from reobserve_papers.cli.options import FORMATS, add_output, add_project
from reobserve_papers.cli.types import tree, whole
from reobserve_papers.parameters.step_kinds import KINDS

_EXAMPLES = """\
a chain, by hand:
  reobserve-papers stage parameters ilo --output results/ilo/parameters.json
  reobserve-papers stage plant results/ilo/parameters.json constant
  reobserve-papers stage observe results/ilo/parameters.json constant sampled
Each command that `snakemake --printshellcmds` prints can be run the same way.
"""


# Besides the steps of papers.
_STAGES = {
    "parameters": "check a parameter file with overrides, and write it for the other stages",
    **{step: kind.text for step, kind in KINDS.items()},
    "robustness": "compute the samples that decide a paper's claims",
    "sensitivity": "plot the alternatives, and the choices that decide claims",
    "alternatives": "decide a paper's claims by every alternative to a convention",
    "claims": "decide all claims",
    "verdicts": "count verdicts; fail if a claim is broken",
    "archive": "pack a build as an RO-Crate, for deposit",
}


def step_options(step: str, command: argparse.ArgumentParser) -> None:
    """Add the options of a step of `KINDS`: the words that name it."""
    _parameter_file(command)
    for word in KINDS[step].names:
        article = "an" if word[0] in "aeiou" else "a"
        command.add_argument(word, help=f"{article} {word} of the parameter file")
    if step == "plot":
        _formats(command)
        command.add_argument("--style", default="", help="a style sheet of config/styles")
        command.add_argument(
            "--no-notes", dest="notes", action="store_false", help="put the notes into the caption"
        )
    else:
        command.set_defaults(step=step)


def parameters_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `parameters`."""
    command.add_argument("paper", help="the name of a file in config/papers")
    command.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to override, such as \'{"observers": {"sampled": {"K2": 1500}}}\'',
    )  # fmt: skip
    command.add_argument(
        "--seed", type=whole(0), help="root of the random streams (default: that of the config)"
    )
    add_output(command, "the parameters, JSON", b'{\n "paper"')
    add_project(command)


def robustness_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `robustness`."""
    _parameter_file(command)
    most = "maximum number of samples per claim"
    command.add_argument("--samples", type=whole(1, 1_000_000), required=True, help=most)
    command.add_argument(
        "--no-cached", dest="cached", action="store_false",
        help="compute all samples, those in config/samples too",
    )  # fmt: skip


def alternatives_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `alternatives`."""
    _parameter_file(command)


def sensitivity_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `sensitivity`."""
    _parameter_file(command)
    _formats(command)


def claims_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `claims` and of `verdicts`."""
    text = "made by `reobserve-papers stage parameters`, one for each paper that is built"
    command.add_argument("parameter_file", type=Path, nargs="*", help=text)


verdicts_options = claims_options


def archive_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `archive`."""
    command.add_argument("products", nargs="+", help="files in results, made by a build")
    add_output(command, "the crate, .zip", b"PK")
    add_project(command)


def _parameter_file(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "parameter_file", type=Path, help="made by `reobserve-papers stage parameters`"
    )


def _formats(command: argparse.ArgumentParser) -> None:
    command.add_argument("--formats", nargs="+", choices=FORMATS, required=True)


STAGES = CommandTable(
    "Run one stage of the pipeline, as its jobs do.",
    {
        name: Command(
            text,
            partial(step_options, name) if name in KINDS else f"{__name__}:{name}_options",
            "reobserve_papers.steps.build_job:run"
            if name in KINDS and name != "plot"
            else "reobserve_papers.report.research_object:write_archive"
            if name == "archive"
            else f"reobserve_papers.cli.stages.{name}:run",
            "papers",
        )
        for name, text in _STAGES.items()
    },
    "stages",
    _EXAMPLES,
)

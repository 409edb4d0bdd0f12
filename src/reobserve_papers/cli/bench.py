"""The bench: `reobserve-papers bench tune`, `score`, `moved`, `plot` and `table`."""

from __future__ import annotations

import argparse
from pathlib import Path

from reobserve.core.command_line import Command, CommandTable
from reobserve_papers.cli.options import FORMATS, add_output

_EXAMPLES = """\
a task, by hand:
  reobserve-papers bench tune config/bench/torque.yaml levant --output config/bench/tuned/torque
  reobserve-papers bench score config/bench/torque.yaml --tuned config/bench/tuned/torque \\
      --outputs scores.csv table.csv
`snakemake bench` scores and plots all tasks, `snakemake bench_tune` tunes all methods again.
"""

_COMMANDS = {
    "tune": "tune methods of a task; each takes some seconds",
    "score": "score tuned methods on held-out records",
    "moved": "compare stored settings with those tuned again; fails if an error changed",
    "plot": "plot the figures of a task",
    "table": "write a table of all methods: what they need, guarantee and cost",
}

BENCH = CommandTable(
    "Observers and filters on the same tasks, tuned by one rule.",
    {
        name: Command(
            text,
            f"{__name__}:{name}_options",
            f"reobserve_papers.bench.task_commands:{name}_command",
            "papers",
        )
        for name, text in _COMMANDS.items()
    },
    epilog=_EXAMPLES,
)


def tune_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `tune`."""
    _task_file(command)
    command.add_argument("methods", nargs="*", metavar="method", help="default: all of the task")
    command.add_argument(
        "--stored", type=Path, metavar="FOLDER",
        help="tune on the first training set only, and take settings for the others from here "
        "(all are tuned where a file is missing or of another task file)",
    )  # fmt: skip
    command.add_argument(
        "--main-only", action="store_true",
        help="tune on the first training set only; others that are not stored are left out",
    )  # fmt: skip
    command.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="for settings, METHOD.json"
    )


def score_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `score`."""
    _task_file(command)
    _tuned(command)
    command.add_argument(
        "--outputs", type=Path, nargs=2, required=True, metavar=("SCORES", "TABLE"),
        help="scores of each run, and of each method in each condition, CSV",
    )  # fmt: skip


def moved_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `moved`."""
    _task_file(command)
    command.add_argument("--cached", type=Path, required=True, help="a folder of tuned settings")
    command.add_argument(
        "--again", type=Path, required=True, help="the folder of settings tuned again"
    )
    add_output(command, "the ratios of errors, CSV", b"method,condition,ratio")


def plot_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `plot`."""
    _task_file(command)
    command.add_argument(
        "--table", type=Path, required=True, help="from `reobserve-papers bench score`"
    )
    _tuned(command)
    command.add_argument(
        "--outputs", type=Path, nargs="+", required=True,
        help=f"heatmap, levels or evaluations, in any of {', '.join(FORMATS)}",
    )  # fmt: skip
    command.add_argument(
        "--style", type=Path, nargs="?", metavar="FILE", help="a matplotlib style sheet"
    )


def table_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `table`."""
    command.add_argument(
        "folders",
        type=Path,
        nargs="+",
        help="folders of results, each with the name of its task file",
    )
    for name, default, text in (
        ("tasks", "config/bench", "the folder of task files"),
        ("tuned", "config/bench/tuned", "the folder of tuned settings"),
    ):
        command.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    add_output(command, "the table, Markdown", b"### ")


def _tuned(command: argparse.ArgumentParser) -> None:
    command.add_argument("--tuned", type=Path, required=True, help="a folder of tuned settings")


def _task_file(command: argparse.ArgumentParser) -> None:
    command.add_argument("task_file", type=Path, help="a task, such as config/bench/torque.yaml")

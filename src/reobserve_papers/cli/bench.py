"""The bench: `reobserve tune`, and `reobserve bench tune`, `score`, `moved`, `plot` and `table`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from reobserve.cli.parts import FORMATS, add_command, add_output

_EXAMPLES = """\
a task, by hand:
  reobserve bench tune config/bench/torque.yaml levant --output config/bench/tuned/torque
  reobserve bench score config/bench/torque.yaml --tuned config/bench/tuned/torque \\
      --outputs scores.csv table.csv
`snakemake bench` scores and plots all tasks, `snakemake bench_tune` tunes all methods again.
"""


_RECORDS = """\
The file names records, split into segments for training and held-out ones; candidates, each a
specification of `reobserve estimate` with ranges of its numbers; and columns of the records that
the estimates are compared with. For example, with what is written into FOLDER:

  reobserve tune examples/measured/tune.yaml --output FOLDER
      table.md, table.csv         errors on held-out segments, with intervals of 95 %
      NAME.yaml                   tuned specifications, for `reobserve estimate`
      scores.csv                  the error in each segment
"""


def add_tune(commands: Any) -> None:
    """The command `tune`."""
    tune = add_command(
        commands, "tune", "bench.commands:tune_records_command",
        "tune observers on recorded data, and compare them",
    )  # fmt: skip
    tune.formatter_class = argparse.RawDescriptionHelpFormatter
    tune.epilog = _RECORDS
    tune.add_argument(
        "tune_file", type=Path, metavar="FILE", help="YAML: records, candidates, reference"
    )
    tune.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="a folder for the results"
    )


def add_bench(commands: Any) -> None:
    """The commands of the bench."""
    bench = commands.add_parser(
        "bench", help="compare observers and filters that are tuned by one rule",
        description="Observers and filters on the same tasks, tuned by one rule.",
        epilog=_EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    commands = bench.add_subparsers(title="commands", metavar="COMMAND", required=True)

    tune = add_command(
        commands,
        "tune",
        "bench.commands:tune_command",
        "tune methods of a task; each takes some seconds",
    )
    _task_file(tune)
    tune.add_argument("methods", nargs="*", metavar="method", help="default: all of the task")
    tune.add_argument(
        "--stored", type=Path, metavar="FOLDER",
        help="tune on the first training set only, and take settings for the others from here "
        "(all are tuned where a file is missing or of another task file)",
    )  # fmt: skip
    tune.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="for settings, METHOD.json"
    )

    score = add_command(
        commands, "score", "bench.commands:score_command", "score tuned methods on held-out records"
    )
    _task_file(score)
    _tuned(score)
    score.add_argument(
        "--outputs", type=Path, nargs=2, required=True, metavar=("SCORES", "TABLE"),
        help="scores of each run, and of each method in each condition, CSV",
    )  # fmt: skip

    moved = add_command(
        commands, "moved", "bench.commands:moved_command",
        "compare stored settings with those tuned again; fails if an error changed",
    )  # fmt: skip
    _task_file(moved)
    moved.add_argument("--cached", type=Path, required=True, help="a folder of tuned settings")
    moved.add_argument(
        "--again", type=Path, required=True, help="the folder of settings tuned again"
    )
    add_output(moved, "the ratios of errors, CSV")

    plot = add_command(
        commands, "plot", "bench.commands:plot_command", "plot the figures of a task"
    )
    _task_file(plot)
    plot.add_argument("--table", type=Path, required=True, help="from `reobserve bench score`")
    _tuned(plot)
    plot.add_argument(
        "--outputs", type=Path, nargs="+", required=True,
        help=f"heatmap, levels or evaluations, in any of {', '.join(FORMATS)}",
    )  # fmt: skip
    plot.add_argument(
        "--style", type=Path, nargs="?", metavar="FILE", help="a matplotlib style sheet"
    )

    table = add_command(
        commands, "table", "bench.commands:table_command",
        "write a table of all methods: what they need, guarantee and cost",
    )  # fmt: skip
    table.add_argument(
        "folders",
        type=Path,
        nargs="+",
        help="folders of results, each with the name of its task file",
    )
    for name, default, text in (
        ("tasks", "config/bench", "the folder of task files"),
        ("tuned", "config/bench/tuned", "the folder of tuned settings"),
    ):
        table.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    add_output(table, "the table, Markdown")


def _tuned(command: argparse.ArgumentParser) -> None:
    command.add_argument("--tuned", type=Path, required=True, help="a folder of tuned settings")


def _task_file(command: argparse.ArgumentParser) -> None:
    command.add_argument("task_file", type=Path, help="a task, such as config/bench/torque.yaml")

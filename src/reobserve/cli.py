"""The command line: one sub-command for each stage of the pipeline, and ways to look around.

Sub-commands are imported when they are called: a short job pays for what it uses only.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from reobserve.errors import ReobserveError, one_line
from reobserve.numerics.code_paths import pin_code_paths
from reobserve.plain_data.command_line import tree, whole

_MOST_SAID = 10_000  # letters of a message: several claims may be broken at once
_FORMATS = ("pdf", "svg", "png")

_EXAMPLES = """\
the pipeline, by hand:
  reobserve ledger ilo --output results/ilo/ledger.json
  reobserve plant results/ilo/ledger.json constant --output results/ilo/constant/plant.parquet
  reobserve observe results/ilo/ledger.json results/ilo/constant/plant.parquet sampled \\
      --output results/ilo/constant/sampled.parquet
Each command that `snakemake --printshellcmds` prints can be run the same way.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command; the exit code is 0, 1 after an error of the user's, 2 for usage."""
    pin_code_paths()  # before numpy is imported
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal that has no letter for a name is shown its code.
        sys.stdout.reconfigure(errors="backslashreplace")
    options = vars(_parser().parse_args(arguments))
    module, function = options.pop("run").split(":")
    try:
        getattr(importlib.import_module(f"reobserve.{module}"), function)(**options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except ReobserveError as error:
        print(f"reobserve: {one_line(error, _MOST_SAID)}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        _forget_output()
    except OSError as error:  # files have their own sentences: this is standard output
        _forget_output()
        place = error.filename or "standard output"
        print(f"reobserve: {place}: cannot be written ({error.strerror})", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


def _forget_output() -> None:
    """Let what standard output did not take go nowhere when the interpreter flushes it at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """Says what is wrong with an argument on one line, however long the argument is."""

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="reobserve",
        description="State and fault observers from five papers: run a stage, or look around.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_overview(commands)
    _add_stages(commands)
    _add_evidence(commands)
    _add_golden(commands)
    _add_figure_diff(commands)
    return parser


def _add_overview(commands: Any) -> None:
    listing = _command(
        commands, "list", "ledger.overview:show_list", "what there is, and what is built"
    )
    listing.add_argument("paper", nargs="*", help="only these papers (default: all)")
    _project(listing)

    params = _command(
        commands,
        "params",
        "ledger.overview:show_params",
        "a paper's ledger: values, sources, ranges",
    )
    params.add_argument("paper", help="a paper of `reobserve list`")
    params.add_argument("match", nargs="?", default="", help="only keys that contain this")
    params.add_argument("--why", action="store_true", help="say why each assumption was made")
    params.add_argument(
        "--built", action="store_true", help="of the last build, overrides included"
    )
    _project(params)

    readme = _command(
        commands, "readme", "evidence.meanings:write_lists",
        "write what metrics mean into results/README.md",
    )  # fmt: skip
    _project(readme)

    check = _command(
        commands, "check", "stages.check:run", "check ledgers whole, without writing any"
    )
    check.add_argument("paper", nargs="*", help="only these papers (default: all)")
    check.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to replace, by paper; - reads them from standard input',
    )  # fmt: skip
    _project(check)


def _add_stages(commands: Any) -> None:
    ledger = _command(
        commands, "ledger", "stages.ledger:run", "check a paper's config and write its ledger"
    )
    ledger.add_argument("paper", help="the name of a file in config/papers")
    ledger.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to replace, as \'{"observers": {"sampled": {"K2": 1500}}}\'',
    )  # fmt: skip
    ledger.add_argument("--seed", type=whole(0), default=0, help="root of the random streams")
    _output(ledger, "the ledger, JSON")
    _project(ledger)

    plant = _command(commands, "plant", "stages.plant:run", "simulate the plant of a scenario")
    _ledger_file(plant)
    plant.add_argument("scenario", help="a scenario of the ledger")
    _output(plant, "the record, Parquet")

    design = _command(
        commands, "design", "stages.design:run", "compute a design: gains that observers share"
    )
    _ledger_file(design)
    design.add_argument("design", help="a design of the ledger")
    _output(design, "the design, JSON")

    observe = _command(
        commands, "observe", "stages.observe:run", "run an observer on a plant's record"
    )
    _ledger_file(observe)
    observe.add_argument("plant_file", type=Path, help="a record made by `reobserve plant`")
    observe.add_argument("observer", help="an observer of the ledger")
    _design_file(observe)
    _output(observe, "the estimates, Parquet")

    study = _command(commands, "study", "stages.study:run", "run a study: many runs, one table")
    _ledger_file(study)
    study.add_argument("plant_file", type=Path, help="a record made by `reobserve plant`")
    study.add_argument("study", help="a study of the ledger")
    _design_file(study)
    _output(study, "the table, CSV")

    search = _command(
        commands, "search", "stages.search:run", "search for values that a paper leaves open"
    )
    _ledger_file(search)
    search.add_argument("plant_file", type=Path, help="a record made by `reobserve plant`")
    search.add_argument("search", help="a search of the ledger")
    _output(search, "what was found, JSON")

    table = _command(commands, "table", "stages.table:run", "fill a table from a design")
    _ledger_file(table)
    table.add_argument("table", help="a table of the ledger")
    _design_file(table, required=True)
    _output(table, "the table, CSV")

    metrics = _command(commands, "metrics", "stages.metrics:run", "the numbers of a figure")
    _figure_inputs(metrics)
    _output(metrics, "the table, CSV")

    plot = _command(commands, "plot", "stages.plot:run", "draw a figure and write its caption")
    _figure_inputs(plot)
    plot.add_argument("--metrics-file", type=Path, required=True, help="by `reobserve metrics`")
    plot.add_argument("--template", type=Path, required=True, help="the caption's template")
    plot.add_argument("--caption", type=Path, required=True, help="where the caption goes")
    plot.add_argument(
        "--outputs", type=Path, nargs="+", required=True, help="files, .pdf, .svg or .png"
    )


def _add_evidence(commands: Any) -> None:
    theory = _command(commands, "theory", "stages.theory:run", "the numbers of a paper's theory")
    _ledger_file(theory)
    theory.add_argument(
        "--design-files", type=Path, nargs="*", default=[],
        help="by `reobserve design`, in the order of the ledger",
    )  # fmt: skip
    _output(theory, "the table, CSV")

    robustness = _command(
        commands, "robustness", "stages.robustness:run",
        "decide a paper's claims over draws of what it leaves open",
    )  # fmt: skip
    _ledger_file(robustness)
    most = "at most, for each claim"
    robustness.add_argument("--draws", type=whole(1, 1_000_000), required=True, help=most)
    robustness.add_argument(
        "--no-flips", dest="flips", action="store_false",
        help="do not look for the smallest change that turns a claim over, which takes longest",
    )  # fmt: skip
    robustness.add_argument("--kept", type=Path, help="draws that need not all be made again")
    _output(robustness, "shares and smallest changes, JSON")
    _project(robustness)

    draws = _command(
        commands, "draws", "evidence.claims.draws_command:draws_command",
        "go on drawing where claims are not yet decided, and keep the draws in config/draws",
    )  # fmt: skip
    draws.add_argument("paper", nargs="*", help="only these papers (default: all)")
    draws.add_argument("--most", type=whole(1, 1_000_000), default=40, help=f"{most} (default: 40)")
    draws.add_argument(
        "--check", action="store_true", help="keep nothing: make again what is kept, and compare"
    )
    _project(draws)

    sensitivity = _command(
        commands, "sensitivity", "stages.sensitivity:run",
        "draw specification curves and what decides the claims that depend",
    )  # fmt: skip
    _ledger_file(sensitivity)
    sensitivity.add_argument("robustness_file", type=Path, help="by `reobserve robustness`")
    told = "specification and sensitivity, in any of the formats"
    sensitivity.add_argument("--outputs", type=Path, nargs="+", required=True, help=told)
    _project(sensitivity)

    claims = _command(commands, "claims", "stages.claims:run", "the verdicts on all claims")
    claims.add_argument("paper", nargs="+", help="papers whose figures are built")
    claims.add_argument(
        "--results", type=Path, default=Path("results"), help="where they are (default: results)"
    )
    _output(claims, "the table, CSV")
    _project(claims)

    verdicts = _command(
        commands, "verdicts", "stages.verdicts:run", "count verdicts; fail if a claim is broken"
    )
    verdicts.add_argument("claims_file", type=Path, help="by `reobserve claims`")
    _output(verdicts, "the counts and a gallery, Markdown")
    _project(verdicts)

    report = _command(
        commands, "report", "evidence.report:report_command",
        "the replication report of what is built, gaps shown",
    )  # fmt: skip
    default = "(default: those of the config)"
    report.add_argument("--papers", nargs="+", help=f"papers that are built {default}")
    report.add_argument(
        "--formats",
        nargs="+",
        choices=_FORMATS,
        metavar="FORMAT",
        help=f"formats of figures {default}",
    )
    _output(report, "the page, HTML")
    _project(report)


def _add_golden(commands: Any) -> None:
    golden = commands.add_parser(
        "golden", help="check or renew the golden numbers", description="Golden numbers."
    )
    actions = golden.add_subparsers(metavar="ACTION", required=True)
    check = _command(
        actions,
        "check",
        "evidence.golden.commands:check_command",
        "compare all figures and tables with their golden numbers",
    )
    _project(check)
    elsewhere = _command(
        actions, "elsewhere", "evidence.golden.commands:elsewhere_command",
        "compare all of them on other processors, as far as this one can stand in for them",
    )  # fmt: skip
    elsewhere.add_argument(
        "--papers", nargs="+", default=[], metavar="PAPER", help="only these (default: as built)"
    )
    elsewhere.add_argument(
        "--part", choices=("all", "gate"), default="all",
        help="gate: what depends on designs and one figure a paper, on the most telling processors",
    )  # fmt: skip
    update = _command(
        actions, "update", "evidence.golden.commands:update_command",
        "renew the golden numbers; prints old and new, refuses in CI and on a dirty tree",
    )  # fmt: skip
    update.add_argument("--reason", required=True, help="why they moved; kept beside them")
    update.add_argument(
        "--anew", action="store_true",
        help="digits and tolerances, too, of what has not moved beyond rounding",
    )  # fmt: skip
    update.add_argument("paper", nargs="*", help="only these papers (default: all)")
    for command in (elsewhere, update):
        command.add_argument("--cores", type=whole(1), default=2, help="processes (default: 2)")
        _project(command)


def _add_figure_diff(commands: Any) -> None:
    diff = _command(
        commands, "figdiff", "evidence.figure_diff.commands:figdiff_command",
        "compare figures, and the numbers behind them, with the accepted ones; writes a page",
    )  # fmt: skip
    for name, default, text in (
        ("reference", "tests/reference", "the accepted figures"),
        ("results", "results", "what is built"),
        ("output", "figdiff", "where the page and its summaries go"),
    ):
        diff.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    diff.add_argument(
        "--build", action="store_true",
        help="build everything from nothing in a temporary folder, and compare that",
    )  # fmt: skip
    accept = _command(
        commands, "accept", "evidence.figure_diff.commands:accept_command",
        "build, and accept figures and golden numbers; refuses in CI and on a dirty tree",
    )  # fmt: skip
    accept.add_argument("--reason", required=True, help="why they moved; kept beside them")
    accept.add_argument("paper", nargs="*", help="only these papers (default: all)")
    for command in (diff, accept):
        command.add_argument("--cores", type=whole(1), default=2, help="to build with (default: 2)")
        _project(command)


def _command(commands: Any, name: str, run: str, text: str) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=text[0].upper() + text[1:] + "."
    )
    command.set_defaults(run=run)
    return command


def _project(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR",
        help="the folder with config and workflow (default: this one)",
    )  # fmt: skip


def _output(command: argparse.ArgumentParser, text: str) -> None:
    command.add_argument("--output", type=Path, required=True, metavar="FILE", help=text)


def _ledger_file(command: argparse.ArgumentParser) -> None:
    command.add_argument("ledger_file", type=Path, help="a ledger made by `reobserve ledger`")


def _design_file(command: argparse.ArgumentParser, *, required: bool = False) -> None:
    text = "by `reobserve design`" + ("" if required else ", if the ledger names a design")
    command.add_argument("--design-file", type=Path, required=required, metavar="FILE", help=text)


def _figure_inputs(command: argparse.ArgumentParser) -> None:
    _ledger_file(command)
    command.add_argument("figure", help="a figure of the ledger")
    command.add_argument("--plant-file", type=Path, required=True, help="by `reobserve plant`")
    command.add_argument(
        "--estimate-files", type=Path, nargs="+", required=True,
        help="by `reobserve observe`, in the order of the figure's observers",
    )  # fmt: skip
    command.add_argument("--study-file", type=Path, help="by `reobserve study`, if it has one")

"""Ways to look around: what there is, a paper's parameter file, what its metrics mean, LaTeX."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.cli.parts import add_command, add_output, add_project
from reobserve.cli.types import tree, whole


def add_overview(commands: Any) -> None:
    """`list`, `params`, `readme`, `latex`, `check` and `schema`."""
    listing = add_command(
        commands,
        "list",
        "replication.parameters.overview:show_list",
        "list papers, figures, scenarios and observers, and which are built",
    )
    listing.add_argument("paper", nargs="*", help="only these papers (default: all)")
    add_project(listing)

    params = add_command(
        commands,
        "params",
        "replication.parameters.overview:show_params",
        "show a paper's parameter file: values, sources, ranges",
    )
    params.add_argument("paper", help="a paper, as named by `reobserve list`")
    params.add_argument(
        "match", nargs="?", default="", help="show only keys that contain this text"
    )
    params.add_argument("--why", action="store_true", help="show the reason for each assumption")
    params.add_argument(
        "--built",
        action="store_true",
        help="show the parameters of the last build, including overrides",
    )
    add_project(params)

    readme = add_command(
        commands, "readme", "replication.meanings:write_lists",
        "write the meaning of all metrics into results/README.md",
    )  # fmt: skip
    add_project(readme)

    latex = add_command(
        commands,
        "latex",
        "cli.stages.latex:run",
        "write a caption or a table of the results as LaTeX",
    )
    latex.add_argument("source", type=Path, help="a caption (.rst) or a table (.csv)")
    latex.add_argument(
        "--digits", type=whole(1, 17), metavar="N",
        help="significant digits of numbers (default: 3 for metrics; other tables as they are)",
    )  # fmt: skip
    add_output(latex, "a .tex file to be included by \\input")

    check = add_command(
        commands, "check", "cli.stages.check:run",
        "check everything under config/: parameters, claims, errata",
    )  # fmt: skip
    check.add_argument("paper", nargs="*", help="only these papers (default: all)")
    check.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to override, by paper; - reads them from standard input',
    )  # fmt: skip
    add_project(check)

    schema = add_command(
        commands, "schema", "cli.schemas:print_schema",
        "print the JSON schema of a configuration file, for an editor",
    )  # fmt: skip
    schema.add_argument("kind", choices=("config", "parameters", "claims", "errata", "bench"))

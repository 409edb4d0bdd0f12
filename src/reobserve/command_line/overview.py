"""Ways to look around: what there is, a paper's ledger, what its metrics mean."""

from __future__ import annotations

from typing import Any

from reobserve.command_line.parts import add_command, add_project
from reobserve.command_line.types import tree


def add_overview(commands: Any) -> None:
    """`list`, `params`, `readme` and `check`."""
    listing = add_command(
        commands, "list", "ledger.overview:show_list", "what there is, and what is built"
    )
    listing.add_argument("paper", nargs="*", help="only these papers (default: all)")
    add_project(listing)

    params = add_command(
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
    add_project(params)

    readme = add_command(
        commands, "readme", "evidence.meanings:write_lists",
        "write what metrics mean into results/README.md",
    )  # fmt: skip
    add_project(readme)

    check = add_command(
        commands, "check", "stages.check:run", "check ledgers whole, without writing any"
    )
    check.add_argument("paper", nargs="*", help="only these papers (default: all)")
    check.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to replace, by paper; - reads them from standard input',
    )  # fmt: skip
    add_project(check)

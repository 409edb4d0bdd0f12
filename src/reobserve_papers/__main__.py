"""The command line as a shell calls it: ``reobserve-papers``, or ``python -m reobserve_papers``."""

from __future__ import annotations

from typing import NoReturn

from reobserve.core.command_line import leave


def run() -> NoReturn:
    """Run one sub-command of `reobserve-papers` and leave."""
    from reobserve_papers.cli.main import main

    leave(main)


if __name__ == "__main__":
    run()

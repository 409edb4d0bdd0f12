"""The command line as a shell calls it: ``reobserve``, or ``python -m reobserve``."""

from __future__ import annotations

from typing import NoReturn

from reobserve.core.command_line import leave


def run() -> NoReturn:
    """Run one sub-command of `reobserve` and leave."""
    from reobserve.cli.main import main

    leave(main)


if __name__ == "__main__":
    run()

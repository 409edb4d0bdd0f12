"""Commands of the tutorials: run at build in a folder of their own, shown with what they print.

They run in this process, which has imported and compiled already what each would have to.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from tempfile import mkdtemp

_ESCAPE = re.compile(r"\x1b\[[0-9;]*[A-Za-z]|\r")


class Console:
    """A folder, and the commands that were typed in it."""

    def __init__(self) -> None:
        self.folder = Path(mkdtemp(prefix="reobserve-tutorial-"))

    def run(self, *commands: str, status: int = 0) -> str:
        """A block with each command and what it prints, as Markdown.

        Raises
        ------
        RuntimeError
            If a command ends with another status: the page would be wrong.
        """
        lines = []
        for command in commands:
            found, printed = self._typed(command)
            if found != status:
                raise RuntimeError(f"{command} ended with {found}, not {status}: {printed}")
            lines.append(f"$ {command}\n{printed}".rstrip())
        return "```console\n" + "\n".join(lines) + "\n```\n"

    def show(self, name: str, language: str, lines: int | None = None) -> str:
        """A file of the folder as a block, or its first lines."""
        text = (self.folder / name).read_text().splitlines()
        rest = [] if lines is None or len(text) <= lines else ["…"]
        return f'```{language} title="{name}"\n' + "\n".join([*text[:lines], *rest]) + "\n```\n"

    def _typed(self, command: str) -> tuple[int, str]:
        from reobserve.cli import main

        words = shlex.split(command)
        if words[0] != "reobserve":
            raise RuntimeError(f"{command}: only reobserve runs here")
        out, err = StringIO(), StringIO()
        with self._inside(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = main(words[1:])
            except SystemExit as ended:
                status = ended.code if isinstance(ended.code, int) else 1
        return int(status or 0), _ESCAPE.sub("", out.getvalue() + err.getvalue())

    @contextlib.contextmanager
    def _inside(self) -> Iterator[None]:
        before = Path.cwd()
        os.chdir(self.folder)
        try:
            yield
        finally:
            os.chdir(before)

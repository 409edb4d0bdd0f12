"""Commands of the tutorials: run at build in a folder of their own, shown with what they print.

`reobserve` runs in this process, which has imported and compiled already what each call would have
to. A line for the shell, with a pipe or a redirection, runs in one.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap

_WIDTH = 88  # letters of a line, as in a narrow terminal
_ESCAPE = re.compile(r"\x1b\[[0-9;]*[A-Za-z]|\r")


class Console:
    """A folder, and the commands that were typed in it."""

    def __init__(self) -> None:
        self._kept = TemporaryDirectory(prefix="reobserve-tutorial-")  # as long as this lives
        self.folder = Path(self._kept.name)

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
            lines.append("\n".join(_wrapped(f"$ {command}\n{printed}".rstrip())))
        return "```console\n" + "\n".join(lines) + "\n```\n"

    def show(self, name: str, language: str, lines: int | None = None) -> str:
        """A file of the folder as a block, or its first lines."""
        text = (self.folder / name).read_text().splitlines()
        rest = [] if lines is None or len(text) <= lines else ["…"]
        return f'```{language} title="{name}"\n' + "\n".join([*text[:lines], *rest]) + "\n```\n"

    def _typed(self, command: str) -> tuple[int, str]:
        from reobserve.cli.main import main

        words = shlex.split(command)
        if words[0] != "reobserve" or {"|", "<", ">"} & set(words):
            return self._by_shell(command)
        out, err = StringIO(), StringIO()
        with self.inside(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = main(words[1:])
            except SystemExit as ended:
                status = ended.code if isinstance(ended.code, int) else 1
        return int(status or 0), _ESCAPE.sub("", out.getvalue() + err.getvalue())

    def _by_shell(self, command: str) -> tuple[int, str]:
        script = f'reobserve() {{ "{sys.executable}" -m reobserve "$@"; }}\n{command}\n'
        done = subprocess.run(
            ["bash", "-c", script], cwd=self.folder, capture_output=True, text=True, check=False
        )
        return done.returncode, _ESCAPE.sub("", done.stdout + done.stderr)

    @contextlib.contextmanager
    def inside(self) -> Iterator[None]:
        """With the folder as the current one."""
        before = Path.cwd()
        os.chdir(self.folder)
        try:
            yield
        finally:
            os.chdir(before)


def _wrapped(text: str) -> Iterator[str]:
    for line in text.splitlines():
        yield from wrap(line, _WIDTH, subsequent_indent="    ", break_on_hyphens=False) or [""]

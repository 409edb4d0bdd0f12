"""The command line, called where it is installed, and what it says."""

from __future__ import annotations

import contextlib
import io

from reobserve.cli import main


def told(*words: str, code: int = 0) -> str:
    """What a command prints, on either stream; it must end with this exit code."""
    stream = io.StringIO()
    with contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
        try:
            ended = main(words)
        except SystemExit as stop:
            ended = int(stop.code or 0)
    text = stream.getvalue()
    assert ended == code, (words, ended, text)
    return text


def lacks(extra: str, *words: str) -> None:
    """A command says in one sentence which extra it takes."""
    text = told(*words, code=1)
    assert text.count("\n") == 1, text
    assert text.endswith(f'`pip install "reobserve[{extra}]"` brings it\n'), text

"""Snakemake, forked from a process that has imported it: a third of a dry run is to import it.

Nothing of this project is imported before a call, so that each runs the sources of its own folder.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any


@cache
def _server() -> subprocess.Popen[str]:
    """One for all tests of this process; it ends when its standard input does."""
    return subprocess.Popen(
        [sys.executable, "-P", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def snakemake(
    arguments: Sequence[str], folder: Path, environment: Mapping[str, str]
) -> subprocess.CompletedProcess[str]:
    """What `subprocess.run` gives of a call, its output captured."""
    with tempfile.TemporaryDirectory() as kept:
        streams = [str(Path(kept) / name) for name in ("stdout", "stderr")]
        server = _server()
        assert server.stdin is not None
        assert server.stdout is not None
        request = [str(folder), dict(environment), list(arguments), streams]
        server.stdin.write(json.dumps(request) + "\n")
        server.stdin.flush()
        code = int(server.stdout.readline())
        stdout, stderr = (Path(path).read_text(encoding="utf-8") for path in streams)
    return subprocess.CompletedProcess(["snakemake", *arguments], code, stdout, stderr)


def _call(
    folder: str, environment: dict[str, str], arguments: list[str], streams: list[str]
) -> int:
    """In a process of its own: as a shell would start it there."""
    for number, path in enumerate(streams, 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[:0] = environment.get("PYTHONPATH", "").split(os.pathsep)
    sys.argv = [str(Path(sys.executable).with_name("snakemake")), *arguments]
    from snakemake.cli import main

    try:
        main()
    except SystemExit as left:
        code: Any = left.code
        if isinstance(code, str):
            print(code, file=sys.stderr)
        return code if isinstance(code, int) else int(code is not None)
    return 0


def _serve() -> None:
    # All that forked processes share: what Snakemake and its rules import, and its options.
    import jsonschema
    import pandas  # noqa: F401
    import snakemake.cli
    import yaml  # noqa: F401

    jsonschema.Draft202012Validator({}).is_valid({})
    snakemake.cli.get_argument_parser()
    for line in sys.stdin:
        child = os.fork()
        if not child:
            code = _call(*json.loads(line))
            atexit._run_exitfuncs()
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


if __name__ == "__main__":
    _serve()

"""Jobs forked from one warm process, since what most of them do longest is to import libraries.

A build starts this module before its first job, with a socket that listens. `reobserve` sends what
was typed and its own standard streams there, see `reobserve.forking.client`, and leaves with
the exit code that comes back. Each job is a process of its own, forked before anything is
computed: jobs share what is imported, and nothing else. When whoever asked for a job ends, however
that comes, the job is ended; when the build ends, all jobs and the server are.

For Linux, where processes can be waited for as files are.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import selectors
import signal
import socket
import struct
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from reobserve import cli
from reobserve.forking.client import CODE, LENGTH

# What jobs import: first what all need, then what those need that come later in a build. Of the
# package it is what all papers share: in what is a paper's own are loops to compile.
_FIRST = ("numpy", "scipy.linalg", "numba", "pyarrow.parquet", "reobserve.stages.observe")
_LATER = (
    "scipy.integrate", "matplotlib.figure", "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_pdf", "matplotlib.backends.backend_svg", "jinja2",
    "scipy.signal", "reobserve.stages.metrics", "reobserve.stages.plot", "reobserve.stages.study",
)  # fmt: skip


@dataclass(frozen=True)
class _Job:
    process: int
    ended: int  # a file descriptor that can be read once the process has ended
    asked: socket.socket


class Server:
    """Forks a job for each request; ``lifeline`` is a file that ends when the build does."""

    def __init__(self, listener: socket.socket, lifeline: int) -> None:
        self._listener = listener
        self._watched = selectors.DefaultSelector()
        self._jobs: set[_Job] = set()
        self._watched.register(listener, selectors.EVENT_READ, self._begin)
        self._watched.register(lifeline, selectors.EVENT_READ, self._end)

    def serve(self) -> NoReturn:
        """Go on until the build ends; import the rest while nobody asks."""
        for name in _FIRST:
            _import(name)
        cli.command_parser()
        later: list[Callable[[], None]] = [partial(_import, name) for name in _LATER]
        for warm in (_warm_compiler, _warm_provenance, *later):
            self._turn(0)
            warm()
        gc.collect()
        gc.freeze()  # or the first collection of each job would copy every page
        while True:
            self._turn(None)

    def _turn(self, wait: float | None) -> None:
        for key, _ in self._watched.select(wait):
            key.data()

    def _begin(self) -> None:
        connection, _ = self._listener.accept()
        try:
            request, streams = _received(connection)
        except (OSError, ValueError, struct.error):  # whoever asked is gone
            connection.close()
            return
        process = os.fork()
        if not process:
            _run(request, streams)
        for stream in streams:
            os.close(stream)
        job = _Job(process, os.pidfd_open(process), connection)
        self._jobs.add(job)
        self._watched.register(job.ended, selectors.EVENT_READ, partial(self._answer, job))
        self._watched.register(job.asked, selectors.EVENT_READ, partial(self._abandon, job))

    def _answer(self, job: _Job) -> None:
        _, status = os.waitpid(job.process, 0)
        with suppress(OSError):
            job.asked.sendall(CODE.pack(os.waitstatus_to_exitcode(status)))
        for watched in (job.ended, job.asked):
            with suppress(KeyError):  # nobody waits for it any more
                self._watched.unregister(watched)
        os.close(job.ended)
        job.asked.close()
        self._jobs.remove(job)

    def _abandon(self, job: _Job) -> None:
        self._watched.unregister(job.asked)
        os.kill(job.process, signal.SIGKILL)

    def _end(self) -> NoReturn:
        for job in self._jobs:
            os.kill(job.process, signal.SIGKILL)
        os._exit(0)


def _import(name: str) -> None:
    with suppress(Exception):  # told by the job that needs it
        importlib.import_module(name)


def _warm_compiler() -> None:
    """Have numba read all that it knows of types, as it does for the first loop of a process."""
    from numba import njit

    njit(error_model="numpy")(lambda: None)()


def _warm_provenance() -> None:
    """Find versions, and who imports whom in the package; what files hold is read by each job."""
    from reobserve.pipeline.provenance import import_closure, versions

    versions()
    package = Path(__file__).parents[1]
    for path in package.rglob("*.py"):
        with suppress(SyntaxError):  # told by the job that needs it
            import_closure([".".join(path.relative_to(package.parent).with_suffix("").parts)])


def _received(connection: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """A request: its words, folder and environment, and the three standard streams."""
    connection.settimeout(10)
    start, streams, _, _ = socket.recv_fds(connection, LENGTH.size, 3)
    while len(start) < LENGTH.size:
        start += _some(connection, LENGTH.size - len(start))
    (length,) = LENGTH.unpack(start)
    text = b""
    while len(text) < length:
        text += _some(connection, length - len(text))
    connection.settimeout(None)
    return json.loads(text), streams


def _some(connection: socket.socket, most: int) -> bytes:
    part = connection.recv(min(most, 1 << 16))
    if not part:
        raise ConnectionError
    return part


def _run(request: dict[str, Any], streams: list[int]) -> NoReturn:
    """Be the process that was asked for."""
    try:
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
        # What is open beyond the three is the server's.
        os.closerange(3, os.sysconf("SC_OPEN_MAX"))
        sys.stdin = os.fdopen(0)
        sys.stdout = os.fdopen(1, "w")
        sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace")
        os.chdir(request["folder"])
        os.environ.clear()
        os.environ.update(request["environment"])
        sys.argv = request["words"]

        code = cli.main()
        for written in (sys.stdout, sys.stderr):
            written.flush()
        os._exit(code)
    except SystemExit as end:  # of usage
        os._exit(end.code if isinstance(end.code, int) else 1)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(1)


def main() -> NoReturn:
    """Serve the socket whose file descriptor is the one argument, until standard input ends."""
    from reobserve.numerics.code_paths import pin_code_paths

    pin_code_paths()
    Server(socket.socket(fileno=int(sys.argv[1])), lifeline=0).serve()


if __name__ == "__main__":
    main()

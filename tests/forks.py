"""Programs that each run in a process of its own, a fork of one that has imported packages."""

from __future__ import annotations

import atexit
import json
import subprocess
import sys
from pathlib import Path

# Programs come as lines of JSON, and what came of each goes back as one.
_SERVER = """
import json, os, sys, tempfile, traceback

exec(sys.argv[1])
for line in sys.stdin:
    given = json.loads(line)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        if not os.fork():
            status = 1
            try:
                os.dup2(out.fileno(), 1)
                os.dup2(err.fileno(), 2)
                os.environ.update(given["environment"])
                os.chdir(given["folder"])
                sys.path.insert(0, given["folder"])
                exec(given["program"], {"__name__": "__main__"})
                status = 0
            except SystemExit as left:
                status = left.code or 0
                if not isinstance(status, int):
                    print(status, file=sys.stderr)
                    status = 1
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(status)
        _, status, used = os.wait3(0)
        status, seconds = os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
        read = [stream.seek(0) or stream.read().decode() for stream in (out, err)]
    print(json.dumps([status, seconds, *read]), flush=True)
"""


class Forks:
    """The process from which programs are forked."""

    seconds = 0.0  # of CPU, in all programs that have ended

    def __init__(self, server: subprocess.Popen[str]) -> None:
        self._server = server

    def run(
        self, folder: Path, program: str, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run a program in a folder, with the modules that are there before all others."""
        given = {"folder": str(folder), "program": program, "environment": environment}
        assert self._server.stdin
        assert self._server.stdout
        print(json.dumps(given), file=self._server.stdin, flush=True)
        status, seconds, out, err = json.loads(self._server.stdout.readline())
        Forks.seconds += seconds
        return subprocess.CompletedProcess(program, status, out, err)


def forking(begin: str, environment: dict[str, str]) -> Forks:
    """A process that has run a program, and ends with this one."""
    server = subprocess.Popen(
        [sys.executable, "-c", _SERVER, begin], env=environment, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    atexit.register(server.communicate)
    return Forks(server)

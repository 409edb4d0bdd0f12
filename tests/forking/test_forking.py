"""Jobs forked from a warm process do what they do alone, and end with who asked for them."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from reobserve.forking.client import CODE, LENGTH, SOCKET

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="it is for Linux")


@dataclass(frozen=True)
class Served:
    """A server as a build starts it, and what asks it."""

    server: subprocess.Popen[bytes]
    path: Path

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Ask for a job; its standard input stays open."""
        return subprocess.Popen(
            [sys.executable, "-m", "reobserve", *words], cwd=ROOT, text=True,
            env=os.environ | {SOCKET: str(self.path)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def jobs(self) -> list[int]:
        """The processes that it has forked."""
        listed = Path(f"/proc/{self.server.pid}/task/{self.server.pid}/children").read_text(
            encoding="utf-8"
        )
        return [int(number) for number in listed.split()]

    def waiting(self) -> tuple[subprocess.Popen[str], int]:
        """One that waits for overrides on its standard input, and the process forked for it."""
        asked = self.start("check", "--overrides", "-")
        until(lambda: len(self.jobs()) == 1)
        return asked, self.jobs()[0]


def until(there: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not there():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    yield from serving(tmp_path_factory.mktemp("served"))


@pytest.fixture
def ending(tmp_path: Path) -> Iterator[Served]:
    """One that a test may end."""
    yield from serving(tmp_path)


def serving(folder: Path) -> Iterator[Served]:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(folder / "socket"))
        listener.listen()
        command = [sys.executable, "-m", "reobserve.forking.server", str(listener.fileno())]
        server = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[listener.fileno()])
    yield Served(server, folder / "socket")
    server.stdin.close()
    assert server.wait(timeout=60) == 0


@pytest.mark.parametrize(
    "words",
    [
        ("list", "ilo"),
        ("params", "nobody"),  # is refused in a sentence
        ("stage", "plant"),  # is told how it is used
    ],
)
def test_what_is_printed_and_the_exit_code_are_the_job_s(
    served: Served, words: tuple[str, ...]
) -> None:
    asked = served.start(*words)
    output, errors = asked.communicate(timeout=60)
    alone = subprocess.run(
        [sys.executable, "-m", "reobserve", *words], cwd=ROOT, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    said = alone.stderr.replace("__main__.py", "reobserve")
    assert (asked.returncode, output) == (alone.returncode, alone.stdout)
    assert errors.replace("__main__.py", "reobserve") == said


def test_what_is_typed_into_it_reaches_it(served: Served) -> None:
    asked = served.start("check", "ilo", "--overrides", "-")
    _, errors = asked.communicate('{"ilo": {"nothing": 1}}', timeout=60)
    assert asked.returncode == 1
    assert "nothing" in errors
    assert served.jobs() == []


def test_a_job_ends_with_who_asked_for_it(served: Served) -> None:
    asked, process = served.waiting()
    asked.kill()
    asked.communicate()
    until(lambda: not Path(f"/proc/{process}").exists())
    assert served.jobs() == []


def test_who_asked_ends_as_the_job_does(served: Served) -> None:
    asked, process = served.waiting()
    os.kill(process, signal.SIGKILL)
    asked.communicate(timeout=60)
    assert asked.returncode == -signal.SIGKILL


def test_all_jobs_end_with_the_build(ending: Served) -> None:
    asked, process = ending.waiting()
    assert ending.server.stdin is not None
    ending.server.stdin.close()
    assert asked.wait(timeout=60) == 1
    assert asked.communicate()[1] == "reobserve: the process that jobs are forked from has ended\n"
    until(lambda: not Path(f"/proc/{process}").exists())
    assert ending.server.wait(timeout=60) == 0


@pytest.mark.parametrize("sent", [b"", LENGTH.pack(10) + b"{}", LENGTH.pack(3) + b"{}}"])
def test_a_request_that_is_none_is_passed_over(served: Served, sent: bytes) -> None:
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(str(served.path))
        connection.sendall(sent)
        connection.shutdown(socket.SHUT_WR)
        assert connection.recv(CODE.size) == b""
    asked = served.start("list", "ilo")
    asked.communicate(timeout=60)
    assert asked.returncode == 0


def test_where_nobody_listens_it_runs_by_itself(tmp_path: Path) -> None:
    for path in (tmp_path / "none", tmp_path):
        done = subprocess.run(
            [sys.executable, "-m", "reobserve", "list", "ilo"], cwd=ROOT, capture_output=True,
            env=os.environ | {SOCKET: str(path)}, check=False,
        )  # fmt: skip
        assert done.returncode == 0
        assert b"fig1" in done.stdout


def test_what_jobs_share_holds_no_paper_and_no_loops() -> None:
    """Loops are imported by each job: machine code is kept under the source that it was made of."""
    script = (
        "import sys; from reobserve.forking import server\n"
        "for name in server._FIRST + server._LATER: server._import(name)\n"
        "print(*sorted(name for name in sys.modules if name.startswith('reobserve')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = done.stdout.split()
    assert {"reobserve.stages.observe", "reobserve.stages.plot"} <= set(loaded)
    assert "reobserve.numerics.kernel" not in loaded
    assert not [name for name in loaded if name.startswith("reobserve.papers.")]

"""A program whose command line is tested, in this process or in one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

Words = Sequence[str | bytes]


@dataclass(frozen=True)
class Program:
    """``command`` runs it in this process, ``module`` has its ``main``.

    ``printing`` are words that print something, ``writing`` those that write a file of a name.
    """

    module: str
    command: Callable[..., None]
    printing: Words
    writing: Callable[[str | bytes], Words]

    @property
    def words(self) -> list[str]:
        """The words that start it in a process of its own."""
        return [
            sys.executable,
            "-c",
            f"import sys; from {self.module} import main; sys.exit(main())",
        ]

    def run(
        self, folder: Path, arguments: Words, locale: str = "C.UTF-8",
        output: int = subprocess.PIPE,
    ) -> subprocess.CompletedProcess[bytes]:  # fmt: skip
        """Run it in a process of its own."""
        return subprocess.run(
            [*self.words, *arguments], cwd=folder, env={**os.environ, "LC_ALL": locale},
            stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.PIPE, timeout=60,
            check=False,
        )  # fmt: skip


def refusal(done: subprocess.CompletedProcess[bytes]) -> str:
    """The one line that a process printed when it refused."""
    message = done.stderr.decode()
    last = message.rstrip("\n").rpartition("\n")[2]
    assert done.returncode in (1, 2)
    assert "Traceback" not in message
    assert last.startswith("reobserve")
    assert done.returncode == 2 or message == f"{last}\n"
    return last

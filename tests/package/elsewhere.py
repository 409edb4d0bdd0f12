"""Use the library as if the system were another: `python elsewhere.py win32`, or darwin.

Other packages are imported first, as they are built for the system that there is. Then what the
other one lacks is taken away: modules, functions, signals, and the folder of the kernel. A text
file that is opened in the encoding of whatever system is an error.
"""

from __future__ import annotations

import importlib.abc
import os
import signal
import socket
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

# What is imported by what stands here, or by what that imports.
OTHERS = (
    "numpy", "scipy.integrate", "scipy.optimize", "scipy.signal", "scipy.stats", "numba", "yaml",
    "pyarrow.csv", "pyarrow.parquet", "pint", "matplotlib.figure", "pandas", "pylatexenc",
    "multiprocessing", "concurrent.futures", "asyncio", "subprocess", "tempfile",
)  # fmt: skip

LACKS: dict[str, dict[Any, Sequence[str]]] = {
    "darwin": {os: ("sched_getaffinity", "pidfd_open")},
    "win32": {
        os: (
            "fork", "forkpty", "getuid", "getpgid", "killpg", "setsid", "uname", "mkfifo",
            "sched_getaffinity", "pidfd_open", "O_NONBLOCK", "register_at_fork", "statvfs", "nice",
        ),
        signal: ("SIGKILL", "SIGPIPE", "SIGHUP", "SIGALRM", "alarm", "setitimer"),
        socket: ("AF_UNIX", "send_fds", "recv_fds"),
    },
}  # fmt: skip
MODULES = {
    "darwin": (),
    "win32": ("fcntl", "grp", "posix_ipc", "pty", "pwd", "resource", "syslog", "termios", "tty"),
}


class _Refuse(importlib.abc.MetaPathFinder):
    def __init__(self, names: Sequence[str]) -> None:
        self.names = names

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> None:
        if name in self.names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def _no_kernel(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and str(arguments[0]).startswith(("/proc/", "/sys/")):
        raise FileNotFoundError(2, "No such file or directory", arguments[0])


def pretend(system: str) -> None:
    """Take away what a system lacks."""
    for name in OTHERS:
        __import__(name)
    for module, names in LACKS[system].items():
        for name in names:
            if hasattr(module, name):
                delattr(module, name)
    for name in MODULES[system]:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, _Refuse(MODULES[system]))
    sys.addaudithook(_no_kernel)
    sys.platform = system
    warnings.filterwarnings("error", category=EncodingWarning, module=r"reobserve\.")


def use() -> None:
    """An observer against what is known of it, a record of one's own, a design and its code."""
    import numpy as np

    import reobserve
    from reobserve.cli import main

    for name in reobserve.__all__:
        getattr(reobserve, name)
    walk = reobserve.LinearModel([[1.0]], [[0.0]], H=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
    observer = reobserve.steady_kalman(walk)
    golden = (np.sqrt(5) - 1) / 2
    run = observer.run(np.ones((9, 1)), np.zeros((9, 1)), state=observer.init([0.0]))
    assert np.allclose(1 - run["state"][:, 0], (1 - golden) ** np.arange(1, 10)), run["state"]
    for words in (
        ["estimate", "--example", "kalman", "--out", "log.yaml", "--data", "log.csv"],
        ["estimate", "log.yaml", "log.csv", "--out", "estimates.csv", "--plot", "estimates.png"],
        ["estimate", "log.yaml", "log.csv", "--out", "estimates.parquet"],
        ["design", "kalman", "--example", "model.yaml"],
        ["design", "kalman", "model.yaml", "--out", "model.json"],
        ["export", "model.json", "--to", "c", "--out", "code"],
    ):
        assert main(words) == 0, words
    for path in Path().rglob("*.*"):
        assert b"\r" not in path.read_bytes() or path.suffix in (".png", ".parquet"), path


def refuse() -> None:
    """Where there is no bash, the rules say so in a sentence."""
    from reobserve.errors import InputError
    from reobserve.replication.prepare import load_parameters

    said, folder, os.name = "", Path(), "nt"
    try:
        load_parameters(folder, {})
    except InputError as error:
        said = str(error)
    finally:
        os.name = "posix"
    assert said.startswith("the workflow: needs bash"), said


if __name__ == "__main__":
    pretend(sys.argv[1])
    use()
    if sys.argv[1] == "win32":
        refuse()

"""Asks the process that jobs are forked from for one, see `reobserve.forking.server`."""

from __future__ import annotations

import json
import os
import signal
import socket
import struct
import sys
from contextlib import suppress

# Where a build that runs its jobs here says where to ask: the path of a socket.
SOCKET = "REOBSERVE_FORK_SERVER"

LENGTH = struct.Struct("!Q")  # of a request, in bytes
CODE = struct.Struct("!i")  # of an exit; below zero it is the signal that ended the process


def ask(path: str) -> int | None:
    """Have ``sys.argv`` run in a forked process, and wait; its exit code, None if nobody listens.

    A process that a signal ended ends this one by the same signal.
    """
    with socket.socket(socket.AF_UNIX) as connection:
        try:
            connection.connect(path)
        except OSError:
            return None
        environment = {name: value for name, value in os.environ.items() if name != SOCKET}
        request = {"words": sys.argv, "folder": os.getcwd(), "environment": environment}
        text = json.dumps(request).encode()
        try:
            socket.send_fds(connection, [LENGTH.pack(len(text))], [0, 1, 2])
            connection.sendall(text)
            answer = connection.recv(CODE.size, socket.MSG_WAITALL)
        except OSError:
            answer = b""
        if len(answer) < CODE.size:
            print("reobserve: the process that jobs are forked from has ended", file=sys.stderr)
            return 1
        code: int = CODE.unpack(answer)[0]
        if code < 0:
            with suppress(OSError):  # of some signals nothing else can be had
                signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
        return code

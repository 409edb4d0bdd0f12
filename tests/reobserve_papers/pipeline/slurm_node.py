"""A single-node Slurm in a folder: the distribution's daemons, for the duration of a block."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

DAEMONS = ("munged", "slurmctld", "slurmd")
CLIENTS = ("sbatch", "scancel", "scontrol", "sinfo", "squeue", "srun")
PATH = os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"))

# No accounting, no cgroups, no other user: jobs are processes of the user who runs the tests.
_CONF = """\
ClusterName=reobserve
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
MpiDefault=none
ReturnToService=2
KillWait=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory}
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE
"""


def missing() -> list[str]:
    """The missing programs."""
    return [name for name in (*DAEMONS, *CLIENTS, "setpriv") if not shutil.which(name, path=PATH)]


@contextmanager
def slurm_node(folder: Path) -> Iterator[dict[str, str]]:
    """Start all daemons in an empty folder with a short name; returns the variables for clients.

    Whatever happens in the block, all daemons and jobs are ended after it; if this process is
    killed, the kernel ends the daemons.
    """
    conf = folder / "slurm.conf"
    environment = os.environ | {
        "PATH": f"{folder / 'bin'}{os.pathsep}{PATH}", "SLURM_CONF": str(conf)
    }  # fmt: skip
    _write_files(folder, conf)
    key, socket_ = f"--key-file={folder}/munge.key", f"--socket={folder}/munge.socket"
    with ExitStack() as running:
        running.callback(_kill_all_of, conf)
        _start(running, environment, folder, "munged", "--foreground", "--force", key, socket_,
               f"--pid-file={folder}/munged.pid", f"--seed-file={folder}/munged.seed",
               f"--log-file={folder}/munged.log")  # fmt: skip
        _wait_for((folder / "munge.socket").exists, folder)
        _start(running, environment, folder, "slurmctld", "-D")
        _start(running, environment, folder, "slurmd", "-D")
        _wait_for(lambda: ask(environment, "sinfo", "--noheader", "--format=%T") == "idle", folder)
        yield environment


def ask(environment: dict[str, str], *command: str) -> str:
    """The output of a client; empty if it fails."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def _write_files(folder: Path, conf: Path) -> None:
    for name in ("state", "spool", "bin"):
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.touch(mode=0o600)
    key.write_bytes(secrets.token_bytes(128))
    # The executor copies all Slurm variables from job steps, including this one.
    step = folder / "bin" / "srun"
    srun = shutil.which("srun", path=PATH)
    step.write_text(f'#!/bin/sh\nSLURM_CONF="{conf}" exec "{srun}" "$@"\n')
    step.chmod(0o755)
    with socket.socket() as one, socket.socket() as other:
        for each in (one, other):
            each.bind(("127.0.0.1", 0))
        ports = [each.getsockname()[1] for each in (one, other)]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
    text = _CONF.format(
        folder=folder, host=socket.gethostname().partition(".")[0], ports=ports, user=os.getuid(),
        cpus=os.cpu_count(), memory=memory * 9 // 10,
    )  # fmt: skip
    conf.write_text(text, encoding="utf-8")


def _start(
    running: ExitStack, environment: dict[str, str], folder: Path, name: str, *arguments: str
) -> None:
    """Start a daemon in the foreground, to be ended with the stack."""
    command = ["setpriv", "--pdeathsig", "TERM", name, *arguments]
    log = running.enter_context((folder / f"{name}.out").open("w"))
    process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    running.callback(_end, process)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _kill_all_of(conf: Path) -> None:
    """Kill processes left by daemons: job steps, identified by their configuration."""
    reported = f"SLURM_CONF={conf}".encode()
    for place in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if reported in place.read_bytes().split(b"\0"):
                os.kill(int(place.parent.name), signal.SIGKILL)


def _wait_for(condition: Callable[[], bool], folder: Path) -> None:
    end = time.monotonic() + 30
    while not condition():
        said = {path.name: path.read_text() for path in folder.glob("*.out")}
        assert time.monotonic() < end, f"Slurm does not start: {said}"
        time.sleep(0.1)

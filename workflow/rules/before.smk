# What happens once, before the first job of a build.

import atexit
import fcntl
import json
import os
import socket
import subprocess

from reobserve.forking.client import SOCKET
from reobserve.plain_data.files import write_text


def take_build_lock():
    """Hold the folder for this build, or say that another one does.

    The kernel drops this lock when the process ends, however it ends, so a killed build needs no
    unlocking. The profile turns off Snakemake's own lock, which outlives a killed process.
    """
    global build_lock
    build_lock = open(".snakemake/build.lock", "a+")
    try:
        fcntl.flock(build_lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        sys.exit(
            "reobserve: another build is running in this folder; wait for it to end"
        )


def start_jobs_at_any_rate():
    """Lift Snakemake's limit to the jobs that begin in a second, which is for submitting them.

    To keep it, the scheduler sets itself a timer whenever it looks at its jobs, looks at them again
    when that rings, and sets the next: so each job that ends lets it look once a second more, for
    as long as the build goes on. Of a build of 160 jobs that takes more than half of what the
    scheduler computes. The command line can state a limit, but not that there is none.
    """
    workflow.scheduler.job_rate_limiter = None


# To import everything once takes as long as what this many jobs import.
WORTH_FORKING = 4


def start_fork_server():
    """Have the jobs of this build forked from one process, if they run here and by this Python.

    It ends with this process, however that ends: then nobody holds the other end of its standard
    input.
    """
    path = Path(".snakemake/fork.socket")
    path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen(256)
        server = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "reobserve.forking.server",
                str(listener.fileno()),
            ],
            stdin=subprocess.PIPE,
            pass_fds=[listener.fileno()],
            start_new_session=True,
        )
    atexit.register(server.communicate)
    shell.prefix(f"{PREFIX}export {SOCKET}={path}; ")


def write_ledgers():
    """Write the ledgers that changed, once all that changed since its last check is checked."""
    stamp = PROJECT / ".snakemake" / "checked_ledgers.json"
    found = {
        paper: digest([ledger.text(), code_of_check(paper)])
        for paper, ledger in LEDGERS.items()
    }
    known = read_stamp(stamp)
    changed = [paper for paper in LEDGERS if known.get(paper) != found[paper]]
    if changed:
        check_ledgers(changed)
        write_text(stamp, json.dumps(found))
    for paper, ledger in LEDGERS.items():
        path = PROJECT / AGELESS["ledger"].format(paper=paper)
        if not path.is_file() or path.read_text(encoding="utf-8") != ledger.text():
            write_text(path, ledger.text())


def code_of_check(paper):
    parts = [paper_part(paper, part) for part in ("keys", "ledger")]
    return closure_digest(["reobserve.stages.check", *parts])


def read_stamp(path):
    """What was checked at which digest; nothing if that cannot be read."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return {}


# Seconds after which loops that are interpreted have cost more than to compile them.
PATIENCE = 5.0


def check_ledgers(papers):
    """Build what the ledgers of some papers state, in a process of its own: it loads kernels.

    Their loops take a few steps there, and are interpreted: to compile them takes longer. What is
    refused so is checked by compiled ones, too, which divide by zero without a word.
    """
    overrides = {paper: config[paper] for paper in papers if paper in config}
    command = [sys.executable, "-m", "reobserve", "check", "--overrides", "-", "--"]

    def check(seconds=None, **variables):
        return subprocess.run(
            [*command, *papers],
            input=json.dumps(overrides),
            capture_output=True,
            text=True,
            timeout=seconds,
            env={**os.environ, **variables},
        )

    try:
        if check(PATIENCE, NUMBA_DISABLE_JIT="1").returncode == 0:
            return
    except subprocess.TimeoutExpired:
        pass
    done = check()
    if done.returncode:
        sys.exit(done.stderr.strip().splitlines()[-1])

# What happens once, before the first job of a build.

import fcntl
import json
import subprocess

from reobserve.files import write_text


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


def write_ledgers():
    """Write what changed. With overrides, every plant and observer is built once to check them."""
    for paper, ledger in LEDGERS.items():
        path = PROJECT / ledger_path(paper)
        if path.exists() and path.read_text(encoding="utf-8") == ledger.text():
            continue
        if config.get(paper):
            check_overrides(paper, path)
        else:
            write_text(path, ledger.text())


def check_overrides(paper, path):
    """Write a ledger by the command line, which refuses values that no stage could use."""
    command = ["-m", "reobserve", "ledger", paper, "--seed", str(config["seed"])]
    overrides = ["--overrides", json.dumps(config[paper]), "--output", str(path)]
    done = subprocess.run(
        [sys.executable, *command, *overrides], capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(done.stderr.strip())

"""Machine code on disk: signatures are not mixed up, and no cache costs more than time."""

from __future__ import annotations

import os
import pty
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import reobserve

# Saves the code of one signature in step with a process that saves another: both read the index,
# the float's is written, then index and code of the integer, then the code of the float: under one
# name. Who does not come is not waited for long.
SAVE = """
import sys, time
from pathlib import Path
from numba.core.caching import IndexDataCacheFile

folder, mine, others = Path(sys.argv[1]), *sys.argv[2:]

def wait(event):
    deadline = time.monotonic() + 1
    while not (folder / event).exists() and time.monotonic() < deadline:
        time.sleep(0.01)

def in_step(self, key, data, save=IndexDataCacheFile.save):
    read, put = self._load_index, self._save_index

    def read_both():
        index = read()
        (folder / f"{mine} read").touch()
        wait(f"{others} read")
        return index

    def put_in_turn(index):
        if mine == "int":
            wait("float put")
        put(index)
        (folder / f"{mine} put").touch()
        if mine == "float":
            wait("int saved")

    self._load_index, self._save_index = read_both, put_in_turn
    save(self, key, data)
    (folder / f"{mine} saved").touch()

IndexDataCacheFile.save = in_step
sys.path.insert(0, str(folder))
from sums import twice

(folder / f"{mine} ready").touch()
while not (folder / f"{others} ready").exists():
    time.sleep(0.01)
twice(1.5 if mine == "float" else 1)
"""
RUN = "import sys; sys.path.insert(0, sys.argv[1]); from sums import twice; print(twice(1))"


def test_two_signatures_saved_at_once_are_kept_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sums.py").write_text(
        "from reobserve.numerics.kernel import kernel\n\n\n"
        "@kernel\ndef twice(x):\n    return x + x\n"
    )
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    python = [sys.executable, "-c"]
    savers = [
        subprocess.Popen([*python, SAVE, str(tmp_path), *names])
        for names in (("float", "int"), ("int", "float"))
    ]
    assert [saver.wait() for saver in savers] == [0, 0]
    run = [*python, RUN, str(tmp_path)]
    assert subprocess.run(run, capture_output=True, text=True, check=True).stdout == "2\n"


@pytest.fixture
def sums(tmp_path: Path) -> Path:
    """A folder with a module that has a kernel."""
    (tmp_path / "sums.py").write_text(
        "from reobserve.numerics.kernel import kernel\n\n\n"
        "@kernel\ndef twice(x):\n    return x + x\n"
    )
    return tmp_path


def run(folder: Path, program: str, **environment: str) -> str:
    """What a program prints that has nothing to complain about."""
    command = [sys.executable, "-c", program, str(folder)]
    told = {**os.environ, **environment}
    done = subprocess.run(command, env=told, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


HITS = RUN + "; print(len(twice.stats.cache_hits))"
COMPILED, LOADED = "2\n0\n", "2\n1\n"


def test_damaged_machine_code_is_removed_and_compiled_anew(sums: Path) -> None:
    cache = str(sums / "cache")
    assert run(sums, HITS, NUMBA_CACHE_DIR=cache) == COMPILED
    assert run(sums, HITS, NUMBA_CACHE_DIR=cache) == LOADED
    (index,), (code,) = ((sums / "cache").rglob(f"*.{suffix}") for suffix in ("nbi", "nbc"))
    whole = code.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for path, damaged in ((index, index.read_bytes()[:-9]), (code, whole[:-9]), (code, flipped)):
        path.write_bytes(damaged)
        assert run(sums, HITS, NUMBA_CACHE_DIR=cache) == COMPILED
    assert run(sums, HITS, NUMBA_CACHE_DIR=cache) == LOADED


def test_the_code_of_another_signature_is_not_run(sums: Path) -> None:
    """As two processes leave it that chose one name for two signatures, and one of them died."""
    both = RUN + "; print(twice(1.5))"
    cache = str(sums / "cache")
    assert run(sums, both, NUMBA_CACHE_DIR=cache) == "2\n3.0\n"
    first, second = sorted((sums / "cache").rglob("*.nbc"))
    second.write_bytes(first.read_bytes())
    assert run(sums, both, NUMBA_CACHE_DIR=cache) == "2\n3.0\n"


def test_folders_that_cannot_be_written_cost_time_only(sums: Path) -> None:
    blocked = sums / "file"
    blocked.write_text("a file where a folder must be: that stops root, too")
    (sums / "tmp").mkdir()
    temporary = {"NUMBA_CACHE_DIR": f"{blocked}/cache", "TMPDIR": str(sums / "tmp")}
    assert run(sums, HITS, **temporary) == COMPILED
    assert run(sums, HITS, **temporary) == LOADED, "kept among the temporary files"
    (folder,) = (sums / "tmp").iterdir()
    assert folder.stat().st_mode & 0o077 == 0
    # Others may look into it.
    folder.chmod(0o755)
    assert run(sums, HITS, **temporary) == LOADED
    # Somebody else might have put code there: it is left alone, and nothing is kept.
    folder.chmod(0o777)
    assert run(sums, HITS, **temporary) == COMPILED


def test_a_package_and_a_home_that_cannot_be_written_cost_time_only(sums: Path) -> None:
    """As where one user installs and another, who has no home, runs: it ended at the import."""
    package = sums / "reobserve"
    (package / "numerics").mkdir(parents=True)
    for module in ("__init__", "numerics/__init__", "numerics/kernel", "numerics/kernel_cache"):
        source = Path(reobserve.__file__).parent / f"{module}.py"
        shutil.copy(source, package / f"{module}.py")
    for folder in (sums, package, package / "numerics"):
        (folder / "__pycache__").write_text("a file where a folder must be: that stops root, too")
    (sums / "tmp").mkdir()
    nowhere = {"HOME": f"{sums}/__pycache__", "XDG_CACHE_HOME": f"{sums}/__pycache__/cache"}
    environment = {**nowhere, "NUMBA_CACHE_DIR": "", "TMPDIR": str(sums / "tmp")}
    assert run(sums, HITS, **environment) == COMPILED
    assert run(sums, HITS, **environment) == LOADED, "kept among the temporary files"
    (folder,) = (sums / "tmp").iterdir()
    folder.chmod(0o777)
    assert run(sums, HITS, **environment) == COMPILED


def test_copies_of_the_package_share_what_is_compiled(tmp_path: Path) -> None:
    """As far as their sources are the same; a module elsewhere keeps to its own place."""
    modules = ("__init__", "numerics/__init__", "numerics/kernel", "numerics/kernel_cache")
    program = RUN.replace("from sums", "from reobserve.numerics.sums")
    program += "; print(len(twice.stats.cache_hits))"
    cache = str(tmp_path / "cache")
    for number, (result, found) in enumerate(
        (("x + x", COMPILED), ("x + x", LOADED), ("3 * x", "3\n0\n"))
    ):
        folder = tmp_path / str(number)
        (folder / "reobserve/numerics").mkdir(parents=True)
        for module in modules:
            source = Path(reobserve.__file__).parent / f"{module}.py"
            shutil.copy(source, folder / f"reobserve/{module}.py")
        (folder / "reobserve/numerics/sums.py").write_text(
            "from reobserve.numerics.kernel import kernel\n\n\n"
            f"@kernel\ndef twice(x):\n    return {result}\n"
        )
        assert run(folder, program, NUMBA_CACHE_DIR=cache) == found


FULL = """
import sys
from numba.core.caching import IndexDataCacheFile

def full(self, path):
    raise OSError(28, "No space left on device")

IndexDataCacheFile._open_for_write = full
sys.modules["fcntl"] = None  # as where there is no such module
sys.path.insert(0, sys.argv[1])
from sums import twice
print(twice(1))
"""


def test_a_full_disk_costs_time_only(sums: Path) -> None:
    assert run(sums, FULL, NUMBA_CACHE_DIR=str(sums / "cache")) == "2\n"
    assert not list((sums / "cache").rglob("*.nb*"))


def test_the_first_compilation_is_said_at_a_terminal_only(sums: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(sums / "cache")}
    command, told = [sys.executable, "-c", RUN, str(sums)], []
    for _ in range(2):
        here, there = pty.openpty()
        done = subprocess.run(
            command, env=environment, stdout=subprocess.PIPE, stderr=there, text=True, check=True
        )
        os.close(there)
        assert done.stdout == "2\n"
        try:
            told.append(os.read(here, 10_000).decode())
        except OSError:  # closed without a word
            told.append("")
        os.close(here)
    assert told[0].startswith("reobserve: compiling loops for this machine, up to a minute, once")
    assert told[0].count("\n") == 1
    assert told[1] == ""

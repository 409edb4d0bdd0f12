"""Machine code on disk: two processes that compile one kernel do not mix up their signatures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

# Saves the code of one signature in step with a process that saves another: both read the index,
# the float's is written, then index and code of the integer, then the code of the float. Who is
# kept waiting by a lock does not come, and is not waited for long.
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
        "from reobserve.kernel import kernel\n\n\n@kernel\ndef twice(x):\n    return x + x\n"
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

"""The page on adding to the bench, followed literally in an empty folder."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.hand_written import PAGES, ROOT, blocks

PAGE = PAGES / "how-to" / "add-to-the-bench.md"
TITLED = {found[1]: block.text for block in blocks(PAGE)
          if (found := re.fullmatch(r'title="(.*)"', block.options))}  # fmt: skip
TYPED = [line[2:] for block in blocks(PAGE) if block.language == "console"
         for line in block.text.splitlines()]  # fmt: skip


@pytest.mark.nightly
def test_following_the_page_adds_a_task_and_a_method(tmp_path: Path) -> None:
    path = os.pathsep.join([str(tmp_path), str(ROOT / "src")])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_OPT": "1"}

    def run(typed: str) -> None:
        words = [sys.executable, "-m", *typed.replace("reobserve-", "reobserve_").split()]
        done = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr

    def errors() -> dict[tuple[str, ...], float]:
        """On the first seeds: how many there are depends on all rows."""
        with (tmp_path / "tank/table.csv").open(newline="") as stream:
            return {
                (row["condition"], row["method"], row["training"], row["given_noise"]):
                float(row["first"]) for row in csv.DictReader(stream)
            }  # fmt: skip

    for name in ("tank.py", "tank.yaml", "inverted.py"):
        (tmp_path / name).write_text(TITLED[name], encoding="utf-8")
    assert len(TYPED) == 6
    for typed in TYPED[:4]:
        run(typed)
    before = errors()
    assert (
        before["noise", "random_walk", "nominal", "yes"]
        < before["noise", "random_walk", "nominal", "no"]
    )
    assert "| AugmentedKalmanFilter | tau, noise |" in (tmp_path / "table.md").read_text()
    assert (tmp_path / "tank/heatmap.svg").stat().st_size > 1000
    kept = (tmp_path / "tuned/tank/random_walk.json").read_bytes()
    with (tmp_path / "tank.yaml").open("a", encoding="utf-8") as stream:
        stream.write(TITLED["methods"])
    for typed in TYPED[4:]:
        run(typed)
    assert (tmp_path / "tuned/tank/random_walk.json").read_bytes() == kept
    after = errors()
    assert {key: after[key] for key in before} == before
    assert (
        after["nominal", "inverted", "nominal", "no"]
        > after["nominal", "random_walk", "nominal", "no"]
    )

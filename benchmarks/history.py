"""Ratios to C over earlier runs, and which have fallen in several runs in a row."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import Any

_KEPT = 60  # runs
_EARLIER, _LATEST = 3, 3  # how many runs there must be to compare with, and how many fall
_REST = 0.8  # of the median of earlier runs


def add(folder: Path, results: Path) -> list[str]:
    """Copy the results of a run into a folder of earlier ones; what has fallen, as sentences."""
    folder.mkdir(parents=True, exist_ok=True)
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H%M%S.%f")
    (folder / f"{now}.json").write_bytes(results.read_bytes())
    paths = sorted(folder.glob("*.json"))
    for path in paths[:-_KEPT]:
        path.unlink()
    return fallen([json.loads(path.read_bytes()) for path in paths[-_KEPT:]])


def fallen(runs: Sequence[dict[str, Any]]) -> list[str]:
    """Ratios to C that fell by a fifth below the median of earlier runs in each of the latest."""
    tables = [_ratios(run) for run in runs]
    found = []
    for name in tables[-1]:
        earlier, latest = (
            [table[name] for table in part if name in table]
            for part in (tables[:-_LATEST], tables[-_LATEST:])
        )
        if len(earlier) < _EARLIER or len(latest) < _LATEST:
            continue
        usual = median(earlier)
        if max(latest) < _REST * usual:
            listed = ", ".join(f"{ratio:.0%}" for ratio in latest)
            found.append(f"{name}: {listed} in the latest runs, {usual:.0%} before")
    return found


def _ratios(run: dict[str, Any]) -> dict[str, float]:
    """The speed relative to C of each row, by a name for the row."""
    return {
        f"{row['what']}, of {row['peer']}": row["ratio"]
        for section in run["sections"].values()
        for row in section["rows"]
        if row["peer"].partition(" ")[0] == "C" and not row["cost"]
    }

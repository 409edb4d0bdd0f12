"""Evaluate papers under a `Condition`, as ``python -m`` of this module, in a process of its own.

The condition's variables are set before the process starts; see `runs`.
"""

from __future__ import annotations

import json
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.errors import ReobserveError
from reobserve.evidence.golden.kept import kept_paper
from reobserve.ledger.ledger import default_ledger
from reobserve.plain_data.files import write_whole
from reobserve.replication.evaluation import Evaluator
from reobserve.timeseries.series import Channel, Series


class MovedByOneUlp(Evaluator):
    """An evaluator whose plants' records are off by one unit in the last place, up or down."""

    def run(self, step: str, *names: str) -> Any:
        """Compute a step; the record of a plant is moved."""
        record = super().run(step, *names)
        if step != "plant":
            return record
        random = np.random.default_rng(0)

        def moved(values: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
            up = random.random(values.shape) < 0.5
            other = np.nextafter(values, np.where(up, np.inf, -np.inf))
            # Modes, counts and what is held at a round value are exact on every processor.
            return np.where(values == np.round(values), values, other)

        channels = {
            name: Channel(moved(channel.values), channel.unit)
            for name, channel in record.channels.items()
        }
        return Series(record.time, channels, record.events, record.provenance)


def main(project: str, output: str, order: str) -> int:
    """Evaluate what ``order`` says, JSON, and leave it in ``output``, pickled; 1 on an error."""
    wanted = json.loads(order)
    try:
        found = {}
        for paper, parts in wanted["papers"].items():
            ledger = default_ledger(Path(project), paper)
            if wanted["refined"]:
                ledger = ledger.refined()
            evaluator = (MovedByOneUlp if wanted["one_ulp"] else Evaluator)(ledger)
            found[paper] = kept_paper(evaluator, parts)
        write_whole(output, lambda partial: _put(partial, found))
    except ReobserveError as error:
        print(f"reobserve: {error}", file=sys.stderr)
        return 1
    return 0


def _put(path: Path, found: Any) -> None:
    path.write_bytes(pickle.dumps(found))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

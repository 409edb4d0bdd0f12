"""Scores on records with rounding errors, which stand in for other processors.

python -m reobserve_papers.bench.perturbed TASK.yaml TUNED REPEAT TABLE
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reobserve.tuning.results import write_cells
from reobserve.tuning.scoring import score_task
from reobserve.tuning.task import Array, TaskRecord
from reobserve.tuning.tuned_file import read_tuned
from reobserve_papers.bench.packaged_task import PackagedTask

_LARGEST = 8 * np.finfo(float).eps  # of a number: what some operations leave


@dataclass(frozen=True)
class PerturbedTask(PackagedTask):
    """A task whose methods read numbers with relative errors up to `_LARGEST`."""

    repeat: int = 0

    def record(self, condition: str, seed: int) -> TaskRecord:
        """The record of a condition and a seed, with other errors in each repeat."""
        exact = super().record(condition, seed)
        random = np.random.default_rng((self.repeat, seed))

        def rounded(values: Array) -> Array:
            moved: Array = values * (1.0 + _LARGEST * random.uniform(-1.0, 1.0, values.shape))
            return moved

        return replace(
            exact, inputs=rounded(exact.inputs), measurements=rounded(exact.measurements)
        )


def main(task_file: str, tuned: str, repeat: str, table: str) -> None:
    """Write the table of the methods, as `reobserve-papers bench score` does."""
    task = replace(PerturbedTask.read(task_file), repeat=int(repeat))
    write_cells(score_task(task, read_tuned(task, Path(tuned))), Path(table))


if __name__ == "__main__":
    main(*sys.argv[1:])

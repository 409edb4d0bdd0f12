"""Observers with gains at random, which a check of estimates must not accept."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from math import log
from statistics import median
from typing import NamedTuple

import numpy as np

from reobserve.core.errors import InputError
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.signals.random_streams import random_stream

RANDOM = "random"  # as an observer of metrics: the median over all of them

_SEED, _COUNT, _TRIALS = 0, 5, 2000
_RANGE = 0.1, 1000.0  # of the size of a gain: from the smallest to the largest of the designs


class Drawn(NamedTuple):
    """Gains without a design."""

    gains: Gains


def random_gains(system: AugmentedSystem) -> list[Gains]:
    """Gains of stable PI observers, of any sign and with sizes that are log-uniform."""
    stream = random_stream(_SEED, "eso", "random gains")
    shape = _TRIALS, system.size, system.outputs
    sizes = np.exp(stream.uniform(log(_RANGE[0]), log(_RANGE[1]), shape))
    drawn = sizes * stream.choice([-1.0, 1.0], shape)
    slowest = np.linalg.eigvals(system.A_tilde - drawn @ system.C_tilde).real.max(axis=-1)
    stable = drawn[slowest < -1e-3][:_COUNT]
    if len(stable) < _COUNT:
        raise InputError("system", f"is stable with {len(stable)} of {_TRIALS} random gains")
    return [Gains(L, np.zeros_like(L)) for L in stable]


def medians(metrics: Iterable[Metric]) -> Iterator[Metric]:
    """The median of each metric over the observers that have it."""
    groups: dict[tuple[str, str], list[float]] = defaultdict(list)
    for score in metrics:
        groups[score.metric, score.unit].append(score.value)
    for (metric, unit), values in groups.items():
        yield Metric(RANDOM, metric, median(values), unit)

"""The reading of (3) that the ledger names: its numbers once more, under a name of their own.

A claim about the learning observer asks for the numbers of `LEARNING`; which of the readings these
are of is one of the choices over which the claim is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from reobserve.papers.ilo import keys
from reobserve.replication.metrics.metrics import Metric

LEARNING = "learning"
READINGS = {  # observers, by name and form
    "sampled": keys.Sampled,
    "continuous": keys.Continuous,
    "forgetting": keys.Continuous,
}


def of_reading(metrics: Sequence[Metric], reading: str) -> Iterator[Metric]:
    """Those numbers of one reading that every reading has, as those of `LEARNING`."""
    shared = set.intersection(
        *({one.metric for one in metrics if one.observer == name} for name in READINGS)
    )
    for one in metrics:
        if one.observer == reading and one.metric in shared:
            yield replace(one, observer=LEARNING)

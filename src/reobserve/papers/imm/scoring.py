"""What is said of mode probabilities: before the fault, after it, and how soon."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve.papers.imm import keys
from reobserve.papers.imm.keys import MODES
from reobserve.replication.metrics.metrics import Score
from reobserve.replication.metrics.responses import window

Array = NDArray[np.float64]


def check_rules(rules: keys.Metrics, horizon: float) -> None:
    """Refuse windows that no sample up to the horizon [s] is in."""
    with located("metrics"):
        for name in ("before", "after", "overshoot"):
            first = getattr(rules, name)[0]
            if first >= horizon:
                raise InputError(
                    name, f"starts at {first:g} s, must start before the end at {horizon:g} s"
                )


def probabilities(
    rules: keys.Metrics, time: Array, probability: Array, onset: float, fault: int
) -> Iterator[Score]:
    """Means over the windows, their spread, alarm and diagnosis, and the overshoot.

    That is how far the normal mode is at most from its later mean, above or below.
    ``fault`` is the index of the mode that begins at ``onset`` [s].
    """
    for when in ("before", "after"):
        chosen = probability[window(time, *getattr(rules, when), closed="right")]
        for mode, mean in zip(MODES, np.mean(chosen, axis=0), strict=True):
            yield f"{mode}_{when}", float(mean), "1"
    late = probability[window(time, *rules.after, closed="right")]
    for mode, spread in zip(MODES, np.std(late, axis=0), strict=True):
        yield f"{mode}_spread", float(spread), "1"
    early = probability[window(time, *rules.overshoot, closed="right")]
    yield "overshoot", float(np.max(np.abs(early[:, 0] - np.mean(late[:, 0])))), "1"
    faulty = time > onset + 1e-9
    healthy = ~faulty & (time > rules.before[0])
    alarm = _since(time, faulty & (probability[:, 0] < rules.alarm), onset)
    yield "alarm_delay", alarm, "s"
    yield "alarm_samples", round(alarm / (time[1] - time[0]), 6), "1"
    right = np.argmax(probability, axis=1) == fault
    yield "diagnosis_delay", _since(time, faulty & right, onset), "s"
    yield "diagnosed_share", float(np.mean(right[window(time, *rules.after, closed="right")])), "1"
    false = probability[healthy, 0] < rules.alarm
    yield "false_alarm_share", float(np.mean(false)), "1"


def quoted_distance(
    rules: keys.Metrics, time: Array, probability: Array, quoted: Any, high: bool
) -> float:
    """Root mean square distance from the values that the paper quotes, over time.

    ``quoted`` are the probabilities of the normal and of the leakage mode after the fault; with
    ``high`` that of the normal mode before it is compared with one, too. Over time and not of the
    means, so that a probability that jumps between 0 and 1 does not pass for one in between.
    """
    late = probability[window(time, *rules.after, closed="right")]
    squares = [np.mean((late[:, mode] - quoted[place]) ** 2) for place, mode in enumerate((0, 2))]
    if high:
        early = probability[window(time, *rules.before, closed="right")]
        squares.append(np.mean((early[:, 0] - 1.0) ** 2))
    return float(np.sqrt(np.mean(squares)))


def _since(time: Array, chosen: NDArray[np.bool_], onset: float) -> float:
    """How long after the onset the first chosen sample is [s]; nan for none."""
    return float(time[np.argmax(chosen)] - onset) if chosen.any() else float("nan")

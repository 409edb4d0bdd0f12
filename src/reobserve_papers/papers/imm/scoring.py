"""Metrics of mode probabilities before and after the fault, and of the alarm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.metrics.metrics import Score
from reobserve_papers.metrics.responses import check_windows, scored
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES

Array = NDArray[np.float64]

GUESS = "guess"  # as an observer of metrics: a bank that always gives all modes the same


def check_rules(rules: keys.Metrics, horizon: float, period: float) -> None:
    """Refuse windows that hold no sample of those ``period`` [s] apart."""
    windows = {name: getattr(rules, name) for name in ("before", "after", "overshoot")}
    check_windows(windows, horizon, period, closed="right")


def probabilities(
    rules: keys.Metrics, time: Array, probability: Array, onset: float, fault: int
) -> Iterator[Score]:
    """Means over the windows, their spread, the alarm, the diagnosis and the overshoot.

    The overshoot is the maximum deviation of the normal mode from its later mean, above or below.
    The alarm is nan if there was a false one before the fault, from the start of the window
    ``before`` on. ``fault`` is the index of the mode that begins at ``onset`` [s].
    """
    first = probability[scored("metrics.before", time, *rules.before, closed="right")]
    early = probability[scored("metrics.overshoot", time, *rules.overshoot, closed="right")]
    late = probability[scored("metrics.after", time, *rules.after, closed="right")]
    yield "normal_before", float(np.mean(first, axis=0)[0]), "1"
    for mode, mean in zip(MODES, np.mean(late, axis=0), strict=True):
        yield f"{mode}_after", float(mean), "1"
    for index in (0, 2):
        yield f"{MODES[index]}_spread", float(np.std(late, axis=0)[index]), "1"
    away = np.abs(early[:, 0] - np.mean(late[:, 0]))
    yield "overshoot", float(np.max(away)), "1"
    alarms, later = probability[:, 0] < rules.alarm, time > onset + 1e-9
    quiet = not np.any(alarms & ~later & (time > rules.before[0] + 1e-9))
    alarms &= later
    delay = time[np.argmax(alarms)] - onset if quiet and alarms.any() else np.nan
    yield "alarm_samples", round(float(delay) / (time[1] - time[0]), 6), "1"
    right = np.argmax(late, axis=1) == fault
    yield "diagnosed_share", float(np.mean(right)), "1"


def off_quoted(
    observers: Mapping[str, keys.Observer], name: str, quantity: str, value: float
) -> float:
    """Distance of a mean probability from the quoted one, or zero if the paper quotes none."""
    if name not in observers:
        return 0.0 if np.isfinite(value) else np.inf
    observer = observers[name]
    if quantity == "normal_before":
        return 1.0 - value if observer.quoted_high else 0.0
    return float(abs(value - observer.quoted[("normal_after", "leakage_after").index(quantity)]))


def quoted_distance(
    rules: keys.Metrics, time: Array, probability: Array, quoted: Any, high: bool
) -> float:
    """Root mean square distance from the values that the paper quotes, over time.

    ``quoted`` are the probabilities of the normal and of the leakage mode after the fault. With
    ``high`` that of the normal mode before it is also compared with one. The mean is over time, so
    that a probability that jumps between 0 and 1 does not pass for one in between.
    """
    late = probability[scored("metrics.after", time, *rules.after, closed="right")]
    squares = [np.mean((late[:, mode] - quoted[place]) ** 2) for place, mode in enumerate((0, 2))]
    if high:
        early = probability[scored("metrics.before", time, *rules.before, closed="right")]
        squares.append(np.mean((early[:, 0] - 1.0) ** 2))
    return float(np.sqrt(np.mean(squares)))

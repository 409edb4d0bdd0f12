"""Thresholds of a detector's statistic by the false alarms on healthy records.

A detector alarms where its statistic exceeds a threshold. Which one depends on what the statistic
does without a fault, and that healthy records show.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_numbers, as_scalar


def false_alarm_threshold(maxima: ArrayLike, false_alarm_probability: float) -> float:
    """Threshold that a new healthy record exceeds with this probability at most.

    The largest statistic of one more record is as likely to be the first, second, ... of all n + 1,
    so it exceeds the j-th of n with a probability of 1 - j / (n + 1), whatever its distribution is:
    the tolerance limit of Wilks (1941). For one choice of the n records the probability is a number
    from a beta distribution of parameters n + 1 - j and j: with 79 records at 5 %, 1.4 to 10.7 %
    in 95 % of cases.

    Parameters
    ----------
    maxima
        The largest statistic of each healthy record, shape (n,). The records are independent, and
        as long as those that false alarms are counted on.
    false_alarm_probability
        Between 0 and 1; n must be at least its inverse less one.

    Raises
    ------
    InputError
        If a statistic is nan, the probability is not between 0 and 1, or there are too few records
        for it.

    Examples
    --------
    >>> from reobserve import false_alarm_threshold
    >>> maxima = [3.1, 2.7, 4.0, 3.3, 2.9, 3.6, 3.0, 2.8, 3.2]  # of nine healthy records
    >>> print(false_alarm_threshold(maxima, false_alarm_probability=0.2))
    3.6
    """
    values = as_numbers("maxima", maxima)
    if values.ndim != 1 or np.isnan(values).any():
        raise InputError("maxima", f"{shown(maxima)} must be numbers, shape (n,)")
    probability = as_scalar("false_alarm_probability", false_alarm_probability)
    if not 0 < probability < 1:
        problem = f"{probability:g} must be between 0 and 1"
        raise InputError("false_alarm_probability", problem)
    place = math.ceil((1.0 - probability) * (len(values) + 1) - 1e-9)
    if place > len(values):
        least = 1.0 / probability - 1.0
        needed = f"{math.ceil(least - 1e-9)}" if least < 1e15 else "more than 1e15"
        raise InputError(
            "false_alarm_probability",
            f"{probability:g} needs {needed} records without a fault or more, "
            f"there are {len(values)}",
        )
    return float(np.sort(values)[place - 1])

"""How many multiplications and additions the estimation laws take: Remark 1, counted.

Counted is what a law adds to the equation of w^, which all observers have and which gives w - w^:
for three axes and gains that are multiples of the identity, per sampling period of the rate.

    learning   v = K1 v(t - tau) + K2 (w - w^)     no product by K1 = I
    adaptive   f^' = Gamma (w - w^)                the step belongs to the gain in Euler's method

Euler's method evaluates a law once a period. The classical Runge-Kutta method evaluates it four
times, at three instants; the adaptive law then has three sums z + h l to make on the way and
z + h / 6 (l1 + 2 (l2 + l3) + l4) at the end. A v that is held is updated at every so many periods
by either method.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.papers.ilo import keys
from reobserve.papers.ilo.reading import READINGS
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import Job

_AXES = 3


@part
def measure(job: Job) -> Iterator[Metric]:
    """Operations per sampling period of each reading, and of the integral law.

    Chen & Saif 2007, Remark 1.
    """
    theory = job.theory
    for name in READINGS:
        observer = job.observers[name]
        remembered = not np.array_equal(np.asarray(observer.K1), 1.0)  # takes a product by K1
        if isinstance(observer, keys.Sampled):
            count = _learning(1, 1, remembered) / theory.periods_per_update
        elif theory.integration == "euler":
            count = _learning(1, 1, remembered)
        else:
            count = _learning(4, 3, remembered)
        yield Metric(name, "operations", float(count), "1")
    yield Metric("adaptive", "operations", float(_adaptive(theory.integration)), "1")


def _learning(evaluations: int, instants: int, remembered: bool) -> int:
    return _AXES * (2 * evaluations + remembered * instants)


def _adaptive(integration: str) -> int:
    if integration == "euler":
        return _AXES * 2
    slopes, stages, end = 4, 3 * 2, 2 + 4
    return _AXES * (slopes + stages + end)

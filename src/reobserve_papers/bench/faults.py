"""Random faults of stated classes, as terms of a signal (`reobserve_papers.signals.inputs`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from reobserve.core.errors import InputError, shown
from reobserve.core.validation import Names, checked

CLASSES = ("step", "sine", "ramp", "square")


def _check(place: str, names: Sequence[str]) -> None:
    if unknown := sorted(set(names) - set(CLASSES)):
        raise InputError(place, f"{shown(unknown[0])} must be one of {', '.join(CLASSES)}")


FaultClasses = Annotated[Names, checked(_check)]
Ends = tuple[float, float]


def random_faults(
    draw: np.random.Generator,
    classes: Sequence[str],
    axes: int,
    horizon: float,
    *,
    onset: Ends,
    size: Ends,
    frequency: Ends,
) -> list[dict[str, Any]]:
    """A fault on each axis, of another class as far as there are some: records differ less then.

    Sign, size and onset [s] are random. A sine begins at zero, a ramp ends at its size, and a
    square goes from plus to minus its size. Frequencies [rad/s] are spread evenly on a logarithmic
    scale. As many random numbers are drawn whatever the classes are.
    """
    ranks = draw.uniform(size=len(CLASSES))
    order = sorted(classes, key=lambda kind: ranks[CLASSES.index(kind)])
    faults = []
    for axis in range(axes):
        begin, rate = draw.uniform(*onset), float(np.exp(draw.uniform(*np.log(frequency).tolist())))
        end = draw.uniform(*size) * np.sign(draw.uniform(-1.0, 1.0))
        terms: dict[str, dict[str, Any]] = {
            "step": {"kind": "constant", "size": end},
            "sine": {"kind": "sine", "amplitude": end, "frequency": rate, "phase": -rate * begin},
            "ramp": {"kind": "ramp", "slope": end / (horizon - begin)},
            "square": {"kind": "square", "high": end, "low": -end, "period": 2 * np.pi / rate,
                       "until": horizon + 1.0},
        }  # fmt: skip
        faults.append({"axis": axis + 1, "from": begin, **terms[order[axis % len(order)]]})
    return faults

"""The state of a bank of filters, and the checks of its filters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.value import Value
from reobserve.observers.gaussian_state import Gaussian, Matrices, ModeFilter, periods_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ImmState(Value):
    """All the bank remembers: what each filter believes, and the logarithms of mu, shape (r,).

    Means (r, n), covariances (r, n, n) and a posteriori output errors (r, m) of all filters stand
    one behind the other, as the compiled loop takes them. ``sample`` and ``count`` are as in
    `reobserve.observers.record.ObserverState`; y may be nan. ``held`` is what was given by row
    and leads from that sample to the next, of each filter; ``time`` is that of the sample [s], or
    None where it is counted; ``noise`` are the variances of R, (m,), where they are estimated, and
    ``past`` are the inputs of rows before, where these have a delay.
    """

    means: Array
    covariances: Array
    errors: Array
    log_probabilities: Array
    sample: Array | None = None
    count: int = 0
    held: tuple[Matrices, ...] | None = None
    time: float | None = None
    noise: Array | None = None
    past: Array | None = None

    @property
    def posteriors(self) -> tuple[Gaussian, ...]:
        """The posterior of each filter."""
        parts = zip(self.means, self.covariances, self.errors, strict=True)
        return tuple(Gaussian(*part) for part in parts)


def check_filters(filters: Any) -> None:
    """Refuse what is no list of filters that a bank can mix.

    Raises
    ------
    InputError
        With the filter that differs from the first.
    """
    if not isinstance(filters, list | tuple) or not filters:
        raise InputError("filters", f"{shown(filters)} must be a list of one filter or more")
    for j, mode in enumerate(filters):
        wanted = ("predict", "correct", "model")
        if isinstance(mode, type) or not all(hasattr(mode, part) for part in wanted):
            problem = f"{shown(mode)} must have a model, predict and correct"
            raise InputError(f"filters[{j}]", problem)
        size, first = size_of(mode), size_of(filters[0])
        if size != first:
            problem = f"has {size} states, inputs and outputs, the first filter {first}"
            raise InputError(f"filters[{j}]", problem)
        period, first_period = mode.model.sampling_period, filters[0].model.sampling_period
        if period != first_period:
            problem = f"has a sampling period of {period:g} s, the first {first_period:g} s"
            raise InputError(f"filters[{j}]", problem)
        for name in ("gate", "noise_memory"):
            if getattr(mode, name, None) is not None:
                problem = f"has {name} of its own: the bank takes it, for all filters"
                raise InputError(f"filters[{j}]", problem)
        if not all(map(np.array_equal, periods_of(mode), periods_of(filters[0]))):
            problem = "has other periods of angles than the first filter"
            raise InputError(f"filters[{j}]", problem)


def size_of(mode: ModeFilter) -> tuple[int, int, int]:
    """The numbers of states, inputs and outputs of a filter."""
    model = getattr(mode, "whole", mode.model)
    return model.states, model.inputs, model.outputs

"""Check that the covariance R of the measurement noise can be estimated while a filter runs.

A row says how large the noise of a measurement is by R S^-1 e. Where R is a small part of the
innovation's covariance S, as the state is hardly predicted, this is small: the change that a row
makes has the factor (R / S)^2, so that the estimate takes (S / R)^2 times its memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.systems.linear import LinearModel

LEAST = 0.1  # of the variance of an innovation: the estimate then takes a hundred memories


def refuse_given(observer: Any, given: Mapping[str, Any]) -> None:
    """Refuse what cannot be given to a filter that has a gate or estimates R."""
    if observer.gate is not None and "S" in given:
        problem = "must be left out with a gate: by S a rejected measurement moves the next state"
        raise InputError("S", problem)
    if observer.noise_memory is None:
        return
    for name, why in (
        ("R", "noise_memory says that it is estimated"),
        ("S", "it would be that of another R than the one that noise_memory estimates"),
        ("dt", "noise_memory counts sampling periods"),
    ):
        if name in given:
            raise InputError(name, f"must be left out: {why}")


def check_noise_memory(observer: Any) -> None:
    """Refuse a memory that is shorter than a row, or an R that can hardly be seen.

    The latter is decided for linear models, by the covariance that the filter comes to.
    """
    memory, period = observer.noise_memory, observer.sampling_period
    if not observer.has_kalman_gain:
        problem = f"must be left out: {type(observer).__name__} has another gain than Kalman's"
        raise InputError("noise_memory", problem)
    if memory < period:
        problem = f"{memory:g} s must be the sampling period, {period:g} s, or longer"
        raise InputError("noise_memory", problem)
    model = observer.whole
    if not isinstance(model, LinearModel):
        return
    from reobserve.synthesis.linear_gain import steady_kalman_gain

    try:
        gain = steady_kalman_gain(model)
    except InputError as error:
        problem = f"cannot be used: the filter comes to no rest: {error.problem}"
        raise InputError("noise_memory", problem) from None
    # R S^-1 = I - C K
    innovation = np.linalg.solve(np.eye(model.outputs) - model.C @ gain, model.R)
    share = np.diag(model.R) / np.diag(innovation)
    worst = int(np.argmin(share))
    if share[worst] < LEAST:
        names = model.output_names
        name = f"output {worst + 1}" if names is None else names[worst]
        problem = (
            f"cannot be used: the noise of {name} is {share[worst]:.2g} of the variance of its "
            f"innovation, so that its estimate would take {share[worst] ** -2:.3g} memories; it "
            f"must be {LEAST:g} or more"
        )
        raise InputError("noise_memory", problem)

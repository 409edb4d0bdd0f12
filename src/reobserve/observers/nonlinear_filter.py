"""Common parts of the extended and the unscented Kalman filter: their loop and its failures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.covariances import as_covariances
from reobserve.core.errors import InputError
from reobserve.core.value import for_loop
from reobserve.observers import linear_loop
from reobserve.observers.gaussian_state import FilterSteps, InRecord, as_held, side_by_side
from reobserve.observers.nonlinear_filter_work import (
    NO_OUTPUT,
    NO_POSTERIOR,
    NO_ROOT,
    NO_STATE,
    new_filter_work,
)
from reobserve.observers.nonlinear_steps import predict_nonlinear, run_nonlinear
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_flow import NonlinearRows

Array = NDArray[np.float64]

LONGER = 1e-3  # of a sampling period: how much longer the time to a row may be
MOST_PARTS = 10_000_000  # predictions in a gap, a second or more

TAKES = ("Q", "R", "parameters", "dt", "keep")
CAUSES = {
    NO_STATE: "f, or the covariance after it, is not finite at the next sample",
    NO_OUTPUT: "h is not finite at the next sample",
    **linear_loop.CAUSES,
    NO_ROOT: "the covariance of the state is no longer positive semidefinite, so that it has no "
    "Cholesky factor",
    NO_POSTERIOR: "the next correction is not finite",
}


def by_row(
    model: NonlinearModel,
    given: Mapping[str, Any],
    rows: int,
    held: Mapping[str, Array],
    periods: Array | None,
) -> tuple[dict[str, Any], Array]:
    """Q, R and the steps of a record of k rows, and values of the parameters behind its inputs.

    ``given`` are Q, R and parameters by name, ``held`` those that lead to the first row, where they
    are not the model's. ``periods`` [s] lead to each row, (k + 1,), from the one before the record
    on; None where all are the sampling period.
    """
    fields: dict[str, Any] = {"Q": for_loop(model.Q)[None], "R": for_loop(model.R)[None]}
    fields["steps"], fields["parts"] = model.steps, np.ones((1, 2), np.int64)
    values = model.parameter_values[None]
    if periods is not None:
        if not model.continuous:
            problem = "can only be given for a model of a differential equation, by from_ode"
            raise InputError("dt", problem)
        if model.density is None and "Q" not in given:
            raise InputError(
                "Q", "is the covariance of one sampling period; for other periods give "
                "from_ode the density of the noise, or Q by row",
            )  # fmt: skip
        parts = parts_of(periods, model.sampling_period)
        fields["steps"] = periods / (model.substeps * parts)
        fields["parts"] = np.stack([parts, parts], axis=1)
        if model.density is not None:
            fields["Q"] = model.density * (periods / parts)[:, None, None]
        # What is given is the noise of the whole time to a row.
        if "Q" in held:
            fields["parts"][0, 1] = 1
        if "Q" in given:
            fields["parts"][1:, 1] = 1
    if "R" in given:
        fields["R"] = as_covariances("R", given["R"], model.outputs, rows, definite=True)
    first = held["Q"][None] if "Q" in held else fields["Q"][:1]
    if "Q" in given:
        read = as_covariances("Q", given["Q"], model.states, rows)
        fields["Q"] = np.concatenate([first, read])
    elif "Q" in held:
        fields["Q"] = np.concatenate([first, fields["Q"][0 if periods is None else 1 :]])
    if "parameters" in given or "parameters" in held:
        read = model.parameters_by_row(given.get("parameters", {}), rows)
        before = held.get("parameters", model.parameter_values)
        later = np.broadcast_to(read, (rows, read.shape[1]))
        values = np.concatenate([before[None], later])
    return fields, values


def parts_of(periods: Array, sampling_period: float) -> NDArray[np.int64]:
    """The number of predictions, of a sampling period at most, that lead to each row."""
    counts = np.ceil(periods / sampling_period - LONGER)
    if counts.max() > MOST_PARTS:
        raise InputError(
            "dt", f"of {periods.max():g} s between two rows is {counts.max():g} sampling periods, "
            f"must be {MOST_PARTS} or fewer, as each is predicted",
        )  # fmt: skip
    return np.maximum(counts, 1).astype(np.int64)


def nonlinear_in_record(
    filter: Any,  # noqa: A002
    given: Mapping[str, Any],
    y: Array,
    inputs: Array,
    held: Mapping[str, Array],
    periods: Array | None,
) -> InRecord:
    """The noise and steps of each row, and inputs with the parameters behind them."""
    fields, values = by_row(filter.model, given, len(y), held, periods)
    after = {}
    if "Q" in given:
        after["Q"] = fields["Q"][-1]
    if "parameters" in given:
        after["parameters"] = values[-1]
    if "dt" in given and periods is not None:
        after["dt"] = periods[-1:]
    if values.size:
        inputs = side_by_side(inputs, values)
    return InRecord(NonlinearRows(filter.functions, **fields), inputs, as_held(after))


NONLINEAR = FilterSteps(
    NonlinearModel, nonlinear_in_record, run_nonlinear, predict_nonlinear, new_filter_work, CAUSES
)

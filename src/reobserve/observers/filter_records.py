"""Runs of a filter on many records in one compiled loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from reobserve.observers.estimated_noise import refuse_given
from reobserve.observers.gaussian_state import KalmanState, inputs_of_rows, reached
from reobserve.observers.linear_loop import FilterPosteriors
from reobserve.observers.record import Batch, Record
from reobserve.observers.vague_start import warn_of_starts

if TYPE_CHECKING:
    from reobserve.observers.gaussian_filter import GaussianFilter


def can_run_together(records: Sequence[Record], states: Sequence[KalmanState]) -> bool:
    """True if the same matrices lead to the rows of all records."""
    first, first_record = states[0], records[0]
    alike = all(
        (state.sample is None) == (first.sample is None) and state.held is first.held is None
        for state in states
    )
    return alike and first_record.periods is None and "S" not in first_record.given


def posteriors_of(observer: GaussianFilter, states: Sequence[KalmanState]) -> FilterPosteriors:
    """Copies of what the states hold, which the loops move."""
    posteriors, learned = [state.posterior for state in states], observer.noise_memory is not None
    return FilterPosteriors(
        np.array([posterior.mean for posterior in posteriors]),
        np.array([posterior.covariance for posterior in posteriors]),
        np.array([posterior.error for posterior in posteriors]),
        np.array([state.noise for state in states]) if learned else np.empty((len(states), 1)),
        np.array([float(state.count + (state.sample is not None)) for state in states]),
    )


def run_together(
    observer: GaussianFilter, records: Sequence[Record], states: Sequence[KalmanState]
) -> Batch:
    """Run the compiled loop on records that `can_run_together`."""
    first, first_record = states[0], records[0]
    given, fresh = observer._given(first_record.given, len(first_record.y)), first.sample is None
    refuse_given(observer, given)
    pairs = zip(states, records, strict=True)
    inputs = np.array([inputs_of_rows(state.sample, record) for state, record in pairs])
    y = np.array([record.y for record in records])
    model, inputs, held = observer._in_record(given, y[0], inputs)
    keep = observer._names_to_keep(given) if given else ()
    after = posteriors_of(observer, states)
    starts = after.covariances.diagonal(0, 1, 2).copy()
    rows, kept, ends = observer._filtered(model, inputs, y, fresh, after, keep)
    n, _, m = observer._sizes
    if first.count <= n and n * m > 1:
        P, S = (array[:, : n + 1] for array in rows[1:4:2])
        warn_of_starts(starts, P.diagonal(0, 2, 3), ends[:, 0], S)
    causes = observer.steps.causes
    return Batch(
        observer._by_name(rows, kept, keep), {}, ends[:, 0].tolist(),
        [reached(after, r, states[r], records[r], held, observer._sizes) for r in range(len(y))],
        [causes[cause] if cause else "" for cause in ends[:, 1].tolist()],
    )  # fmt: skip

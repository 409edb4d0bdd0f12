"""Stage metrics: how well the fault is estimated, how fast it is seen, and what theory predicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from reobserve.ledger.types import Job, Settings, read_job
from reobserve.papers.ilo import keys
from reobserve.papers.ilo.prediction import predicted_error
from reobserve.papers.ilo.scoring import Errors, scored
from reobserve.scoring.metrics import Metric, first_crossing, peak, root_mean_square, settling_time
from reobserve.timeseries.series import Series


def measure(
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    study: Sequence[Mapping[str, str]] | None = None,
) -> list[Metric]:
    """The numbers of a figure, observer by observer; see ``results/README.md`` for their names.

    Raises
    ------
    InputError
        If a setting of the metrics cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    axis = job.metrics.axis
    found = [
        Metric(name, *numbers)
        for name, estimate in estimates.items()
        for numbers in _judge(job, plant, estimate, name, axis - 1)
    ]
    if study is not None:
        found += _summarise(study)
    return found


def _summarise(rows: Sequence[Mapping[str, str]]) -> list[Metric]:
    """The mean over runs at each level, as metrics named after the sweep and the level."""
    groups: dict[tuple[str, str, str], list[float]] = {}
    for row in rows:
        key = (row["observer"], row["sweep"], row["level"])
        groups.setdefault(key, []).append(float(row["relative_rms_error"]))
    return [
        Metric(observer, f"relative_rms_error_at_{sweep}_{float(level):g}", float(np.mean(v)), "1")
        for (observer, sweep, level), v in groups.items()
    ]


def _judge(
    job: Job, plant: Series, estimate: Series, name: str, axis: int
) -> Iterator[tuple[str, float, str]]:
    rules = job.metrics
    onsets = plant.events["onsets"]
    errors = Errors.of(plant, estimate, axis)
    score = scored(errors, onsets, rules.settling_skip)
    end = float(estimate.time[-1])
    late = errors.window(end - rules.late_window)
    first = onsets[0] if onsets else end
    last = onsets[-1] if onsets else 0.0
    before = estimate.time < first - 1e-9
    time, v = estimate.time[~before], estimate["fault"][~before]
    v_before = estimate["fault_before"][~before]
    threshold = rules.residual_threshold

    rms = root_mean_square(score.start, score.end)
    yield "rms_error", rms, "N m"
    yield "relative_rms_error", rms / root_mean_square(score.fault_start, score.fault_end), "1"
    yield "peak_error", peak(score.start, score.end), "N m"
    yield "late_rms_error", root_mean_square(late.start, late.end), "N m"
    yield "final_error", abs(float(errors.end[-1])), "N m"
    yield "residual_before_fault", peak(estimate["fault"][before]), "N m"
    seen = first_crossing(time, v[:-1, axis], v_before[1:, axis], threshold)
    yield "detection_delay", seen - first, "s"
    after = errors.window(last)
    settled = settling_time(np.append(after.time, end), after.start, after.end, threshold)
    yield "settling_time", settled - last, "s"
    yield "leakage", peak(np.delete(v, axis, axis=1)), "N m"
    predicted = predicted_error(job, job.observers[name], axis)
    if predicted is not None:
        yield "predicted_rms_error", predicted, "N m"

"""Stage metrics: how well the fault is estimated, how fast it is seen, and what theory predicts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.ledger.figure_data import FigureData
from reobserve.papers.ilo.prediction import predicted_error
from reobserve.papers.ilo.scoring import Errors, scored
from reobserve.scoring.metrics import Metric, Score, scores_of
from reobserve.scoring.responses import first_crossing, peak, settling_time


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure, observer by observer; see `MEANINGS`."""
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    score = "relative_rms_error"
    if data.study:  # the mean over the runs at each level
        for (observer, sweep, level), runs in data.study.groups("observer", "sweep", "level"):
            yield Metric.at(observer, (score, float(np.mean(runs[score])), "1"), **{sweep: level})


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    job, plant, estimate = data.job, data.plant, data.estimates[name]
    rules = job.metrics
    axis = rules.axis - 1
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

    yield "rms_error", score.root_mean_square, "N m"
    yield "relative_rms_error", score.relative_root_mean_square, "1"
    yield "peak_error", peak(score.start, score.end), "N m"
    yield "late_rms_error", late.root_mean_square, "N m"
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

"""Page's sum of two filters, on a record whose model changes halfway."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.detection.restarted_cusum import restarted_cusum
from reobserve.observers.kalman import KalmanFilter
from reobserve.tuning.task import Array
from tests.reobserve.observers.actuator_models import ripple, square_wave, velocity_model


def by_hand(one: KalmanFilter, other: KalmanFilter, y: Array, u: Array, spread: float) -> Array:
    """Page's sum by matrices; the second filter restarts when the sum is zero."""
    means, spreads = [np.zeros((4, 1))] * 2, [spread * np.eye(4)] * 2
    models, g, found = [one.model, other.model], 0.0, []
    for k in range(len(y)):
        logs = []
        for j, model in enumerate(models):
            A, B, C, R = (np.asarray(part) for part in (model.A, model.B, model.C, model.R))
            if k:
                means[j] = A @ means[j] + B * u[k - 1]
                spreads[j] = A @ spreads[j] @ A.T + model.Q
            S = C @ spreads[j] @ C.T + R
            e, K = y[k] - C @ means[j], spreads[j] @ C.T / S
            means[j], spreads[j] = means[j] + K @ e, spreads[j] - K @ C @ spreads[j]
            logs.append(-0.5 * (np.log(2 * np.pi * S) + e**2 / S).item())
        g = max(0.0, g + logs[1] - logs[0])
        if g == 0.0:
            means[1], spreads[1] = means[0], spreads[0]
        found.append(g)
    return np.array(found)


def test_restarted_sum_agrees_with_matrix_recursion() -> None:
    one, other = (KalmanFilter(velocity_model(mode)) for mode in ("normal", "leakage"))
    rows, onset = 800, 400
    u, y, x = square_wave(rows, 50), 0.01 * ripple(rows), np.zeros(4)
    for k in range(rows):
        y[k] += one.model.C @ x
        model = (one if k < onset else other).model
        x = model.A @ x + model.B @ u[k]
    found = restarted_cusum(one, other, y, u, one.init(np.zeros(4), 1e-6))
    assert found == pytest.approx(by_hand(one, other, y, u, 1e-6), rel=1e-8, abs=1e-8)
    assert (found[:onset] == 0).mean() > 0.5
    assert found[-1] > 50

"""The plot of a run: bands of two deviations, and true values."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve import AugmentedKalmanFilter, KalmanFilter, LinearModel
from reobserve.core.errors import InputError

MODEL = LinearModel(
    [[0.9, 0.1], [0.0, 0.8]], [[0.0], [1.0]], [[1.0, 0.0]], Q=0.01 * np.eye(2), R=0.04
)
Y = np.linspace(0, 1, 20)


def ends(band: object) -> tuple[float, float]:
    """The lowest and highest ordinate at the last sample."""
    (path,) = band.get_paths()  # type: ignore[attr-defined]
    last = path.vertices[path.vertices[:, 0] == path.vertices[:, 0].max(), 1]
    return last.min(), last.max()


def test_bands_are_two_deviations_wide() -> None:
    kalman = KalmanFilter(MODEL)
    run = kalman.run(Y, np.zeros(20), start=kalman.init([0, 0], 1.0))
    state, innovation = run.plot(["state", "innovation"]).axes
    for column, band in enumerate(state.collections):
        x, deviation = run["state"][-1, column], np.sqrt(run["variance"][-1, column])
        assert ends(band) == pytest.approx((x - 2 * deviation, x + 2 * deviation))
    (band,) = innovation.collections
    deviation = np.sqrt(run["innovation_covariance"][-1, 0, 0])
    assert ends(band) == pytest.approx((-2 * deviation, 2 * deviation))
    assert not run.plot(["covariance"]).axes[0].collections


def test_unknown_input_has_a_band_and_its_true_value() -> None:
    observer = AugmentedKalmanFilter(MODEL, fault_matrix=[[0.0], [1.0]], random_walk=1e-3)
    run = observer.run(Y, np.zeros(20), start=observer.init([0, 0], 1.0))
    fault = np.where(np.arange(20) < 10, 0.0, 0.3)
    (axes,) = run.plot(["unknown_input"], known={"unknown_input": fault}).axes
    d, deviation = run["unknown_input"][-1, 0], np.sqrt(run["unknown_input_variance"][-1, 0])
    assert ends(axes.collections[0]) == pytest.approx((d - 2 * deviation, d + 2 * deviation))
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), fault)


def test_true_values_of_another_shape_are_refused() -> None:
    kalman = KalmanFilter(MODEL)
    run = kalman.run(Y, np.zeros(20), start=kalman.init([0, 0], 1.0))
    with pytest.raises(InputError, match=r"known state: has shape \(20,\), must be \(20, 2\)"):
        run.plot(["state"], known={"state": Y})
    with pytest.raises(InputError, match="there is no 'fault'"):
        run.plot(["state"], known={"fault": Y})

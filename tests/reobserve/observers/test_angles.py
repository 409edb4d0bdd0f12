"""Angles: a filter across the cut is the same filter turned away from it."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.core.errors import InputError
from reobserve.detection import nees
from reobserve.systems.periods import wrapped

PERIOD, STEP = 0.1, 0.5
TURN = np.array([[-1.0, 0.0], [0.0, -1.0]])  # half a turn about the sensor


def bearings(turned: bool) -> NonlinearModel:
    """A point that moves past a sensor at the origin, which measures its bearing."""
    return NonlinearModel(
        lambda s: np.array([s[0] + PERIOD * s[2], s[1] + PERIOD * s[3], s[2], s[3]]),
        lambda s: np.array([np.arctan2(s[1], s[0])]),
        [1e-6] * 4, 1e-4, states=4, outputs=1, sampling_period=PERIOD,
        output_periods=None if turned else [2 * np.pi],
    )  # fmt: skip


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_bearing_filter_across_the_cut_is_the_turned_filter(kind: type) -> None:
    path = np.array([np.full(300, -10.0), 5 - PERIOD * STEP * np.arange(300)]).T
    noise = 0.01 * np.random.default_rng(0).standard_normal(300)
    across = wrapped(np.arctan2(path[:, 1], path[:, 0]) + noise, 2 * np.pi)
    away = wrapped(across + np.pi, 2 * np.pi)
    assert np.abs(np.diff(across)).max() > 6
    assert np.abs(np.diff(away)).max() < 0.1
    found = {}
    for turned, y in ((False, across), (True, away)):
        observer = kind(bearings(turned))
        sign = -1.0 if turned else 1.0
        start = sign * np.array([-10, 5, 0, -STEP])
        run = observer.run(y, start=observer.init(start, [1, 1, 0.01, 0.01]))
        smooth = rts_smoother(run)
        found[turned] = [sign * run["state"], sign * smooth["state"], run["covariance"]]
        np.testing.assert_allclose(run["innovation"], found[False][0][:, :1] * 0, atol=0.05)
    for one, other in zip(found[False], found[True], strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-10)
    assert np.abs(found[False][0][:, :2] - path).max() < 1.0


def compass(**periods: object) -> LinearModel:
    """A heading and its rate, in degrees."""
    return LinearModel(
        [[1, PERIOD], [0, 1]], C=[[1, 0]], Q=[1e-2, 1e-1], R=4.0, sampling_period=PERIOD,
        state_names=["heading", "rate"], output_names=["compass"], **periods,
    )  # fmt: skip


HEADING = 25.0 * PERIOD * np.arange(400) + 30.0
STRAIGHT = HEADING + 2.0 * np.random.default_rng(1).standard_normal(400)
COMPASS = STRAIGHT % 360.0


def test_heading_that_goes_round_is_the_one_that_goes_on() -> None:
    straight = KalmanFilter(compass())
    expected = straight.run(STRAIGHT, start=straight.init([30, 0], 100.0))
    smooth = rts_smoother(expected)
    goes_on = KalmanFilter(compass(output_periods=[360.0]))
    run = goes_on.run(COMPASS, start=goes_on.init([30, 0], 100.0))
    np.testing.assert_allclose(run["state"], expected["state"], atol=1e-9)
    wraps = KalmanFilter(compass(output_periods={"compass": 360}, state_periods={"heading": 360}))
    run = wraps.run(COMPASS, start=wraps.init([30, 0], 100.0))
    np.testing.assert_allclose(run["state"], wrapped(expected["state"], [360, 0]), atol=1e-9)
    assert np.abs(run["state_heading"]).max() <= 180.0
    np.testing.assert_allclose(
        rts_smoother(run)["state"], wrapped(smooth["state"], [360, 0]), atol=1e-9
    )
    truth = np.column_stack([HEADING % 360.0, np.full(400, 25.0)])
    np.testing.assert_allclose(
        nees(run, truth), nees(expected, np.column_stack([HEADING, truth[:, 1]])), atol=1e-7
    )
    state = wraps.init([30, 0], 100.0)
    for row, y in zip(run["state"], COMPASS, strict=True):
        state, estimate = wraps.step(state, y)
        assert np.array_equal(estimate["state"], row)


def test_augmented_filter_and_bank_go_round() -> None:
    bias = {"fault_matrix": [[0.0], [1.0]], "random_walk": 1e-3}
    straight = AugmentedKalmanFilter(compass(), **bias)
    wraps = AugmentedKalmanFilter(compass(output_periods=[360], state_periods=[360, None]), **bias)
    expected = straight.run(STRAIGHT, start=straight.init([30, 0], 100.0))
    run = wraps.run(COMPASS, start=wraps.init([30, 0], 100.0))
    np.testing.assert_allclose(run["unknown_input"], expected["unknown_input"], atol=1e-9)
    np.testing.assert_allclose(run["state"], wrapped(expected["state"], [360, 0]), atol=1e-9)

    def bank(**periods: object) -> IMM:
        slow, quick = compass(**periods), compass(**periods)
        quick = LinearModel(
            quick.A, C=quick.C, Q=[1e-2, 50.0], R=4.0, sampling_period=PERIOD,
            state_periods=quick.state_periods, output_periods=quick.output_periods,
        )  # fmt: skip
        return IMM([KalmanFilter(slow), KalmanFilter(quick)], [[0.95, 0.05], [0.1, 0.9]])

    straight_bank = bank()
    expected = straight_bank.run(STRAIGHT, start=straight_bank.init([30, 0], 100.0))
    for mixed in (bank(output_periods=[360], state_periods=[360, None]),):
        run = mixed.run(COMPASS, start=mixed.init([30, 0], 100.0))
        np.testing.assert_allclose(run["probability"], expected["probability"], atol=1e-9)
        np.testing.assert_allclose(run["covariance"], expected["covariance"], atol=1e-8)
        np.testing.assert_allclose(run["state"], wrapped(expected["state"], [360, 0]), atol=1e-9)


def test_nonlinear_state_goes_round_through_sigma_points_and_one_by_one_in_a_bank() -> None:
    def model(round_: bool) -> NonlinearModel:
        return NonlinearModel(
            ["heading + 0.1*rate", "rate"], ["heading"], [1e-2, 1e-1], 4.0,
            state_names=["heading", "rate"], sampling_period=PERIOD,
            state_periods={"heading": 360} if round_ else None,
            output_periods=[360] if round_ else None,
        )  # fmt: skip

    for kind in (UnscentedKalmanFilter, ExtendedKalmanFilter):
        found = []
        for round_, y in ((False, STRAIGHT), (True, COMPASS)):
            observer = kind(model(round_))
            run = observer.run(y, start=observer.init([30, 0], 100.0))
            both = IMM([observer, observer], [[0.9, 0.1], [0.1, 0.9]])
            banked = both.run(y[:60], start=both.init([30, 0], 100.0))
            smooth = rts_smoother(run)
            found.append([run["state"], smooth["state"], banked["state"], run["covariance"]])
        for straight, wraps in zip(*(one[:3] for one in found), strict=True):
            np.testing.assert_allclose(wrapped(straight, [360, 0]), wraps, atol=1e-8)
        np.testing.assert_allclose(found[0][3], found[1][3], atol=1e-8)


def test_line_of_an_angle_is_interrupted_where_it_goes_round() -> None:
    observer = KalmanFilter(compass(output_periods=[360], state_periods=[360, None]))
    run = observer.run(COMPASS, start=observer.init([30, 0], 100.0))
    heading, rate = run.plot(["state"], known={"state": run["state"]}).axes[0].lines[::2]
    turns = np.isnan(heading.get_ydata()).sum()
    assert turns == (np.abs(np.diff(run["state_heading"])) > 180).sum() > 2
    assert not np.isnan(rate.get_ydata()).any()


@pytest.mark.parametrize(
    ("periods", "message"),
    [
        ({"output_periods": [360, 360]}, "must be a list of 1 periods"),
        ({"output_periods": [-1]}, r"output_periods\[0\]"),
        ({"output_periods": {"compas": 360}}, "compass"),
        ({"state_periods": 360}, "must be a list of 2 periods"),
    ],
)
def test_periods_that_are_none_are_refused(periods: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        compass(**periods)


def test_matrices_by_which_an_angle_is_another_after_a_period_are_refused() -> None:
    with pytest.raises(InputError, match="C: row 1, column 1 times the period 360 must be a whole"):
        compass(state_periods=[360, None])
    with pytest.raises(InputError, match="A: row 1, column 1"):
        LinearModel([[0.9]], C=[[1]], Q=1, R=1, state_periods=[360], output_periods=[360])
    LinearModel([[1]], C=[[2]], Q=1, R=1, state_periods=[180], output_periods=[360])
    observer = KalmanFilter(compass(output_periods=[360], state_periods=[360, None]))
    for given in ({"A": [[0.5, PERIOD], [0, 1]]}, {"C": [[0.5, 0]]}):
        with pytest.raises(InputError, match="row 1, column 1 times the period 360"):
            observer.run(COMPASS, start=observer.init([30, 0], 1.0), **given)


def test_first_row_is_within_half_a_period_and_banks_do_not_depend_on_their_order() -> None:
    observer = KalmanFilter(compass(output_periods=[360], state_periods=[360, None]))
    run = observer.run([np.nan, -9.0], start=observer.init([350, 0], 1.0))
    assert run["state"][0].tolist() == [-10.0, 0.0]
    model = LinearModel([[1]], C=[[1]], Q=1, R=1, state_periods=[360], output_periods=[360])
    found = []
    for order in ([0, 178, -178], [178, -178, 0]):
        bank = IMM([KalmanFilter(model)] * 3, np.eye(3), mixing=False)
        shares = [1e-6 if one == 0 else 0.5 - 5e-7 for one in order]
        means = [[float(one)] for one in order]
        found.append(bank.run([np.nan], start=bank.init(means, 1.0, probabilities=shares)))
    assert found[0]["state"] == pytest.approx(found[1]["state"], abs=1e-9)
    # Two at 180 +- 2 with the variance 1, and a millionth at a distance of 180.
    assert found[0]["variance"][0, 0] == pytest.approx(5 + 1e-6 * 180**2, rel=1e-3)


def test_banks_of_different_periods_are_refused() -> None:
    observer = KalmanFilter(compass(output_periods=[360]))
    with pytest.raises(InputError, match=r"filters\[1\]: has other periods"):
        IMM([observer, KalmanFilter(compass())], [[0.9, 0.1], [0.1, 0.9]])

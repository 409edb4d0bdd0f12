"""Many records at once, what a run keeps, names of its columns, and compiled code."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as PeerKalman
from numpy.typing import NDArray

from reobserve import (
    DivergenceError,
    ExtendedKalmanFilter,
    InputError,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from reobserve.core import interrupts
from reobserve.core.interrupts import FIRST
from reobserve.observers import (
    gaussian_filter,
    imm,
    kalman,
    many_records,
    nonlinear_filter,
)
from tests.reobserve.observers.by_row import (
    GIVEN,
    KEEP,
    MODEL,
    PENDULUM,
    ROWS,
    all_but,
    augmented,
    bank,
    differing,
    part,
    random_rows,
    record,
    remembered,
)

Array = NDArray[np.float64]

CROSS = "state_unknown_input_covariance"


def records(count: int = 3) -> tuple[Array, Array]:
    """Measurements with gaps of their own, and inputs."""
    found = [record(seed=seed) for seed in range(count)]
    y, u = (np.array(parts) for parts in zip(*found, strict=True))
    y[1, 0, 0], y[1, 4] = np.nan, [0.2, -0.1]
    return y, u


# --- Many records at once -------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [False, True])
@pytest.mark.parametrize("kind", GIVEN)
def test_many_records_give_the_bits_of_each_alone(
    kind: str, threads: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, (y, u) = GIVEN[kind](), records()
    if threads:
        monkeypatch.setattr(gaussian_filter, "ROWS_FOR_THREADS", 1)
        monkeypatch.setattr(many_records, "cores", lambda: 2)
    states = [one.observer.init(np.add(one.mean, 0.1 * r), 0.5) for r in range(3)]
    first, second = slice(0, 5), slice(5, ROWS)
    for inputs in (u, u[0]):
        a = one.observer.run(y[:, :5], inputs[..., :5, :], start=states, **part(one.given, first))
        rest = part(one.given, second)
        b = one.observer.run(y[:, 5:], inputs[..., 5:, :], start=a.end, **rest)
        for r in range(3):
            known = inputs if inputs.ndim == 2 else inputs[r]
            whole = one.observer.run(y[r], known, start=states[r], **one.given)
            parts = [a.record(r), b.record(r)]
            joined = {name: np.concatenate([each[name] for each in parts]) for name in whole}
            assert not differing(joined, whole.estimates)
            assert not differing(remembered(parts[1].end), remembered(whole.end))
            assert np.array_equal(b["state"][r], parts[1]["state"])
            assert parts[1].diverged_at is None
            assert [len(each) for each in parts] == [5, 4]


def test_records_are_one_run_with_an_axis_for_them() -> None:
    one, (y, u) = GIVEN["Kalman"](), records()
    run = one.observer.run(y, u, start=one.state)
    listed = one.observer.run([each.tolist() for each in y], list(u), start=[one.state] * 3)
    assert not differing(run.estimates, listed.estimates)
    assert run["covariance"].shape == (3, ROWS, 3, 3)
    assert repr(run).startswith(f"Run of 3 records of {ROWS} samples: state")
    assert len(run) == ROWS
    assert len(run.end) == 3
    assert list(run.missing) == [int(np.isnan(each).any(axis=1).sum()) for each in y]
    with pytest.raises(InputError, match=r"^number: 3 must be a record, below 3$"):
        run.record(3)
    with pytest.raises(InputError, match=r"^run: is of many records; take one of them"):
        run.to_pandas()


@pytest.mark.parametrize("row", [0, 5])
def test_a_record_that_diverges_leaves_the_others_alone(row: int) -> None:
    one, (y, u) = GIVEN["Kalman"](), records()
    y[1, row] = 1e200
    with pytest.raises(DivergenceError, match=r"^record 1 \(KalmanFilter\) diverged: .* up to t ="):
        one.observer.run(y, u, start=one.state)
    run = one.observer.run(y, u, start=one.state, on_divergence="return")
    alone = one.observer.run(y[1], u[1], start=one.state, on_divergence="return")
    assert run.diverged_at[1] == alone.diverged_at == pytest.approx(0.1 * max(0, row - 1))
    assert np.isnan(run.diverged_at[[0, 2]]).all()
    assert np.isnan(run["state"][1, row:]).all()
    assert np.isfinite(run["state"][1, :row]).all()
    assert np.isfinite(run["state"][[0, 2]]).all()
    assert not differing(run.record(1).estimates, alone.estimates)
    assert run.record(1).diverged_at == alone.diverged_at
    assert run.record(0).diverged_at is None
    assert run.end[1] is one.state or not differing(remembered(run.end[1]), remembered(one.state))


@pytest.mark.parametrize("kind", ["Kalman", "EKF"])
def test_loops_look_for_interrupts_by_the_rows_of_all_records(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, looks = GIVEN[kind](), []
    monkeypatch.setattr(interrupts, "next_poll", lambda row: looks.append(row) or row + FIRST)
    one.observer.run(np.zeros((3, 100, 2)), np.zeros((3, 100, 2)), start=one.state)
    assert looks == [FIRST, 2 * FIRST]


# --- What a run keeps -----------------------------------------------------------------------------


def test_what_a_run_keeps_agrees_with_filterpy_by_row() -> None:
    (y, u), given, one = record(), all_but("S"), KalmanFilter(MODEL)
    run = one.run(y, u, start=one.init([0.3, -0.2, 0.1], 0.5), **given, keep=KEEP)
    peer = PeerKalman(3, 2, 2)
    peer.x, peer.P = np.array([[0.3], [-0.2], [0.1]]), 0.5 * np.eye(3)
    for k in range(ROWS):
        if k:
            A, B, Q = (given[name][k - 1] for name in "ABQ")
            peer.predict(u[k - 1][:, None], B=B, F=A, Q=Q)
        np.testing.assert_allclose(run["predicted_state"][k], peer.x[:, 0], rtol=1e-11)
        np.testing.assert_allclose(run["predicted_covariance"][k], peer.P, rtol=1e-11)
        there = ~np.isnan(y[k])
        gain = np.zeros((3, 2))
        if there.any():
            C, R = given["C"][k][there], given["R"][k][np.ix_(there, there)]
            left = (y[k] - given["D"][k] @ u[k])[there]
            peer.z, peer._I = np.zeros((len(left), 1)), np.eye(3)
            gain[:, there] = peer.P @ C.T @ np.linalg.inv(C @ peer.P @ C.T + R)
            peer.update(left[:, None], R=R, H=C)
        np.testing.assert_allclose(run["gain"][k], gain, rtol=1e-10, atol=1e-13)
        np.testing.assert_allclose(run["state"][k], peer.x[:, 0], rtol=1e-11)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_kept_rows_of_nonlinear_filters_are_predictions(kind: Any) -> None:
    one, (y, u) = kind(PENDULUM), record()
    state = one.init([0.3, -0.2], 0.5)
    run = one.run(y, u, start=state, keep=KEEP)
    assert not differing(one.run(y, u, start=state, keep="gain").estimates | {
        name: run[name] for name in KEEP
    }, run.estimates)  # fmt: skip
    posterior = state.posterior
    for k in range(ROWS):
        ahead = one.predict(posterior, u[k - 1]) if k else posterior
        assert np.array_equal(run["predicted_state"][k], ahead.mean)
        assert np.array_equal(run["predicted_covariance"][k], ahead.covariance)
        posterior = one.correct(ahead, y[k], u[k]).posterior
        there = ~np.isnan(y[k])
        moved = run["gain"][k][:, there] @ run["innovation"][k][there]
        np.testing.assert_allclose(run["state"][k], ahead.mean + moved, rtol=1e-13, atol=1e-13)
        assert not run["gain"][k][:, ~there].any()


def by_hand() -> tuple[LinearModel, dict[str, Array]]:
    """[x, d] of `augmented` as one model, and its matrices by row."""
    E, F, rows = [[1.0], [0.0], [0.5]], [[0.2], [-0.1]], random_rows()
    zeros = np.zeros

    def matrices(A: Array, B: Array, C: Array, Q: Array) -> dict[str, Array]:
        return {
            "A": np.block([[A, np.array(E)], [zeros((1, 3)), np.eye(1)]]),
            "B": np.vstack([B, zeros((1, 2))]),
            "C": np.hstack([C, F]),
            "Q": np.block([[Q, zeros((3, 1))], [zeros((1, 3)), 0.05 * np.eye(1)]]),
        }

    each = [matrices(*(rows[name][k] for name in "ABCQ")) for k in range(ROWS)]
    given = {name: np.array([one[name] for one in each]) for name in "ABCQ"}
    given |= {"D": rows["D"], "R": rows["R"]}
    given["S"] = np.concatenate([rows["S"], zeros((ROWS, 1, 2))], axis=1)
    own = matrices(MODEL.A, MODEL.B, MODEL.C, MODEL.Q)
    return LinearModel(**own, D=MODEL.D, R=MODEL.R, sampling_period=0.1), given


@pytest.mark.parametrize("names", ["", "ABCDQR", "ABCDQRS"])
def test_augmented_filter_and_smoother_are_those_of_one_model(names: str) -> None:
    (y, u), one, (model, whole) = record(), augmented(), by_hand()
    rows = random_rows()
    given, other = {n: rows[n] for n in names}, {n: whole[n] for n in names}
    peer = KalmanFilter(model)
    spread = np.diag([0.5, 0.5, 0.5, 2.0])
    wanted = peer.run(y, u, start=peer.init([0.3, -0.2, 0.1, 0.4], spread), keep=KEEP, **other)
    state = one.init([0.3, -0.2, 0.1], 0.5, unknown_input=[0.4], unknown_input_covariance=2.0)
    run = one.run(y, u, start=state, keep=[*KEEP, CROSS], **given)
    smooth = rts_smoother(run)
    smoothed = rts_smoother(wanted)
    for found, known in ((run, wanted), (smooth, smoothed)):
        x, P = known["state"], known["covariance"]
        for name, value in {
            "state": x[:, :3], "unknown_input": x[:, 3:], "covariance": P[:, :3, :3],
            "unknown_input_covariance": P[:, 3:, 3:], CROSS: P[:, :3, 3:],
        }.items():  # fmt: skip
            np.testing.assert_allclose(found[name], value, rtol=1e-12, atol=1e-12)
    for name in (*KEEP, "innovation", "log_likelihood"):
        np.testing.assert_allclose(run[name], wanted[name], rtol=1e-12, atol=1e-12)


def test_components_go_by_the_names_of_signals() -> None:
    names: Any = {"state_names": ["p", "v", "a"], "output_names": ["near", "far"]}
    model = LinearModel(**MODEL.arrays._asdict(), sampling_period=0.1, **names)
    (y, u), one = record(), augmented(model, unknown_input_names=["bias"])
    run = one.run(y, u, start=one.init([0.0] * 3, 1.0), keep=CROSS)
    assert np.array_equal(run["state_v"], run["state"][:, 1])
    assert np.array_equal(run["covariance_p_a"], run["covariance"][:, 0, 2])
    assert np.array_equal(run["innovation_far"], run["innovation"][:, 1], equal_nan=True)
    assert np.array_equal(run["unknown_input_bias"], run["unknown_input"][:, 0])
    assert np.array_equal(run[f"{CROSS}_v_bias"], run[CROSS][:, 1, 0])
    smooth = rts_smoother(run)
    assert np.array_equal(smooth["unknown_input_bias"], smooth["unknown_input"][:, 0])
    assert {"state_p", "unknown_input_bias", f"{CROSS}_p_bias"} <= {*run.to_pandas().columns}
    plain = KalmanFilter(model)
    ys, us = records()
    many = plain.run(ys, us, start=plain.init([0.0] * 3, 1.0), keep=KEEP)
    assert np.array_equal(many["predicted_state_a"], many["predicted_state"][..., 2])
    assert np.array_equal(many["gain_p_far"], many["gain"][..., 0, 1])
    assert np.array_equal(many.record(1)["state_v"], many["state"][1, :, 1])


# --- Compiled code --------------------------------------------------------------------------------


def test_other_sizes_noise_and_matrices_by_row_compile_nothing() -> None:
    rng = np.random.default_rng(3)
    loops: Any = kalman.run_linear, nonlinear_filter.run_nonlinear, imm.run_bank

    def linear(n: int, m: int, p: int, by_row: bool, count: int) -> None:
        noise = 0.1 + rng.random()
        model = LinearModel(0.5 * np.eye(n), np.ones((n, p)), np.eye(m, n), None, Q=noise, R=noise)
        given = {name: np.tile(getattr(model, name), (4, 1, 1)) for name in "ABCDQR" if by_row}
        y = rng.normal(size=(4, m) if count == 1 else (count, 4, m))
        u = rng.normal(size=(4, p))
        for one in (KalmanFilter(model), bank(KalmanFilter(model), KalmanFilter(model))):
            one.run(y, u, start=one.init([0.0] * n, 1.0), **given)
            if by_row:
                one.run(y, u, start=one.init([0.0] * n, 1.0), **given, S=np.zeros((4, n, m)))

    def nonlinear(kind: Any, gain: float, noise: float, by_row: bool) -> None:
        model = NonlinearModel(
            ["a - gain*b/9"], "a", noise, noise, state_names=["a"], input_names=["b"],
            parameters={"gain": gain},
        )  # fmt: skip
        given: dict[str, Any] = {"Q": np.full((4, 1, 1), noise)} if by_row else {}
        if by_row:
            given |= {"R": np.full((4, 1, 1), noise), "parameters": {"gain": rng.random(4)}}
        one = kind(model)
        one.run(rng.normal(size=(4, 1)), [0.0] * 4, start=one.init([0.0], 1.0), **given)

    small, large = kalman.UNROLLED, kalman.UNROLLED + 1
    for n in (small, large):
        for by_row in (False, True):  # with noise that is correlated the loops are compiled again
            linear(n, 1, 1, by_row, 1)
    kinds: Any = ExtendedKalmanFilter, UnscentedKalmanFilter
    for kind in kinds:
        nonlinear(kind, 1.0, 0.1, False)
    before = [len(loop.signatures) for loop in loops]
    for n, m, p in ((small, 1, 0), (small, 1, 2), (large, 2, 0), (large + 2, large, 3)):
        for by_row in (False, True):
            linear(n, m, p, by_row, 1)
            linear(n, m, p, by_row, 3)
    for kind in kinds:
        for gain, noise in ((0.3, 0.2), (0.9, 0.4)):
            nonlinear(kind, gain, noise, False)
            nonlinear(kind, gain, noise, True)
    assert [len(loop.signatures) for loop in loops] == before
    assert min(before) > 0


@pytest.mark.parametrize("kind", GIVEN)
def test_states_hold_no_rows_but_the_last(kind: str) -> None:
    one, (y, u) = GIVEN[kind](), record()
    held = one.observer.run(y, u, start=one.state, **one.given).end.held or {}
    for matrices in held if isinstance(held, tuple) else (held,):
        for array in matrices.values():
            assert not array.flags.writeable
            assert array.base is None or array.base.size == array.size


@pytest.mark.parametrize("kind", GIVEN)
def test_what_is_kept_on_request_is_named_with_the_request(kind: str) -> None:
    one, (y, u) = GIVEN[kind](), record()
    names = getattr(one.observer, "keeps", ())
    run = one.observer.run(y, u, start=one.state)
    for name in names:
        with pytest.raises(InputError, match=f"no '{name}': run the filter with keep=\"{name}\"$"):
            run[name]
        kept = one.observer.run(y, u, start=one.state, keep=name)
        assert kept[name].shape[0] == len(y)

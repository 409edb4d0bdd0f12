"""Matrices by row: an exact joint Gaussian, steps and runs, constant ones, filterpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from mpmath import mp
from numpy.typing import NDArray

from reobserve import (
    ExtendedKalmanFilter,
    KalmanFilter,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from tests.reobserve.observers.by_row import (
    GIVEN,
    MODEL,
    PENDULUM,
    ROWS,
    augmented,
    bank,
    differing,
    part,
    random_rows,
    record,
    remembered,
    stepped,
    svsf,
)

Array = NDArray[np.float64]


# --- An exact joint Gaussian of all states and measurements --------------------------------------


def exact(array: Any) -> Any:
    return np.vectorize(mp.mpf, otypes=[object])(np.asarray(array, dtype=np.float64))


def joint(given: Mapping[str, Array], mean: Any, covariance: Any, u: Any) -> tuple[Any, Any]:
    """Mean and covariance of [x(0), ..., x(k-1), y(0), ..., y(k-1)]."""
    A, B, C, D, Q, R, S = (exact(given[name]) for name in "ABCDQRS")
    k, m, n = C.shape
    # All are affine in [x(0), w(0), v(0), w(1), v(1), ...], of this covariance.
    each = n + m
    noise = exact(np.zeros((n + k * each,) * 2))
    noise[:n, :n] = exact(covariance)
    x, u = exact(mean), exact(u)
    of_x = exact(np.eye(n, n + k * each))
    states, outputs = [], []
    for j in range(k):
        w = slice(n + j * each, n + j * each + n)
        v = slice(w.stop, w.stop + m)
        noise[w, w], noise[v, v], noise[w, v], noise[v, w] = Q[j], R[j], S[j], S[j].T
        of_y = C[j] @ of_x
        of_y[:, v] += exact(np.eye(m))
        states.append((x, of_x))
        outputs.append((C[j] @ x + D[j] @ u[j], of_y))
        x, of_x = A[j] @ x + B[j] @ u[j], A[j] @ of_x
        of_x[:, w] += exact(np.eye(n))
    means, maps = (np.concatenate(parts) for parts in zip(*states, *outputs, strict=True))
    return means, maps @ noise @ maps.T


def conditioned(
    means: Any, covariance: Any, wanted: Sequence[int], seen: Sequence[int], values: Any
) -> tuple[Array, Array, float]:
    """Mean and covariance of some entries given the values of others, and their log density."""
    if not len(seen):
        own = covariance[np.ix_(wanted, wanted)]
        return means[wanted].astype(float), own.astype(float), 0.0
    own = mp.matrix(covariance[np.ix_(seen, seen)].tolist())
    inverse = np.array(mp.inverse(own).tolist(), dtype=object)
    off = exact(values) - means[seen]
    cross = covariance[np.ix_(wanted, seen)] @ inverse
    mean = means[wanted] + cross @ off
    spread = covariance[np.ix_(wanted, wanted)] - cross @ covariance[np.ix_(seen, wanted)]
    density = -(off @ inverse @ off + mp.log(mp.det(own)) + len(seen) * mp.log(2 * mp.pi)) / 2
    return mean.astype(float), spread.astype(float), float(density)


@pytest.mark.parametrize("held", [None, [0.4, -0.7]], ids=["at the first row", "a period before"])
@pytest.mark.parametrize("correlated", [True, False])
def test_filter_and_smoother_agree_with_the_joint_gaussian(held: Any, correlated: bool) -> None:
    rows, n, m = 6, 3, 2
    given, (y, u) = random_rows(rows), record(rows)
    given["S"] *= correlated
    one, mean, covariance = KalmanFilter(MODEL), [0.3, -0.2, 0.1], np.diag([0.5, 0.2, 1.0])
    run = one.run(y, u, start=one.init(mean, covariance, u=held), **given)
    smooth = rts_smoother(run)
    every, begun = given, 0
    if held is not None:  # the model's own matrices lead from the row before, which is not seen
        first = {**{name: getattr(MODEL, name) for name in "ABCDQR"}, "S": np.zeros((n, m))}
        every = {name: np.concatenate([first[name][None], given[name]]) for name in given}
        y, u, begun = np.vstack([np.full(m, np.nan), y]), np.vstack([held, u]), 1
    with mp.workdps(50):
        means, joint_covariance = joint(every, mean, covariance, u)
        offset, measured = n * len(y), np.flatnonzero(~np.isnan(y))
        for k in range(rows):
            wanted = n * (k + begun) + np.arange(n)
            before = measured[measured < m * (k + begun + 1)]
            for seen, found in ((before, run), (measured, smooth)):
                x, P, density = conditioned(
                    means, joint_covariance, wanted, offset + seen, y.ravel()[seen]
                )
                np.testing.assert_allclose(found["state"][k], x, rtol=1e-12, atol=1e-12)
                np.testing.assert_allclose(found["covariance"][k], P, rtol=1e-12, atol=1e-12)
    assert run["log_likelihood"].sum() == pytest.approx(density, rel=1e-12)
    assert run["log_likelihood"][2] == 0.0


# --- Steps, parts of records and whole runs -------------------------------------------------------


@pytest.mark.parametrize("kind", GIVEN)
def test_steps_and_parts_give_the_bits_of_the_whole_run(kind: str) -> None:
    one, (y, u) = GIVEN[kind](), record()
    whole = one.observer.run(y, u, start=one.state, **one.given)
    found, state = stepped(one, y, u)
    assert not differing(found, whole.estimates)
    assert not differing(remembered(state), remembered(whole.end))
    for cut in (1, 4, ROWS - 1):
        first, second = slice(0, cut), slice(cut, ROWS)
        a = one.observer.run(y[first], u[first], start=one.state, **part(one.given, first))
        b = one.observer.run(y[second], u[second], start=a.end, **part(one.given, second))
        joined = {name: np.concatenate([a[name], b[name]]) for name in a}
        assert not differing(joined, whole.estimates)
        assert not differing(remembered(b.end), remembered(whole.end))
        np.testing.assert_allclose(np.concatenate([a.time, b.time]), whole.time, rtol=1e-14)
        assert b.end.count == whole.end.count == ROWS - 1


@pytest.mark.parametrize("name", ["A", "B", "Q", "S"])
def test_what_leads_to_the_next_row_is_held_over_to_a_run_without_it(name: str) -> None:
    one, (y, u), rows = KalmanFilter(MODEL), record(), random_rows()[name]
    values = 0.01 * rows if name == "S" else rows
    first = one.run(y[:4], u[:4], start=one.init([0.0] * 3, 1.0), **{name: values[:4]})
    found = one.run(y[4:], u[4:], start=first.end)
    own = np.zeros((3, 2)) if name == "S" else getattr(MODEL, name)
    wanted = one.run(
        y, u, start=one.init([0.0] * 3, 1.0),
        **{name: np.concatenate([values[:4], np.broadcast_to(own, (5, *own.shape))])},
    )  # fmt: skip
    np.testing.assert_allclose(found["state"], wanted["state"][4:], rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(found["covariance"], wanted["covariance"][4:], rtol=1e-12)


@pytest.mark.parametrize("kind", GIVEN)
def test_one_row_alone_follows_what_an_earlier_run_was_given(kind: str) -> None:
    """What led to the next row is held over to that row, and the model leads to the ones after."""
    one, (y, u) = GIVEN[kind](), record()
    first = one.observer.run(y[:4], u[:4], start=one.state, **part(one.given, slice(4)))
    whole = one.observer.run(y[4:], u[4:], start=first.end)
    row = one.observer.run(y[4:5], u[4:5], start=first.end)
    rest = one.observer.run(y[5:], u[5:], start=row.end)
    joined = {name: np.concatenate([row[name], rest[name]]) for name in whole}
    assert not differing(joined, whole.estimates)
    assert not differing(remembered(rest.end), remembered(whole.end))


def test_a_step_takes_matrices_without_the_axis_of_rows() -> None:
    one, (y, u), rows = KalmanFilter(MODEL), record(), random_rows()
    state = one.init([0.0] * 3, 1.0)
    for k in range(3):
        plain, found = one.step(state, y[k], u[k], **{name: rows[name][k] for name in rows})
        state, wanted = one.step(state, y[k], u[k], **part(rows, slice(k, k + 1)))
        assert not differing(found.estimates, wanted.estimates)
        assert not differing(remembered(plain), remembered(state))


def test_a_step_of_a_bank_takes_matrices_of_each_mode_without_the_axis_of_rows() -> None:
    one, (y, u) = GIVEN["IMM by mode"](), record()
    found = wanted = one.state
    for k in range(3):
        now = {name: rows[k] for name, rows in one.given.items()}
        found, estimate = one.observer.step(found, y[k], u[k], **now)
        wanted, exact = one.observer.step(wanted, y[k], u[k], **part(one.given, slice(k, k + 1)))
        assert not differing(estimate.estimates, exact.estimates)


# --- Constant matrices by row -------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["Kalman", "augmented", "IMM", "SVSF"])
def test_constant_matrices_by_row_give_the_bits_of_the_model(kind: str) -> None:
    one = {
        "Kalman": lambda: KalmanFilter(MODEL), "augmented": augmented, "SVSF": svsf,
        "IMM": lambda: bank(KalmanFilter(MODEL), KalmanFilter(MODEL)),
    }[kind]()  # fmt: skip
    (y, u), state = record(), one.init([0.3, -0.2, 0.1], 0.5)
    names = [name for name in "ABCDQR" if name in one.takes]
    tiled = {name: np.tile(getattr(MODEL, name), (ROWS, 1, 1)) for name in names}
    wanted = one.run(y, u, start=state)
    for given in (tiled, *({name: rows} for name, rows in tiled.items())):
        assert not differing(one.run(y, u, start=state, **given).estimates, wanted.estimates)
    fixed = {name: getattr(MODEL, name) for name in names}
    assert not differing(one.run(y, u, start=state, **fixed).estimates, wanted.estimates)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_constant_noise_parameters_and_times_give_the_bits_of_the_model(kind: Any) -> None:
    one, (y, u) = kind(PENDULUM), record()
    state = one.init([0.3, -0.2], 0.5)
    wanted = one.run(y, u, start=state)
    for given in (
        {"Q": np.tile(PENDULUM.Q, (ROWS, 1, 1))},
        {"R": np.tile(PENDULUM.R, (ROWS, 1, 1))},
        {"parameters": {"stiffness": np.full(ROWS, 5.0)}},
        {"parameters": {"stiffness": 5.0}},
        {"dt": np.full(ROWS, 0.1)},
        {"dt": 0.1},
    ):
        assert not differing(one.run(y, u, start=state, **given).estimates, wanted.estimates)


# --- Other known answers --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_parameters_by_row_are_inputs_of_another_model(kind: Any) -> None:
    rng, (y, u) = np.random.default_rng(2), record()
    values, noise = rng.uniform(0.5, 1.5, ROWS), {"Q": 0.01, "R": 0.05}
    model = NonlinearModel(
        ["a + w/10", "w - gain*sin(a)/5 + torque/10 + push/20"], ["a*gain", "w + torque"],
        state_names=["a", "w"], input_names=["torque", "push"], parameters={"gain": 1.0}, **noise,
    )  # fmt: skip
    switched = NonlinearModel(
        lambda x, u: (x[0] + x[1] / 10, x[1] - u[2] * np.sin(x[0]) / 5 + u[0] / 10 + u[1] / 20),
        lambda x, u: (x[0] * u[2], x[1] + u[0]), states=2, inputs=3, outputs=2, **noise,
    )  # fmt: skip
    one, other = kind(model), kind(switched)
    run = one.run(y, u, start=one.init([0.3, 0.1], 0.5), parameters={"gain": values})
    wanted = other.run(y, np.column_stack([u, values]), start=other.init([0.3, 0.1], 0.5))
    for name in wanted:
        np.testing.assert_allclose(run[name], wanted[name], rtol=1e-10, atol=1e-10)


def test_bank_by_mode_without_mixing_is_a_filter_for_each_mode() -> None:
    """Modes that last: their probabilities are their likelihoods, normalised."""
    one, (y, u) = GIVEN["IMM by mode"](), record()
    lasting = type(one.observer)(one.observer.filters, np.eye(2), mixing=False)
    run = lasting.run(y, u, start=one.state, **one.given)
    total = np.zeros((ROWS, 2))
    for j, each in enumerate(lasting.filters):
        given = {name: rows[:, j] for name, rows in one.given.items()}
        alone = each.run(y, u, start=each.init(one.mean, 0.5), **given)
        np.testing.assert_allclose(run["innovation"][:, j], alone["innovation"], rtol=1e-12)
        total[:, j] = np.cumsum(alone["log_likelihood"])
    odds = np.exp(total - total.max(axis=1, keepdims=True))
    np.testing.assert_allclose(
        run["probability"], odds / odds.sum(axis=1, keepdims=True), rtol=1e-10, atol=1e-13
    )

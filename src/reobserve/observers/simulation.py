"""Records drawn from the models of filters, with the true states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import MOST_STEPS, as_whole
from reobserve.core.direct_call import call
from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.kernel import kernel
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import as_scalar
from reobserve.observers.dataframes import read_frames
from reobserve.observers.gaussian_state import inputs_of_rows
from reobserve.observers.kalman import KalmanFilter, assign, shortest, take_root
from reobserve.observers.nonlinear_filter import UnscentedKalmanFilter
from reobserve.observers.run import Run
from reobserve.systems.linear import LinearModel
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_flow import FlowWork, NonlinearRows, move, new_flow_work
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]


@np.errstate(all="ignore")  # what is not finite is refused
def simulate(
    model: LinearModel | NonlinearModel, rows: int, mean: ArrayLike, covariance: ArrayLike = 0.0,
    u: ArrayLike | None = None, *, seed: int, time: ArrayLike | None = None,
    missing: ArrayLike = 0.0, records: int | None = None, A: ArrayLike | None = None,
    B: ArrayLike | None = None, C: ArrayLike | None = None, D: ArrayLike | None = None,
    Q: ArrayLike | None = None, R: ArrayLike | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Run[Any]:  # fmt: skip
    """Draw a record from a model: true states and measurements, as filters take them to be.

        x(k+1) = f(x(k), u(k)) + w(k),    y(k) = h(x(k), u(k)) + v(k)

    The run has the true ``state``, (k, n), ``y``, (k, m), and ``u``, (k, p), or (records, k, .).
    Angles are within half a period of zero. Lower factors of covariances multiply standard normal
    numbers of numpy's ``default_rng(seed)``: first those of first states, (records, n), then of v,
    (records, k, m), and of w, (records, k - 1, n), or one for each part of a longer gap.

    Parameters
    ----------
    model, rows, records
        Linear or nonlinear; k; and how many to draw, left out, one without that axis.
    mean, covariance
        Of the first state, as `KalmanFilter.init` takes them; without a covariance it is the mean.
    u, time, A, B, C, D, Q, R, parameters
        As filters on the model take them, the same for all records.
    seed
        0 or more; the same one draws the same numbers.
    missing
        The share of numbers in y that are nan, or an array that is true there, (k,) or (k, m).

    Raises
    ------
    InputError
        If an argument is not that.
    DivergenceError
        If a state leaves the range of floating-point numbers.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel, simulate
    >>> model = LinearModel([[0.9]], C=[[1]], Q=1e-2, R=1e-1)
    >>> true, kalman = simulate(model, 500, [1.0], seed=1), KalmanFilter(model)
    >>> run = kalman.run(true["y"], start=kalman.init([1.0], 0.0))
    >>> errors = (run["state"] - true["state"])[1:]
    >>> print((errors**2 / run["variance"][1:]).mean().round(1))
    1.0
    """
    linear = isinstance(model, LinearModel)
    observer: Any = KalmanFilter(model) if linear else UnscentedKalmanFilter(model)  # type: ignore[arg-type]
    k, seed = as_whole("rows", rows, 1, MOST_STEPS), as_whole("seed", seed, 0, 2**63 - 1)
    many = as_whole("records", 1 if records is None else records, 1, MOST_STEPS // k)
    (n, _, m), rules, rng = observer._sizes, observer._rules, np.random.default_rng(seed)
    given = {"A": A, "B": B, "C": C, "D": D, "Q": Q, "R": R, "parameters": parameters}
    _, u, _, _, seconds, _ = read_frames(observer, None, u, None, None, time)
    record = observer._read(np.zeros((k, m)), u, None, None, given)
    start = observer.init(mean, covariance)
    times, record = observer._timed(seconds, start, record)
    made, inputs, _ = observer.steps.in_record(
        observer, record.given, record.y, inputs_of_rows(None, record)[None], {}, record.periods
    )
    # Those of row k in A, B and Q lead to row k, those in C, D and R are its own.
    own, leads = np.arange(k), np.arange(1, k)
    if not linear:
        leads = np.repeat(leads, np.broadcast_to(_of(made.parts, leads)[:, 1], k - 1))
    x, y, first = np.empty((many, k, n)), np.empty((many, k, m)), rng.standard_normal((many, 1, n))
    v, w = rng.standard_normal((many, k, m)), rng.standard_normal((many, len(leads), n))
    first = _drawn(start.posterior.covariance[None], own[:1], first)[:, 0]
    x[:, 0] = wrapped(start.posterior.mean + first, rules.state_periods)
    v, w = _drawn(made.R, own, v), _drawn(made.Q, leads, w)
    if linear:
        # x(k) = A x(k-1) + B u(k-1) + w(k-1),   y(k) = C x(k) + D u(k) + v(k)
        w = w + (_of(made.B, leads) @ record.u[:-1, :, None])[..., 0]
        for i in range(1, k):
            moved = x[:, i - 1] @ made.A[min(i, len(made.A) - 1)].T + w[:, i - 1]
            x[:, i] = wrapped(moved, rules.state_periods) if rules.state_periods.any() else moved
        y[:] = (made.C @ x[..., None] + made.D @ record.u[..., None])[..., 0]
    else:
        work, noise = new_flow_work(n, m), np.ascontiguousarray(w.reshape(-1, n))
        with RaisedAfterLoop():
            _move_rows(made, inputs[0], noise, rules.state_periods, x, y, work)
    y = wrapped(y + v, rules.output_periods)
    good = np.isfinite(x).all(axis=(0, 2)) & np.isfinite(y).all(axis=(0, 2))
    if not good.all():
        raise DivergenceError("simulate", float(times[max(int(np.argmin(good)) - 1, 0)]))
    absent: Any = missing
    if getattr(missing, "dtype", None) != np.bool_ or np.shape(missing) not in ((k,), (k, m)):
        share = as_scalar("missing", missing) if isinstance(missing, int | float) else -1.0
        if not 0.0 <= share < 1.0:
            wanted = f"a share from 0 to below 1, or an array of bool, ({k},) or ({k}, {m})"
            raise InputError("missing", f"{shown(missing)} must be {wanted}")
        absent = rng.random(y.shape) < share
    y[np.broadcast_to(absent if np.ndim(absent) > 1 else absent[:, None], y.shape)] = np.nan
    estimates = {"state": x, "y": y, "u": np.broadcast_to(record.u, (many, *record.u.shape))}
    axes = {"state": model.state_names, "y": model.output_names, "u": model.input_names}
    run: Run[Any] = Run(
        times, estimates, dict.fromkeys(estimates, ""), (None,) * many,
        missing=np.isnan(y).any(axis=2).sum(axis=1), index=None if seconds is time else time,
        component_names={name: (names,) for name, names in axes.items() if names},
        periods={"state": rules.state_periods, "y": rules.output_periods},
    )  # fmt: skip
    return run if records is not None else replace(run.record(0), index=run.index)


def _of(matrices: Array, rows: NDArray[np.int64]) -> Array:
    """The matrices of rows, of which the last one holds for all later ones."""
    return matrices if len(matrices) == 1 else matrices[np.minimum(rows, len(matrices) - 1)]


def _drawn(covariances: Array, rows: NDArray[np.int64], normal: Array) -> Array:
    """Noise of the covariances of these rows, of standard normal numbers (records, rows, n)."""
    factors = np.empty_like(covariances)
    _write_factors(np.ascontiguousarray(covariances), factors)
    return np.asarray((_of(factors, rows) @ normal[..., None])[..., 0])


@kernel
def _write_factors(covariances: Array, factors: Array) -> None:
    """Write lower factors of semidefinite covariances."""
    for k in range(len(covariances)):
        take_root(covariances[k], factors[k])


@kernel
def _move_rows(
    model: NonlinearRows, inputs: Array, noise: Array, periods: Array, x: Array, y: Array,
    work: FlowWork,
) -> None:  # fmt: skip
    """Write the states of all records after the first row, and their outputs without noise."""
    for r in range(len(x)):
        place = r * (len(noise) // len(x))
        for k in range(x.shape[1]):
            if k > 0:
                assign(work.stage_point, x[r, k - 1])
                parts, noisy = model.parts[min(k, len(model.parts) - 1)]
                for part in range(parts):
                    # x = f(x, u) + w
                    move(
                        model.functions, model.steps, k, work.stage_point, inputs[k], x[r, k], work
                    )
                    for a in range(x.shape[2]):
                        if part >= parts - noisy:
                            x[r, k, a] += noise[place, a]
                        x[r, k, a] = shortest(x[r, k, a], periods[a])
                    place += part >= parts - noisy
                    assign(work.stage_point, x[r, k])
            # y = h(x, u)
            call(model.functions.h, (x[r, k], inputs[k + 1], y[r, k]))

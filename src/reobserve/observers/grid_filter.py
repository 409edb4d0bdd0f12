"""A filter on a grid of values of one parameter, or of a delay, with a Kalman filter for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError, shown
from reobserve.core.finite import finite
from reobserve.core.kernel import kernel
from reobserve.core.matrices import all_finite, as_floats, as_numbers, as_scalar
from reobserve.core.value import for_loop, read_only
from reobserve.observers.gaussian_state import inputs_of_rows
from reobserve.observers.imm import IMM, BankRows, ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.record import Record
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

_MOST_PERIODS = 100_000
_NOTHING = 1e-16  # a probability that adds nothing to one
_WHOLE = 1e-9  # of a sampling period: how near a delay is to a whole number of them


@dataclass(frozen=True, eq=False, repr=False)
class GridFilter(IMM):
    """Point-mass filter of one parameter on a grid, with a Kalman filter of the state at each node.

        p(theta_i | y) proportional to L_i sum_j p_ji p(theta_j),    theta = sum_i p_i theta_i

    The parameter is any number that makes a linear model, or the delay of its input. It moves as a
    random walk and jumps to anywhere, a Markov chain on the nodes, and posteriors of the state are
    mixed as in the interacting multiple model (Blom & Bar-Shalom 1988), by their moments. Without
    motion this is the exact Bayesian filter for a parameter that is one of the nodes (Magill 1965).
    It has no linearisation in the parameter, and no local minima.

    `of_parameter` and `of_delay` make it. `init` takes mean, covariance and probabilities; `run`
    and `step` take y, shape (k, m), nan where missing, u, (k, p), and R by name. Estimates:
    ``parameter``, its mean, shape (k,), and ``parameter_variance``, (k,); and those of `IMM`,
    ``state``, (k, n), ``covariance``, (k, n, n), ``variance``, (k, n), ``probability`` of the
    nodes, (k, r), ``innovation``, (k, r, m), and ``log_likelihood``, (k,).

    Parameters
    ----------
    filters, transition, mixing, gate, noise_memory
        As `IMM` has them.
    grid
        The value of the parameter at each node, shape (r,), rising; equal ones in a row with rates.
    periods_late
        Of a delay: its whole sampling periods at each node, shape (r,); else None.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import GridFilter, LinearModel
    >>> plant = LinearModel.from_ode([[-1]], [[1]], [[1]], Q=1e-6, R=1e-4, sampling_period=0.1)
    >>> grid = GridFilter.of_delay(plant, delays=np.arange(0, 1, 0.1), random_walk=1e-4)
    >>> u = np.sign(np.sin(np.arange(100)))
    >>> x = np.zeros(100)
    >>> for k in range(99):
    ...     x[k + 1] = plant.A[0, 0] * x[k] + plant.B[0, 0] * u[max(k - 3, 0)]
    >>> run = grid.run(x, u, start=grid.init([0], 1e-2))
    >>> print(run["parameter"][-1].round(2))
    0.3
    """

    grid: Array = field(kw_only=True)
    periods_late: NDArray[np.int64] | None = field(default=None, kw_only=True)

    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        (*IMM.units, "parameter", "parameter_variance"), ""
    )
    takes: ClassVar[tuple[str, ...]] = ("R",)

    def __post_init__(self) -> None:
        super().__post_init__()
        grid = read_only(as_floats("grid", self.grid))
        if grid.ndim != 1 or len(grid) < 2 or (np.diff(grid) < 0).any():
            raise InputError("grid", f"{shown(self.grid)} must be two numbers or more, not falling")
        if len(grid) != len(self.filters):
            problem = f"has {len(grid)} values, must have {len(self.filters)}, one for each filter"
            raise InputError("grid", problem)
        self._set("grid", grid)
        if self.periods_late is not None:
            late = as_numbers("periods_late", self.periods_late)
            whole = np.floor(late)
            good = late.shape == (len(grid),) and (late == whole).all()
            if not good or late.min() < 0 or late.max() > _MOST_PERIODS:
                problem = f"{shown(self.periods_late)} must be {len(grid)} whole numbers from 0 to"
                raise InputError("periods_late", f"{problem} {_MOST_PERIODS}")
            self._set("periods_late", late.astype(np.int64))

    @classmethod
    def of_parameter(
        cls, make: Callable[[float], LinearModel], *, grid: ArrayLike, random_walk: float = 0.0,
        jump_rate: float = 0.0, rates: ArrayLike = (0.0,), switch_rate: float = 0.0,
        gate: float | None = None, noise_memory: float | None = None,
    ) -> GridFilter:  # fmt: skip
        """A filter for a parameter of a linear model.

        Parameters
        ----------
        make
            The model of a value of the parameter. The states of all must mean the same.
        grid
            Values of the parameter, rising, two or more.
        random_walk
            The variance that it gains in a second, by steps to neighbours on the grid.
        jump_rate
            Jumps a second to any other value.
        rates, switch_rate
            What the parameter may gain in a second: a node is a value and a rate, which goes to any
            other one ``switch_rate`` times a second. A value between two nodes is shared by both,
            which adds to the random walk: rate T (step - rate T) to the variance in a period T.
        gate, noise_memory
            As `IMM` has them.

        Raises
        ------
        InputError
            If a number is not in its range, or the models do not fit.
        """
        nodes = as_grid(grid)
        if not callable(make):
            raise InputError("make", f"{shown(make)} must be a function")
        filters = [
            KalmanFilter(as_kind(f"make({value:g})", make(float(value)), LinearModel))
            for value in nodes
        ]
        T, each = filters[0].sampling_period, len(as_rates(rates))
        chain = node_chain(nodes, random_walk, jump_rate, T, rates, switch_rate)
        return cls(
            tuple(mode for mode in filters for _ in range(each)), chain,
            grid=np.repeat(nodes, each), gate=gate, noise_memory=noise_memory,
        )  # fmt: skip

    @classmethod
    def of_delay(
        cls, model: LinearModel, *, delays: ArrayLike, random_walk: float = 0.0,
        jump_rate: float = 0.0, rates: ArrayLike = (0.0,), switch_rate: float = 0.0,
        gate: float | None = None, noise_memory: float | None = None,
    ) -> GridFilter:  # fmt: skip
        """A filter for the delay [s] of all inputs, held over each sampling period before it.

        Before the first row of a record the inputs are taken to have been those of that row.

        Parameters
        ----------
        model
            The plant without the delay; one from `from_ode` for delays of any length, else they are
            whole sampling periods. It has no feedthrough D.
        delays
            [s], from 0 on, rising, two or more.
        random_walk, jump_rate, rates, switch_rate, gate, noise_memory
            As in `of_parameter`.

        Raises
        ------
        InputError
            If a number is not in its range, the model has no input, or it has a feedthrough.
        """
        nodes, T = as_grid(delays, "delays"), as_kind("model", model, LinearModel).sampling_period
        if nodes[0] < 0 or nodes[-1] > _MOST_PERIODS * T:
            problem = f"{shown(delays)} must be from 0 s to {_MOST_PERIODS * T:g} s"
            raise InputError("delays", problem)
        if not model.inputs or model.D.any():
            problem = "has no input" if not model.inputs else "has a feedthrough D of the input"
            raise InputError("model", f"{problem}, so that it has no delay of its input alone")
        whole = np.floor(nodes / T + _WHOLE).astype(np.int64)
        parts = np.maximum(nodes - whole * T, 0.0)
        parts[parts < _WHOLE * T] = 0.0
        if parts.any() and model.ode is None:
            place = int(np.argmax(parts > 0))
            problem = (
                f"{nodes[place]:g} s is no whole number of sampling periods, {T:g} s, which a "
                "model of discrete time cannot follow; make it by from_ode"
            )
            raise InputError("delays", problem)
        filters = [KalmanFilter(_delayed(model, float(part))) for part in parts]
        each = len(as_rates(rates))
        chain = node_chain(nodes, random_walk, jump_rate, T, rates, switch_rate)
        return cls(
            tuple(mode for mode in filters for _ in range(each)), chain,
            grid=np.repeat(nodes, each), periods_late=np.repeat(whole, each), gate=gate,
            noise_memory=noise_memory,
        )  # fmt: skip

    @cached_property
    def inputs(self) -> int:
        """The number of known inputs in a row of u."""
        own = self._sizes[2]
        return own if self.periods_late is None else own // 2

    def _checked(self, state: Any) -> ImmState:
        checked = super()._checked(state)
        if checked.past is not None:
            deepest = 0 if self.periods_late is None else int(self.periods_late.max()) + 1
            past = as_numbers("start.past", checked.past, writable=False)
            if past.shape != (deepest, self.inputs) or not all_finite(past):
                problem = f"has shape {past.shape}, must be {deepest} rows of finite inputs"
                raise InputError("start.past", problem)
        elif self.periods_late is not None and (
            checked.count or (checked.sample is not None and not np.isnan(checked.sample[0]))
        ):
            raise InputError("start.past", "is missing: the state is of no filter of a delay")
        return checked

    def _uneven(self, time: ArrayLike | None, state: ImmState, record: Record) -> None:
        """None: its chain is that of a period."""

    def _inputs(self, state: ImmState, record: Record) -> tuple[Array, Array | None]:
        if self.periods_late is None:
            return super()._inputs(state, record)
        rows, deepest = inputs_of_rows(state.sample, record), int(self.periods_late.max()) + 1
        past = np.repeat(rows[:1], deepest, axis=0) if state.past is None else state.past
        whole = np.concatenate([past, rows])
        # u(k-d) and u(k-d-1), of which the latter was held in the first part of the period
        pairs = np.concatenate([whole[1:], whole[:-1]], axis=1)
        at = deepest - 1 + np.arange(len(rows))[:, None] - self.periods_late
        return np.take(pairs, at, axis=0), whole[-1 - deepest : -1]

    def _by_name(self, rows: BankRows) -> dict[str, Array]:
        mean, spread = np.empty((2, len(rows.probability)))
        write_parameter(rows.probability, for_loop(self.grid), mean, spread)
        return {**super()._by_name(rows), "parameter": mean, "parameter_variance": spread}


@kernel
def write_parameter(probability: Array, grid: Array, mean: Array, spread: Array) -> None:
    """Write mean and variance of the parameter at each row."""
    for k in range(len(mean)):
        # theta = sum_i p_i theta_i
        total = 0.0
        for i in range(len(grid)):
            total += probability[k, i] * grid[i]
        mean[k], total = total, 0.0
        # var theta = sum_i p_i (theta_i - theta)^2
        for i in range(len(grid)):
            total += probability[k, i] * (grid[i] - mean[k]) * (grid[i] - mean[k])
        spread[k] = total


def as_grid(value: ArrayLike, name: str = "grid") -> Array:
    """Two or more finite rising numbers, read-only, or `InputError`."""
    grid = as_floats(name, value)
    if grid.ndim != 1 or len(grid) < 2 or (np.diff(grid) <= 0).any():
        raise InputError(name, f"{shown(value)} must be two numbers or more, rising")
    return read_only(grid)


def as_rates(value: ArrayLike) -> Array:
    """One rate or more, finite and rising, or `InputError`."""
    rates = as_floats("rates", value)
    if rates.ndim != 1 or not len(rates) or (np.diff(rates) <= 0).any():
        raise InputError("rates", f"{shown(value)} must be one number or more, rising")
    return rates


def node_chain(
    grid: Array, random_walk: float, jump_rate: float, period: float, rates: ArrayLike = (0.0,),
    switch_rate: float = 0.0,
) -> Array:  # fmt: skip
    """The probabilities p_ij of moves between nodes in a period, shape (r, r).

    Without rates those of a Markov chain in continuous time: it steps to neighbours at such rates
    that it has no drift and the variance ``random_walk`` a second, reflected at the ends, and to
    each other node at ``jump_rate`` / (r - 1). With rates a node is a value and a rate, in this
    order; the rate switches, the value steps as before and moves by the new rate, up to the ends,
    and jumps go to any node.

    Raises
    ------
    InputError
        If one of the numbers is negative or not finite.
    """
    for name, value in (
        ("random_walk", random_walk), ("jump_rate", jump_rate), ("switch_rate", switch_rate),
    ):  # fmt: skip
        if (number := as_scalar(name, value)) < 0:
            raise InputError(name, f"{number:g} must be 0 or more")
    random_walk, jump_rate, switch_rate = map(float, (random_walk, jump_rate, switch_rate))
    speeds = as_rates(rates)
    if not speeds.any():
        return _walk(grid, random_walk, jump_rate, period)
    walk = _walk(grid, random_walk, 0.0, period)
    walk[walk < _NOTHING] = 0.0
    # To grid + rate T, between two nodes to both
    ends = np.clip(grid[:, None] + period * speeds, grid[0], grid[-1])
    moved = np.stack([np.interp(ends, grid, node) for node in np.eye(len(grid))], axis=2)
    v, count = len(speeds), len(grid) * len(speeds)
    leave = -np.expm1(-switch_rate * period) if v > 1 else 0.0
    switch = np.full((v, v), leave / max(v - 1, 1))
    np.fill_diagonal(switch, 1.0 - leave)
    jump = -np.expm1(-jump_rate * period)
    chain = np.einsum("ab,ik,kbj->iajb", switch, walk, moved, optimize=True)
    return np.asarray((1.0 - jump) * chain.reshape(count, count) + jump / count)


@finite("random_walk, jump_rate")
def _walk(grid: Array, random_walk: float, jump_rate: float, period: float) -> Array:
    from scipy.linalg import expm

    r, steps = len(grid), np.diff(grid)
    rates = np.full((r, r), jump_rate / (r - 1))
    for i in range(r):
        below = steps[i - 1] if i else steps[0]
        above = steps[i] if i < r - 1 else steps[-1]
        # Rates a and b with a above = b below and a above^2 + b below^2 = walk
        if i < r - 1:
            rates[i, i + 1] += np.float64(random_walk) / (above * (above + below))
        if i:
            rates[i, i - 1] += np.float64(random_walk) / (below * (above + below))
    np.fill_diagonal(rates, 0.0)
    np.fill_diagonal(rates, -rates.sum(axis=1))
    chain = np.maximum(expm(period * rates), 0.0)
    return np.asarray(chain / chain.sum(axis=1, keepdims=True))


def _delayed(model: LinearModel, part: float) -> LinearModel:
    """The model with the inputs [u(k-d), u(k-d-1)], the latter held for ``part`` [s] at first."""
    late = np.zeros_like(model.B)
    now = model.B
    if part > 0:
        assert model.ode is not None  # checked before
        rest, now = zero_order_hold(model.ode.A, model.ode.B, model.sampling_period - part)
        # exp(A (T - part)) int_0^part exp(A s) ds B
        late = rest @ zero_order_hold(model.ode.A, model.ode.B, part)[1]
    return LinearModel(
        model.A, np.hstack([now, late]), model.C, None, Q=model.Q, R=model.R, check=False,
        sampling_period=model.sampling_period, state_names=model.state_names,
        output_names=model.output_names,
        **{name: getattr(model, name) for name in ("state_periods", "output_periods")},
    )  # fmt: skip

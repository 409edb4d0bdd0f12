"""Standard high-gain observer of a system with an input delay (Lechappe et al. 2018, (36)).

The paper prints S^-1 without C^T, here and in (34), which gives a matrix instead of a vector. With
C^T the gain is the first column of S^-1, with the entries binom(n, i) rho^i.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.direct_call import call
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import allocating_kernel
from reobserve.core.matrices import as_positive, as_vector
from reobserve.core.value import Value, converter, for_loop, read_only
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.fixed_step import Steps
from reobserve.observers.record import Rows, check_state
from reobserve.synthesis.high_gain_design import high_gain
from reobserve.systems.triangular import TriangularModel

Array = NDArray[np.float64]


class HighGainRecord(NamedTuple):
    """Inputs of the loop, arrays of shape (2 m + 1,): y and u with their limits from the left."""

    output: Array
    output_before: Array
    delayed_input: Array
    input_before: Array


@dataclass(frozen=True, eq=False, repr=False)
class HighGainState(Value):
    """The observer's state: a value that may be stored, copied and stepped again.

    ``estimate`` is x^, shape (n,); the rest is as in `reobserve.observers.record.ObserverState`.
    """

    estimate: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class HighGainObserver(IntegratingObserver[HighGainState]):
    """High-gain observer for a constant delay tau_m, by the classical Runge-Kutta method.

        x^' = Lambda x^ + f(x^) + (0, ..., 0, G(y))^T u(t - tau_m) - S^-1 C^T (x^1 - y)

    Lechappe et al. 2018, (36). It estimates the state alone. The integration is stable only for rho
    times the sampling period below 2.78.

    `init` takes the state. `run` and `step` take y, shape (k,), and u, the input at the plant: in
    row k, u(t_k - tau_m), shape (k,). Estimates: ``state``, x^, shape (k, n), in units of the
    model.

    Parameters
    ----------
    model
        The model of the plant; n is its number of states.
    rho
        [1/s]; all eigenvalues of Lambda - S^-1 C^T C are -rho.
    sampling_period
        [s], also the integration step.

    Raises
    ------
    InputError
        If ``rho`` or the period is not positive, or rho^n is beyond floating-point numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import HighGainObserver
    >>> from reobserve.systems.triangular_text import triangular_model
    >>> lag = triangular_model(["x"], drift=["-x"], input_gain="1")
    >>> observer = HighGainObserver(lag, rho=5.0, sampling_period=0.02)
    >>> time = 0.02 * np.arange(100)
    >>> run = observer.run(time - 1, time, start=observer.init([0.0]))  # x = t - 1 for u = t
    >>> print(time[-1], run["state"][-1].round(3))
    1.98 [0.978]
    """

    model: TriangularModel = field(metadata=converter(as_kind, TriangularModel))
    rho: float = field(kw_only=True, metadata=converter(as_positive))

    measurements: ClassVar[int] = 1
    inputs: ClassVar[int] = 1
    units: ClassVar[Mapping[str, str]] = {"state": ""}

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.gain  # raises here instead of at the first step

    @cached_property
    def gain(self) -> Array:
        """S^-1 C^T, shape (n,)."""
        return read_only(high_gain(self.model.states, self.rho))

    def init(self, state: ArrayLike) -> HighGainState:
        """The state at the first sample, from an estimate of x, shape (n,).

        Raises
        ------
        InputError
            If it is not n finite numbers.
        """
        return HighGainState(as_vector("state", state, self.model.states))

    def _checked(self, state: Any) -> HighGainState:
        n = self.model.states
        problem = f"must be of an observer of {n} states"
        return check_state(state, HighGainState, problem, estimate=(n,), sample=(2,))

    def _integrate(self, state: HighGainState, steps: Steps) -> Rows:
        y, u = steps
        rows = np.empty((y.steps + 1, self.model.states))
        rows[0] = state.estimate
        finite = _run(
            self.model.drift,
            self.model.input_gain,
            for_loop(self.model.parameters),
            for_loop(self.gain),
            self.sampling_period,
            HighGainRecord(y.right[:, 0], y.left[:, 0], u.right[:, 0], u.left[:, 0]),
            rows,
        )
        after = HighGainState(rows[-1].copy(), state.sample, state.count + y.steps)
        return Rows({"state": rows}, finite, after)


@allocating_kernel
def _run(
    drift: Any,
    input_gain: Any,
    parameters: Array,
    gain: Array,
    step: float,
    record: HighGainRecord,
    rows: Array,
) -> int:
    """Fill ``rows`` from its first one, and return the number of finite rows.

    Lechappe et al. 2018, (36).
    """
    n = rows.shape[1]
    slopes, x, f = np.empty((4, n)), np.empty(n), np.empty(n)
    measured, known, driven = np.empty(3), np.empty(3), np.empty(3)
    due = FIRST
    for k in range(len(rows) - 1):
        if k >= due:
            due = poll(k)
        for j in range(2):
            measured[j], known[j] = record.output[2 * k + j], record.delayed_input[2 * k + j]
        measured[2], known[2] = record.output_before[2 * k + 2], record.input_before[2 * k + 2]
        # G(y) at the start, the middle and the end of the step
        for j in range(3):
            call(input_gain, (measured[j : j + 1], parameters, driven[j : j + 1]))
        for stage in range(4):
            place = (stage + 1) // 2
            for i in range(n):
                x[i] = rows[k, i]
                if stage > 0:
                    x[i] += (step if stage == 3 else 0.5 * step) * slopes[stage - 1, i]
            # x^i' = x^(i+1) + f_i(x^) - gain_i (x^1 - y), with G(y) u(t - tau_m) for x^(n+1)
            call(drift, (x, parameters, f))
            error = x[0] - measured[place]
            for i in range(n):
                slopes[stage, i] = f[i] - gain[i] * error
                if i + 1 < n:
                    slopes[stage, i] += x[i + 1]
            slopes[stage, n - 1] += driven[place] * known[place]
        # x^(t + h) = x^(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
        for i in range(n):
            mean = slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i]
            after = rows[k, i] + step / 6.0 * mean
            if not np.isfinite(after):
                return k + 1
            rows[k + 1, i] = after
    return len(rows)

"""Chains of integrators whose input arrives late (Lechappe et al. 2018, (1)).

Control and delay are signals, so that u(t - tau(t)) is known wherever it is asked for, and no
history has to be stored: what the control was before t = 0 is what its terms say there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.arguments import MOST_STEPS, as_kind, as_whole
from reobserve.core.direct_call import call
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.kernel import allocating_kernel
from reobserve.core.matrices import as_floats, as_positive, as_scalar, as_vector
from reobserve.core.value import for_loop
from reobserve.systems.triangular import TriangularModel
from reobserve_papers.signals.inputs import SAME_INSTANT, Array, Signal

_MOST_STEPS = 100_000_000


@dataclass(frozen=True, eq=False)
class DelayedInputPlant:
    """The plant x' = Lambda x + f(x) + (0, ..., 0, G(y))^T u(t - tau(t)), y = x1.

    Lechappe et al. 2018, (1).
    """

    model: TriangularModel

    def __post_init__(self) -> None:
        as_kind("model", self.model, TriangularModel)

    def simulate(
        self, initial_state: ArrayLike, control: Signal, delay: Signal, step: float, steps: int
    ) -> Array:
        """States at multiples of ``step`` [s], shape (steps + 1, n), by classical Runge-Kutta.

        The delayed input is taken in closed form at both ends and the middle of each step, at
        the ends from inside the step, so that a jump of the delay on the grid costs no accuracy.
        Where the control itself jumps or bends, that must arrive on the grid too. Samples with
        straight lines in between may bend anywhere, at the cost of accuracy.

        Parameters
        ----------
        initial_state
            x(0), n numbers.
        control, delay
            u and tau [s], one axis each; the delay must not be negative.
        step, steps
            The step [s] and how many there are.

        Raises
        ------
        InputError
            If ``initial_state`` is not n numbers, ``step`` is not positive, there is none, the
            delay is negative or jumps off the grid, or a jump or kink of the control arrives
            inside a step.
        DivergenceError
            If the state leaves the range of floating-point numbers.
        """
        start = as_vector("initial_state", initial_state, self.model.states)
        step = as_positive("step", step)
        steps = as_whole("steps", steps, 1, MOST_STEPS)
        for name, signal in (("control", control), ("delay", delay)):
            as_kind(name, signal, Signal)
        _check_axes("control", control)
        delays = _delays_of_steps("delay", delay, (0.0, np.inf), step, steps)
        origins = (np.arange(steps) + np.array([[0.0], [0.5], [1.0]])) * step - delays
        _check_arrivals(control, origins, step)
        inputs = np.array([_values(control, row, i == 2) for i, row in enumerate(origins)])
        states = np.empty((steps + 1, len(start)))
        states[0] = start
        model = self.model
        size = (0,) * model.states
        finite = _simulate(
            model.drift,
            model.input_gain,
            for_loop(model.parameters),
            size,
            inputs,
            step,
            states,
        )
        if finite < steps:
            raise DivergenceError("plant", finite * step)
        return states


def delayed(control: Signal, delay: Signal, time: Array, *, before: bool = False) -> Array:
    """The control u(t - tau(t)) at increasing times t [s], shape (len(time),).

    At a jump of either signal the limit from the right is meant, or with ``before`` that from
    the left. The delay is taken to grow more slowly than time, so that what is sent later
    arrives later.
    """
    _check_axes("control", control)
    _check_axes("delay", delay)
    return _values(control, as_floats("time", time) - delay(time, before=before)[:, 0], before)


def check_delay(
    name: str, delay: Signal, bounds: tuple[float, float], step: float, horizon: float
) -> None:
    """Refuse a delay that leaves ``bounds`` [s] before ``horizon`` or jumps between steps.

    It is looked at where a plant needs it: at both ends of each step, from inside, and in its
    middle. Bounds count as kept within the rounding of times.

    Raises
    ------
    InputError
        If the delay has more than one axis, leaves its bounds or jumps off the grid.
    """
    steps = as_scalar("horizon", horizon) / as_positive("step", step)
    if not steps < _MOST_STEPS:
        raise InputError(
            "horizon", f"{horizon:g} s is {steps:.3g} steps, must be {_MOST_STEPS:g} at most"
        )
    least, greatest = as_vector("bounds", bounds, 2)
    _delays_of_steps(name, delay, (least, greatest), step, max(1, int(np.ceil(steps - 1e-6))))


def _delays_of_steps(
    name: str, delay: Signal, bounds: tuple[float, float], step: float, steps: int
) -> Array:
    """The delay at the start, the middle and the end of each step, shape (3, steps)."""
    _check_axes(name, delay)
    delay.check_jumps(name, step, steps * step)
    time = (np.arange(steps) + np.array([[0.0], [0.5], [1.0]])) * step
    values = np.array([delay(row, before=i == 2)[:, 0] for i, row in enumerate(time)])
    least, greatest = bounds
    outside = (values < least - SAME_INSTANT) | (values > greatest + SAME_INSTANT)
    if outside.any():
        # The earliest one: columns are steps, and rows go on within a step.
        k, place = divmod(int(np.argmax(outside.T)), 3)
        allowed = f"from {least:g} to {greatest:g} s" if greatest < np.inf else f"{least:g} or more"
        raise InputError(
            name,
            f"is {values[place, k]:.9g} s at t = {time[place, k]:.9g} s, must be {allowed}",
        )
    return values


def _check_axes(name: str, signal: Signal) -> None:
    if as_kind(name, signal, Signal).axes != 1:
        raise InputError(name, f"has {signal.axes} axes, must have 1")


def _check_arrivals(control: Signal, origins: Array, step: float) -> None:
    """Refuse a break of the control in the time that one step covers.

    ``origins`` are the instants t - tau(t) at the start, the middle and the end of the steps. A
    break that the start just has behind it and the end just before it lies on the grid. So does
    none that time runs past backwards: then the limits from inside would be on the other side.
    """
    breaks = np.array(control.breaks)
    first = np.searchsorted(breaks, origins[0] + SAME_INSTANT, side="right")
    middle = np.searchsorted(breaks, origins[1])
    last = np.searchsorted(breaks, origins[2] - SAME_INSTANT)
    crossed = np.flatnonzero((first != middle) | (middle != last))
    if crossed.size:
        k = crossed[0]
        instant = breaks[min(first[k], middle[k], last[k])]
        raise InputError(
            "control",
            f"jumps or bends at {instant:.9g} s, which arrives inside the step from "
            f"{k * step:.9g} to {(k + 1) * step:.9g} s, must arrive at a multiple of the step",
        )


def _values(control: Signal, origins: Array, before: bool) -> Array:
    """The control at instants in any order: where the delay jumps up they go back."""
    if np.all(origins[1:] >= origins[:-1]):
        return control(origins, before=before)[:, 0]
    order = np.argsort(origins, kind="stable")
    values = np.empty(len(origins))
    values[order] = control(origins[order], before=before)[:, 0]
    return values


@allocating_kernel
def _simulate(
    drift: Any, input_gain: Any, parameters: Array, size: tuple[int, ...], inputs: Array,
    step: float, states: Array,
) -> int:  # fmt: skip
    """Fill ``states`` from its first row, and return the last index with a finite state.

    ``size`` is a tuple of n zeros, whose length the compiler knows, so that it can write the loops
    over states out. The rows of ``inputs`` are the delayed input at the start, the middle and the
    end of a step.
    """
    n = len(size)
    total, x, f, gain = np.empty(n), np.empty(n), np.empty(n), np.empty(1)
    y = x[0:1]
    for i in range(n):
        x[i] = states[0, i]
    for k in range(len(states) - 1):
        for i in range(n):
            total[i] = 0.0
        for stage in range(4):
            weight = 2.0 if stage in (1, 2) else 1.0
            ahead = step if stage == 2 else 0.5 * step
            # x_i' = x_(i+1) + f_i(x), with G(y) u(t - tau) for x_(n+1): (1)
            call(drift, (x, parameters, f))
            call(input_gain, (y, parameters, gain))
            for i in range(n):
                pushed = x[i + 1] if i < n - 1 else gain[0] * inputs[(stage + 1) // 2, k]
                slope = pushed + f[i]
                total[i] += weight * slope
                x[i] = states[k, i] + ahead * slope
        # x(t + h) = x(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
        for i in range(n):
            x[i] = states[k, i] + step / 6.0 * total[i]
            if not np.isfinite(x[i]):
                return k
            states[k + 1, i] = x[i]
    return len(states) - 1

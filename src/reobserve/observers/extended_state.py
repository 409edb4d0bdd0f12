"""PI and PD/PI extended state observer (Indriawati, Agustinah & Jazidie, (8) and (6)).

The measured y is never differentiated: the observer runs the filter itself, and knows
Y' = Az (y - xz). With Eo = I + Ld C~ and Ao = A~ - L C~ it is

    xz' = Az (y - xz),    Eo x^' = Ao x^ + B~ u + (L - Ld Az) xz + Ld Az y,

linear in y and u and sampled exactly. With zeta = Eo x^ - Ld xz the second line is
zeta' = Ao x^ + B~ u + L xz, the same in other coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.discretisation import interpolating_hold
from reobserve.core.errors import InputError
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import allocating_kernel, inlined_kernel
from reobserve.core.matrices import as_floats, as_vector
from reobserve.core.value import Value, converter
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.fixed_step import Samples, Steps
from reobserve.observers.record import Rows, check_state
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

Array = NDArray[np.float64]

# Fractions of a step at which y and u are known: they are parabolas through these three.
_NODES = (0.0, 1.0, 0.5)

_UNROLLED = 16  # states: more are faster in vector instructions over a plain loop


@dataclass(frozen=True, eq=False, repr=False)
class EsoState(Value):
    """All the observer remembers: a value that may be stored, copied and stepped again.

    ``filtered`` is xz, shape (p,), and ``estimate`` x^, shape (N,), at the last row; the rest is as
    in `reobserve.observers.record.ObserverState`.
    """

    filtered: Array
    estimate: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedStateObserver(IntegratingObserver[EsoState]):
    """Extended state observer of the state, actuator faults and sensor faults, sampled exactly.

        x^' = A~ x^ + B~ u + L (Y - C~ x^) + Ld (Y' - C~ x^'),    xz' = Az (y - xz),    Y = xz

    Indriawati, Agustinah & Jazidie, (3), (6), (8) and (37). x^ is [x, xz, fa, fs], of the plant
    augmented by the filter xz and by the faults; Ld = 0 is the PI observer. The errors of the
    estimates do not contain u: whatever controls the plant, they are the same.

    `init` takes the estimate x^ and filtered, xz; left out, a run starts from zeros. `run` and
    `step` take y, shape (k, p), and u, (k, m). Between samples y goes in straight lines and u is
    held, or both are what ``before`` and ``middle`` say: parabolas that may jump at samples. For
    smooth y and u the error falls with the square of the sampling period, and with its fourth power
    where parabolas are read. Estimates, in units of the system: ``state``, x, shape (k, n),
    ``actuator_fault``, fa, (k, r), and ``sensor_fault``, fs, (k, q).

    Parameters
    ----------
    system
        The observer's model of the plant, with the filter.
    gains
        L and Ld; with Ld = 0 it is the PI observer (6).
    sampling_period
        [s].

    Raises
    ------
    InputError
        If gains have the wrong shape, Eo is singular, an eigenvalue of Eo^-1 Ao is not in the left
        half plane, or the period is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import ExtendedStateObserver
    >>> from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
    >>> system = AugmentedSystem(A=[[-1]], B=[[1]], C=[[1]], Dd=[[1]], Dw=[[1]], Fa=[[1]],
    ...                          Fs=np.zeros((1, 0)))  # x' = -x + u + fa, y = x
    >>> gains = Gains(L=[[5], [3], [5]], Ld=np.zeros((3, 1)))
    >>> observer = ExtendedStateObserver(system, gains=gains, sampling_period=0.05)
    >>> run = observer.run(np.zeros(400), np.full(400, 0.5))  # it stands still: fa = -u
    >>> print(run["actuator_fault"][-1].round(3))
    [-0.5]
    """

    system: AugmentedSystem = field(metadata=converter(as_kind, AugmentedSystem))
    gains: Gains = field(kw_only=True, metadata=converter(as_kind, Gains))

    exact: ClassVar[bool] = True
    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("state", "actuator_fault", "sensor_fault"), ""
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        wanted = (self.system.size, self.system.outputs)
        for name in ("L", "Ld"):
            gain = as_floats(name, getattr(self.gains, name))
            if gain.shape != wanted:
                raise InputError(name, f"has shape {gain.shape}, must be {wanted}")
        values = np.linalg.svd(self._Eo, compute_uv=False)
        if values[-1] <= self.system.size * np.finfo(float).eps * values[0]:
            raise InputError(
                "Ld",
                "makes Eo = I + Ld C~ singular: its singular values go from "
                f"{values[0]:.3g} down to {values[-1]:.3g}",
            )
        poles = self.poles
        rounding = len(poles) * np.finfo(float).eps * np.abs(poles).max()
        if poles.real.max() >= -rounding:
            listed = ", ".join(f"{pole:.6g}" for pole in poles)
            raise InputError(
                "L",
                "and Ld give no stable observer: all eigenvalues of Eo^-1 Ao must have a negative "
                f"real part, they are {listed}",
            )

    @property
    def measurements(self) -> int:
        """The number of measurements in a row of y."""
        return self.system.outputs

    @property
    def inputs(self) -> int:
        """The number of known inputs in a row of u."""
        return int(self.system.B.shape[1])

    @property
    def poles(self) -> NDArray[Any]:
        """Eigenvalues of Eo^-1 Ao [1/s], shape (N,), the slowest first."""
        poles = np.linalg.eigvals(np.linalg.solve(self._Eo, self._Ao))
        return poles[np.argsort(-poles.real, kind="stable")]

    @property
    def _Eo(self) -> Array:
        """Eo of the descriptor pair (Eo, Ao)."""
        return np.eye(self.system.size) + np.asarray(self.gains.Ld) @ self.system.C_tilde

    @property
    def _Ao(self) -> Array:
        """Ao of the descriptor pair (Eo, Ao)."""
        return self.system.A_tilde - np.asarray(self.gains.L) @ self.system.C_tilde

    @cached_property
    def _weights(self) -> Array:
        """The sampled observer, transposed: [xz, x^] next, of [xz, x^], and y and u at `_NODES`."""
        Az, L, Ld = self.system.Az, np.asarray(self.gains.L), np.asarray(self.gains.Ld)
        p, m, size = self.system.outputs, self.system.B.shape[1], self.system.size
        faults = np.zeros((self.system.faults, m))
        known = np.hstack([Ld @ Az, np.vstack([self.system.Ba, faults])])
        right = np.hstack([L - Ld @ Az, self._Ao, known])
        below = np.linalg.solve(self._Eo, right)
        above = np.hstack([-Az, np.zeros((p, size)), Az, np.zeros((p, m))])
        rates = np.vstack([above, below])
        A, B = rates[:, : p + size], rates[:, p + size :]
        transition, effects = interpolating_hold(A, B, self.sampling_period, _NODES)
        return np.ascontiguousarray(np.hstack([transition, *effects]).T)

    def init(
        self, estimate: ArrayLike | None = None, *, filtered: ArrayLike | None = None
    ) -> EsoState:
        """The state at the first sample. Without it a run starts from zeros.

        Parameters
        ----------
        estimate
            Of x, xz, fa and fs at the first sample, shape (N,); left out, zeros.
        filtered
            xz, shape (p,); left out, zeros. The first y spares the filter its own transient.

        Raises
        ------
        InputError
            If one is not so many finite numbers.
        """
        size, p = self.system.size, self.system.outputs
        return EsoState(
            np.zeros(p) if filtered is None else as_vector("filtered", filtered, p),
            np.zeros(size) if estimate is None else as_vector("estimate", estimate, size),
        )

    def _start(self, first: Array) -> EsoState:
        return self.init()

    def _checked(self, state: Any) -> EsoState:
        size, p, m = self.system.size, self.measurements, self.inputs
        return check_state(
            state, EsoState, f"must be of an observer of size {size} with {p} outputs",
            filtered=(p,), estimate=(size,), sample=(p + m,),
        )  # fmt: skip

    def _integrate(self, state: EsoState, steps: Steps) -> Rows:
        p, m, states = self.measurements, steps.y.steps, self.measurements + self.system.size
        rows, known = np.empty((m + 1, states)), np.zeros(len(self._weights))
        known[:states] = rows[0] = np.concatenate([state.filtered, state.estimate])
        # The compiler knows the length of a tuple, and unrolls the loops over it.
        size: Sized = (0,) * states if states <= _UNROLLED else np.empty(states)
        finite = _run(size, self._weights, known, *steps, rows)
        n, r = self.system.states, self.system.Fa.shape[1]
        ends = np.cumsum([p, n, p, r])
        estimates = {
            "state": rows[:, ends[0] : ends[1]],
            "actuator_fault": rows[:, ends[2] : ends[3]],
            "sensor_fault": rows[:, ends[3] :],
        }
        last = rows[-1].copy()
        return Rows(estimates, finite, EsoState(last[:p], last[p:], state.sample, state.count + m))


@inlined_kernel
def _take(y: Array, u: Array, k: int, known: Array) -> None:
    """Write row k of y and u to the start of ``known``."""
    # [y, u] at one of the times t, t + h and t + h/2
    p = y.shape[1]
    for i in range(p):
        known[i] = y[k, i]
    for i in range(u.shape[1]):
        known[p + i] = u[k, i]


@allocating_kernel
def _run(size: Sized, weights: Array, known: Array, y: Samples, u: Samples, rows: Array) -> int:
    """Fill ``rows``, [xz, x^], after the first, and return the number of finite rows.

    Indriawati, Agustinah & Jazidie, (3), (6) and (8), sampled. ``known`` begins with the first row.
    """
    n, columns = len(size), y.right.shape[1] + u.right.shape[1]
    after = np.empty(n)
    due = FIRST
    for k in range(1, len(rows)):
        if k >= due:
            due = poll(k)
        _take(y.right, u.right, 2 * k - 2, known[n:])
        _take(y.left, u.left, 2 * k, known[n + columns :])
        _take(y.right, u.right, 2 * k - 1, known[n + 2 * columns :])
        # [xz, x^](t + h) = [xz(t), x^(t), y(t), u(t), y(t + h), u(t + h), y(t + h/2), u(t + h/2)] W
        for i in range(n):
            after[i] = 0.0
        for j in range(len(weights)):
            for i in range(len(size)):
                after[i] += weights[j, i] * known[j]
        total = 0.0
        for i in range(n):
            rows[k, i] = known[i] = after[i]
            total += after[i]
        if not np.isfinite(total):
            return k
    return len(rows)

"""PI and PD/PI extended state observer (Indriawati, Agustinah & Jazidie, (8) and (6)).

It estimates the state, actuator faults and sensor faults of a linear plant at once. With the plant
augmented by the filter xz' = Az (y - xz) and by the faults, and with x^ for [x, xz, fa, fs]

    x^' = A~ x^ + B~ u + L (Y - C~ x^) + Ld (Y' - C~ x^'),    Y = xz;

Ld = 0 is the PI observer. The measured y is never differentiated: the observer runs the filter
itself, and knows Y' = Az (y - xz). With Eo = I + Ld C~ and Ao = A~ - L C~ it is

    xz' = Az (y - xz),    Eo x^' = Ao x^ + B~ u + (L - Ld Az) xz + Ld Az y,

linear in y and u and sampled exactly. With zeta = Eo x^ - Ld xz the second line is
zeta' = Ao x^ + B~ u + L xz, the same in other coordinates.

The errors of the estimates do not contain u: whatever controls the plant, they are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError, shown
from reobserve.numerics.arguments import as_kind, as_word
from reobserve.numerics.discretisation import interpolating_hold
from reobserve.numerics.matrices import as_floats, as_positive, as_row, as_vector
from reobserve.observers.contract import OnDivergence, check_state, raises
from reobserve.observers.extended_state_loop import Pair, read_pair, run_observer
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

Array = NDArray[np.float64]

# Where, as fractions of the period, the values lie that tell y and u between two samples.
HOLDS = {"zero": (0.0,), "first": (0.0, 1.0), "second": (0.0, 1.0, 0.5)}


@dataclass(frozen=True, eq=False)
class State:
    """All the observer remembers: a value that may be stored, copied and stepped again.

    ``filtered`` is xz, shape (p,), and ``estimate`` x^, shape (N,), at the sample taken last, of
    which ``sample`` keeps y and u, shape (p + m,). ``count`` samples were taken.
    """

    filtered: Array
    estimate: Array
    sample: Array
    count: int = 0


@dataclass(frozen=True, eq=False)
class Run:
    """Estimates at the samples of a record.

    ``estimate`` of x has shape (k, n), ``actuator_fault`` (k, r) and ``sensor_fault`` (k, q).
    ``diverged_at`` is None, or the time [s] since the first sample of all after which the state
    left the range of floating-point numbers; then k counts the rows up to it. ``state`` is the
    one to go on from, or after a divergence the one that the run started from.
    """

    estimate: Array
    actuator_fault: Array
    sensor_fault: Array
    state: State
    diverged_at: float | None


@dataclass(frozen=True, eq=False)
class ExtendedStateObserver:
    """The observer (8) for samples at a fixed period.

    Parameters
    ----------
    system
        The plant as the observer knows it, with the filter.
    gains
        L and Ld; with Ld = 0 it is the PI observer (6).
    period
        Between samples [s].
    hold
        What y and u do between samples: ``zero``, they keep the value of the sample, as sampled
        data do; ``first``, straight lines; ``second``, parabolas through a value in the middle.
        For y and u that are smooth between samples the error of the estimates falls with the
        period, its square and its fourth power.

    Raises
    ------
    InputError
        If gains have the wrong shape, Eo is singular, an eigenvalue of Eo^-1 Ao is not in the left
        half plane, the period is not positive or there is no such hold.
    """

    system: AugmentedSystem
    gains: Gains
    period: float
    hold: str = "zero"

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", as_positive("period", self.period))
        as_word("hold", self.hold, tuple(HOLDS))
        as_kind("system", self.system, AugmentedSystem)
        as_kind("gains", self.gains, Gains)
        wanted = (self.system.size, self.system.outputs)
        for name in ("L", "Ld"):
            gain = as_floats(name, getattr(self.gains, name))
            if gain.shape != wanted:
                raise InputError(name, f"has shape {gain.shape}, must be {wanted}")
        values = np.linalg.svd(self._mass, compute_uv=False)
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
    def poles(self) -> NDArray[Any]:
        """Eigenvalues of Eo^-1 Ao [1/s], shape (N,), the slowest first."""
        poles = np.linalg.eigvals(np.linalg.solve(self._mass, self._stiffness))
        return poles[np.argsort(-poles.real, kind="stable")]

    @property
    def _mass(self) -> Array:
        """Eo."""
        return np.eye(self.system.size) + np.asarray(self.gains.Ld) @ self.system.C_tilde

    @property
    def _stiffness(self) -> Array:
        """Ao."""
        return self.system.A_tilde - np.asarray(self.gains.L) @ self.system.C_tilde

    @cached_property
    def _weights(self) -> Array:
        """The sampled observer, transposed: [xz, x^] next, of [xz, x^] and then y and u as held."""
        Az, L, Ld = self.system.Az, np.asarray(self.gains.L), np.asarray(self.gains.Ld)
        p, m, size = self.system.outputs, self.system.B.shape[1], self.system.size
        faults = np.zeros((self.system.faults, m))
        known = np.hstack([Ld @ Az, np.vstack([self.system.Ba, faults])])
        right = np.hstack([L - Ld @ Az, self._stiffness, known])
        below = np.linalg.solve(self._mass, right)
        above = np.hstack([-Az, np.zeros((p, size)), Az, np.zeros((p, m))])
        rates = np.vstack([above, below])
        A, B = rates[:, : p + size], rates[:, p + size :]
        transition, effects = interpolating_hold(A, B, self.period, HOLDS[self.hold])
        return np.ascontiguousarray(np.hstack([transition, *effects]).T)

    def init(self, estimate: ArrayLike | None = None, filtered: ArrayLike | None = None) -> State:
        """The state before the first sample.

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
        return State(
            np.zeros(p) if filtered is None else as_vector("filtered", filtered, p),
            np.zeros(size) if estimate is None else as_vector("estimate", estimate, size),
            np.zeros(p + self.system.B.shape[1]),
        )

    def step(
        self,
        state: State,
        output: ArrayLike,
        control: ArrayLike,
        before: Pair | None = None,
        middle: Pair | None = None,
    ) -> tuple[State, Array]:
        """Take one sample: the next state, and the estimate of [x, xz, fa, fs] at it, shape (N,).

        The arguments are those of `run`, without the axis of samples. Stepping through a record
        gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        run = self.run(
            as_row("output", output), as_row("control", control), state,
            None if before is None else _single("before ", before),
            None if middle is None else _single("middle ", middle),
        )  # fmt: skip
        return run.state, run.state.estimate

    def run(
        self,
        output: ArrayLike,
        control: ArrayLike,
        state: State,
        before: Pair | None = None,
        middle: Pair | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> Run:
        """Estimates at all samples, by one compiled loop.

        An estimate is made from the samples up to its own, with the zero-order hold from those
        before its own; the one at the first sample of all is that which `init` was given.

        Parameters
        ----------
        output, control
            y, shape (k, p), and u, shape (k, m).
        state
            From `init`, or from an earlier run to go on with the sample after its last.
        before
            y and u where a record jumps at samples: their limits from the left, in the same
            shapes. Not for the zero-order hold, which asks for none.
        middle
            y and u in the middle between each sample and the one before it, in the same shapes:
            for the parabolas of the second-order hold, and for those alone.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a sample is not finite, the hold takes no such values or misses
            them, or the state is not of such an observer.
        DivergenceError
            If an estimate leaves the range of floating-point numbers.
        """
        loud = raises(on_divergence)
        p, m, size = self.system.outputs, self.system.B.shape[1], self.system.size
        state = check_state(
            state, State, f"must be of an observer of size {size} with {p} outputs",
            filtered=(p,), estimate=(size,), sample=(p + m,),
        )  # fmt: skip
        if before is not None and self.hold == "zero":
            raise InputError("before", "must be left out: the zero-order hold asks for no limits")
        if (middle is None) == (self.hold == "second"):
            need = "is missing" if middle is None else "must be left out"
            raise InputError("middle", f"{need}: the hold is {self.hold!r}, second needs it alone")
        taken = read_pair("", (output, control), (p, m))
        rows = len(taken.output)
        held = [taken]
        if self.hold != "zero":
            held.append(taken if before is None else read_pair("before ", before, (p, m), rows))
        if middle is not None:
            held.append(read_pair("middle ", middle, (p, m), rows))
        found = np.empty((rows, p + size))
        start = np.concatenate([state.filtered, state.estimate, state.sample])
        finite = run_observer(self._weights, start, held, found, state.count == 0)
        good = found[:finite]
        after, diverged_at = state, None
        if finite < rows:
            diverged_at = max(state.count + finite - 1, 0) * self.period
            if loud:
                raise DivergenceError(type(self).__name__, diverged_at)
        else:
            last = np.concatenate([taken.output[-1], taken.control[-1]])
            after = State(good[-1, :p].copy(), good[-1, p:].copy(), last, state.count + rows)
        n, r = self.system.states, self.system.Fa.shape[1]
        ends = np.cumsum([p, n, p, r])
        return Run(
            good[:, ends[0] : ends[1]], good[:, ends[2] : ends[3]], good[:, ends[3] :],
            after, diverged_at,
        )  # fmt: skip


def _single(name: str, pair: Pair) -> Pair:
    """A sample as a record of one row."""
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        raise InputError(name.strip(), f"{shown(pair)} must be a pair of y and u")
    return as_row(f"{name}output", pair[0]), as_row(f"{name}control", pair[1])

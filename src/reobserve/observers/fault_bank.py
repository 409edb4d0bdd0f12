"""A bank of Kalman filters for faults that jump or drift."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.covariances import as_covariance
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.core.matrices import as_positive, as_sized, as_vector
from reobserve.observers.augmented_kalman import as_fault_matrices
from reobserve.observers.gaussian_state import ModeFilter
from reobserve.observers.imm import IMM, BankRows, ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.run import AxisNames
from reobserve.synthesis.linear_gain import undetectable_modes
from reobserve.systems.linear import LinearModel
from reobserve.systems.signal_names import as_names

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FaultBank(IMM):
    """Interacting multiple model of the state and q faults, each of which drifts or jumps.

        x(k+1) = A x(k) + B u(k) + E f(k) + w(k)
        y(k)   = C x(k) + D u(k) + F f(k) + v(k)
        df = f' dt + jump db1,    df' = drift db2

    with independent Wiener processes b1 and b2 for each fault. In mode 0 all faults drift, with
    jump = 0; in mode i fault i jumps, too. Mode 0 is left with ``jump_rate``, for each other mode
    alike, and these after ``jump_time`` in the mean. The modes are Kalman filters on [x, f, f'] of
    an interacting multiple model (Blom & Bar-Shalom 1988); a random walk with a rate is the
    continuous Wiener process acceleration model of Bar-Shalom, Li & Kirubarajan 2001, Section 6.2,
    an order lower. A constant fault is followed as slowly as the drift says, and a jump at once,
    which no one random walk can do.

    `init` takes mean and covariance of x, and those of faults and their rates; `run` and `step`
    take y, shape (k, m), nan where missing, u, (k, p), and R by name. Estimates, in units of the
    model: ``state``, x, (k, n), ``covariance``, (k, n, n), and ``variance``, (k, n); ``fault``, f,
    (k, q), ``fault_rate``, f' per second, (k, q), and ``fault_variance`` and
    ``fault_rate_variance``, (k, q); ``probability`` of the modes, (k, q + 1); ``innovation``,
    (k, q + 1, m), and ``log_likelihood``, (k,), as `IMM` has them.

    Parameters
    ----------
    model
        The linear model of the plant without faults.
    fault_matrix
        E, shape (n, q): what each fault adds to the state in a sampling period.
    drift
        What a fault's rate gains in a second, as a standard deviation [unit of f / s per sqrt(s)];
        a number, or q.
    jump
        What a fault gains in a second while it jumps [unit of f per sqrt(s)]; a number, or q. A
        jump of the size s takes about s / sqrt(``jump_time``).
    jump_rate
        Jumps of all faults a second.
    jump_time
        The mean time [s] in a mode of a jump: some sampling periods.
    output_fault_matrix
        F, shape (m, q): what it adds to the measurement, zero if left out.
    fault_names
        With which runs are labelled; left out, they are numbered.
    gate, noise_memory
        As those of `IMM`.

    Raises
    ------
    InputError
        If shapes do not fit, a number is not above zero, or a mode of [x, f, f'] is unobservable
        that does not decay: two faults, say, that do the same.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import FaultBank, LinearModel
    >>> plant = LinearModel([[0.9]], C=[[1]], Q=1e-4, R=1e-4, sampling_period=0.1)
    >>> bank = FaultBank(
    ...     plant, fault_matrix=[[0.1]], drift=0.01, jump=5.0, jump_rate=0.1, jump_time=0.1
    ... )
    >>> y = np.concatenate([np.zeros(20), 1 - 0.9 ** np.arange(30)])
    >>> run = bank.run(y, start=bank.init([0], 1e-2))
    >>> print(run["fault"][[20, 25, 49], 0].round(1), run["probability"][[20, 21], 1].round(1))
    [0. 1. 1.] [0. 1.]
    """

    filters: tuple[ModeFilter, ...] = field(init=False, repr=False)
    transition: Array = field(init=False, repr=False)
    mixing: bool = field(init=False, repr=False)
    model: LinearModel
    _: KW_ONLY
    fault_matrix: Array
    drift: Array
    jump: Array
    jump_rate: float
    jump_time: float
    output_fault_matrix: Array = None  # type: ignore[assignment]  # zeros, once it is made
    fault_names: tuple[str, ...] | None = None

    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        (*IMM.units, "fault", "fault_variance", "fault_rate", "fault_rate_variance"), ""
    )
    takes: ClassVar[tuple[str, ...]] = ("R",)

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self, model: LinearModel, *, fault_matrix: ArrayLike, drift: ArrayLike, jump: ArrayLike,
            jump_rate: float, jump_time: float, output_fault_matrix: ArrayLike | None = ...,
            fault_names: Sequence[str] | None = ..., gate: float | None = ...,
            noise_memory: float | None = ...,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        model = as_kind("model", self.model, LinearModel)
        E, F = as_fault_matrices(model, self.fault_matrix, self.output_fault_matrix)
        q, put = E.shape[1], self._set
        put("fault_matrix", E)
        put("output_fault_matrix", F)
        for name in ("drift", "jump"):
            values = as_sized(name, getattr(self, name))
            sizes = np.full(q, float(values)) if values.ndim == 0 else as_vector(name, values, q)
            for value in sizes:
                as_positive(name, value)
            put(name, sizes)
        for name in ("jump_rate", "jump_time"):
            put(name, as_positive(name, getattr(self, name)))
        put("fault_names", as_names("fault_names", self.fault_names, q))
        modes = [KalmanFilter(self._mode(mode)) for mode in range(q + 1)]
        unobservable = undetectable_modes(modes[0].model.A, modes[0].model.C)
        if len(unobservable):
            raise InputError(
                "fault_matrix",
                "leaves a mode of state, faults and their rates unobservable that does not decay, "
                f"of the eigenvalue {unobservable[0]:.4g}",
            )
        put("filters", tuple(modes))
        put("transition", self._chain(q, model.sampling_period))
        put("mixing", True)
        super().__post_init__()

    @property
    def faults(self) -> int:
        """The number q of faults."""
        return int(self.fault_matrix.shape[1])

    def _mode(self, mode: int) -> LinearModel:
        """The model of [x, f, f'] in which fault ``mode`` jumps, none for 0."""
        model, E, F = self.model, self.fault_matrix, self.output_fault_matrix
        (n, q), T = E.shape, model.sampling_period
        eye, none = np.eye(q), np.zeros
        # [A E 0; 0 I T I; 0 0 I]
        A = np.block(
            [[model.A, E, none((n, q))], [none((q, n)), eye, T * eye], [none((q, n + q)), eye]]
        )
        Q = none((n + 2 * q, n + 2 * q))
        Q[:n, :n] = model.Q
        Q[n:, n:] = self._noise(mode)
        augmented = LinearModel(
            A, np.vstack([model.B, none((2 * q, model.inputs))]),
            np.hstack([model.C, F, none((model.outputs, q))]), model.D, Q=Q, R=model.R, check=False,
            sampling_period=T, input_names=model.input_names, output_names=model.output_names,
        )  # fmt: skip
        augmented._set("output_periods", model.output_periods)
        if model.state_periods is not None:
            augmented._set("state_periods", np.concatenate([model.state_periods, none(2 * q)]))
        return augmented

    @finite("drift, jump")
    def _noise(self, mode: int) -> Array:
        """The covariance that faults and their rates gain in a period while ``mode`` holds."""
        T = self.model.sampling_period
        jumps = np.where(np.arange(self.faults) == mode - 1, self.jump**2, 0.0) * T
        # int_0^T [s; 1] [s; 1]' ds drift^2, and T jump^2
        level, across, rate = (self.drift**2 * part for part in (T**3 / 3, T**2 / 2, T))
        return np.block(
            [[np.diag(level + jumps), np.diag(across)], [np.diag(across), np.diag(rate)]]
        )

    def _chain(self, q: int, T: float) -> Array:
        """The chain of the modes, from one row to the next."""
        leave, stay = -math.expm1(-self.jump_rate * T), math.exp(-T / self.jump_time)
        chain = np.diag([1.0 - leave, *[stay] * q])
        chain[0, 1:], chain[1:, 0] = leave / q, 1.0 - stay
        return chain

    @cached_property
    def component_names(self) -> Mapping[str, AxisNames]:
        """Names of components of estimates."""
        by_model = dict(KalmanFilter(self.model).component_names)
        known = ("state", "variance", "covariance")
        names: dict[str, AxisNames] = {name: by_model[name] for name in known if name in by_model}
        if self.model.output_names is not None:
            names["innovation"] = (None, self.model.output_names)
        if self.fault_names is not None:
            for name in ("fault", "fault_rate"):
                names[name] = names[f"{name}_variance"] = (self.fault_names,)
        return names

    def init(  # type: ignore[override]  # probabilities are those of mode 0
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        fault: ArrayLike | None = None,
        fault_covariance: ArrayLike | None = None,
        rate_covariance: ArrayLike | None = None,
        u: ArrayLike | None = None,
    ) -> ImmState:
        """The state before the first row of a record, in mode 0.

        Parameters
        ----------
        mean, covariance
            Of the state: shape (n,); a number, n numbers or (n, n).
        fault
            Its mean, shape (q,); left out, zeros, as those of the rates are.
        fault_covariance, rate_covariance
            Of faults and of their rates: a number, q numbers or (q, q). Left out, what a period
            of jumping, and of drifting, adds: T ``jump``^2 and T ``drift``^2.
        u
            As `GaussianFilter.init`.
        """
        n, q = self.fault_matrix.shape
        f = np.zeros(q) if fault is None else as_vector("fault", fault, q)
        P = np.zeros((n + 2 * q, n + 2 * q))
        T = self.sampling_period
        for name, value, first, size in (
            ("covariance", covariance, 0, n),
            ("fault_covariance", T * self.jump**2 if fault_covariance is None else
             fault_covariance, n, q),
            ("rate_covariance", T * self.drift**2 if rate_covariance is None else rate_covariance,
             n + q, q),
        ):  # fmt: skip
            part = slice(first, first + size)
            P[part, part] = as_covariance(name, value, size)
        x = np.concatenate([as_vector("mean", mean, n), f, np.zeros(q)])
        return super().init(x, P, probabilities=np.eye(q + 1)[0], u=u)

    def _by_name(self, rows: BankRows) -> dict[str, Array]:
        whole, (n, q) = super()._by_name(rows), self.fault_matrix.shape
        x, variance, covariance = whole.pop("state"), whole.pop("variance"), rows.covariance
        parts = {"": slice(0, n), "fault": slice(n, n + q), "fault_rate": slice(n + q, n + 2 * q)}
        estimates = {}
        for name, part in parts.items():
            estimates[name or "state"] = x[:, part]
            estimates[f"{name}_variance" if name else "variance"] = variance[:, part]
        return {**estimates, **whole, "covariance": covariance[:, :n, :n]}

"""A linear model in discrete time with Gaussian noise, the model of Kalman filters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_flag
from reobserve.core.covariances import as_covariance, as_covariances
from reobserve.core.discretisation import held_noise, zero_order_hold
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, as_positive, as_sized
from reobserve.core.value import Value, for_loop
from reobserve.systems.periods import Periods, as_periods, check_period_of_effects
from reobserve.systems.signal_names import as_names

Array = NDArray[np.float64]


class ModelRows(NamedTuple):
    """The matrices of a model by row, (., n, n) and so on, the last one for later rows."""

    A: Array
    B: Array
    C: Array
    D: Array
    Q: Array
    R: Array
    correlation: Any = None  # what loops read and write of S, None without it


class Ode(NamedTuple):
    """Matrices of x' = A x + B u and the spectral density of its noise, None if that is unknown."""

    A: Array
    B: Array
    density: Array | None


class ModelArrays(NamedTuple):
    """The matrices of a model as compiled loops read them."""

    A: Array
    B: Array
    C: Array
    D: Array
    Q: Array
    R: Array


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel(Value):
    """Linear model in discrete time with Gaussian noise, whose arrays are read-only copies.

        x(k+1) = A x(k) + B u(k) + w(k)         w ~ N(0, Q)
        y(k)   = C x(k) + D u(k) + v(k)         v ~ N(0, R)

    Parameters
    ----------
    A
        Transition of the state, shape (n, n).
    B
        Effect of the input, shape (n, p); left out, there is no input.
    C
        Measurement, shape (m, n).
    D
        Feedthrough, shape (m, p); zero if left out.
    Q
        Covariance of the process noise: a number, n numbers or (n, n); positive semidefinite.
    R
        Covariance of the measurement noise: a number, m numbers or (m, m); positive
        semidefinite, zero of what is measured exactly.
    sampling_period
        Of the transition [s]; left out, time is counted in samples.
    check
        Refuse a transition that looks like one of continuous time, see below.
    state_names, input_names, output_names
        Names of the signals, with which runs are labelled; left out, they are numbered.
    state_periods, output_periods
        Of angles: the difference after which a state or an output is the same again, such as 360,
        by name or as a list with None for what is no angle. Innovations are then the shortest way
        round, and estimates of such a state are within half a period of zero.

    Raises
    ------
    InputError
        If C, Q or R is left out; the shapes do not fit; Q or R is not symmetric positive
        semidefinite; an angle among the states has another effect after its period; names are not
        different or not as many as signals; the sampling period is
        not positive; or, with ``check``, A looks like one of continuous time: all its eigenvalues
        have a real part of zero or less, or one with a negative real part lies outside the unit
        circle. Sampling a real system gives neither, unless it turns more than a quarter of a
        circle in a sample.

    Examples
    --------
    >>> from reobserve import LinearModel
    >>> model = LinearModel([[1, 0.1], [0, 1]], [[0], [0.1]], [[1, 0]], Q=1e-4, R=1e-2)
    >>> print(model.states, model.inputs, model.outputs)
    2 1 1
    >>> sampled = LinearModel.from_ode([[-1]], [[1]], [[1]], Q=0.01, R=0.1, sampling_period=0.1)
    >>> print(sampled.A.round(3), sampled.B.round(3))  # of x' = -x + u
    [[0.905]] [[0.095]]
    """

    # None where one is left out; arrays, once the model is constructed.
    A: Array
    B: Array = None  # type: ignore[assignment]
    C: Array = None  # type: ignore[assignment]
    D: Array = None  # type: ignore[assignment]
    _: KW_ONLY
    Q: Array = None  # type: ignore[assignment]
    R: Array = None  # type: ignore[assignment]
    sampling_period: float = 1.0
    check: bool = True
    state_names: tuple[str, ...] | None = None
    input_names: tuple[str, ...] | None = None
    output_names: tuple[str, ...] | None = None
    state_periods: Array | None = None
    output_periods: Array | None = None
    ode: Ode | None = field(default=None, init=False, repr=False)

    if TYPE_CHECKING:  # the parameters accept more types than the attributes have

        def __init__(
            self,
            A: ArrayLike,
            B: ArrayLike | None = ...,
            C: ArrayLike = ...,
            D: ArrayLike | None = ...,
            *,
            Q: ArrayLike = ...,
            R: ArrayLike = ...,
            sampling_period: float = ...,
            check: bool = ...,
            state_names: Sequence[str] | None = ...,
            input_names: Sequence[str] | None = ...,
            output_names: Sequence[str] | None = ...,
            state_periods: Periods | None = ...,
            output_periods: Periods | None = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        given: Any = self
        for name in ("C", "Q", "R"):
            if getattr(self, name) is None:
                raise InputError(name, "is missing: a linear model needs A, C, Q and R")
        A = as_sized("A", self.A)
        if A.ndim != 2 or A.shape[0] != A.shape[1] or not A.size:
            raise InputError("A", f"has shape {A.shape}, must be square")
        n = len(A)
        B = np.zeros((n, 0)) if given.B is None else as_sized("B", given.B)
        C = as_sized("C", self.C)
        if B.ndim != 2 or len(B) != n:
            raise InputError("B", f"has shape {B.shape}, must be ({n}, p), as A is {A.shape}")
        if C.ndim != 2 or C.shape[1] != n or not len(C):
            raise InputError("C", f"has shape {C.shape}, must be (m, {n}), as A is {A.shape}")
        m, p = len(C), B.shape[1]
        D = np.zeros((m, p)) if given.D is None else as_sized("D", given.D)
        if D.shape != (m, p):
            raise InputError("D", f"has shape {D.shape}, must be {(m, p)}, as C and B ask for")
        check = as_flag("check", self.check)
        if check:
            _check_discrete(A)
        Q, R = as_covariance("Q", self.Q, n), as_covariance("R", self.R, m)
        put = self._set
        for name, matrix in zip("ABCDQR", (A, B, C, D, Q, R), strict=True):
            put(name, matrix)
        put("sampling_period", as_positive("sampling_period", self.sampling_period))
        put("check", check)
        for name, size in (("state_names", n), ("input_names", p), ("output_names", m)):
            put(name, as_names(name, getattr(self, name), size))
        for kind, size in (("state", n), ("output", m)):
            key, names = f"{kind}_periods", getattr(self, f"{kind}_names")
            put(key, as_periods(key, getattr(self, key), size, names))
        for name, of_rows in (("A", self.state_periods), ("C", self.output_periods)):
            check_period_of_effects(name, getattr(self, name), self.state_periods, of_rows)

    @classmethod
    def from_ode(
        cls, A: ArrayLike, B: ArrayLike | None = None, C: ArrayLike = None,  # type: ignore[assignment]
        D: ArrayLike | None = None, *, Q: ArrayLike | None = None, R: ArrayLike = None,  # type: ignore[assignment]
        density: ArrayLike | None = None, sampling_period: float, check: bool = False,
        state_names: Sequence[str] | None = None, input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None, state_periods: Periods | None = None,
        output_periods: Periods | None = None,
    ) -> LinearModel:  # fmt: skip
        """The model of x' = A x + B u + w, y = C x + D u, with u held over each sampling period.

        Parameters
        ----------
        A, B
            Of the differential equation.
        C, D, R, check, state_names, input_names, output_names, state_periods, output_periods
            As in the class.
        Q
            Covariance of the noise that a sampling period adds to the state.
        density
            In place of Q: spectral density of the white noise w, in units of Q per second; a
            number, n numbers or (n, n). With it filters take samples at any times.
        sampling_period
            [s].

        Raises
        ------
        InputError
            As the class; or if both Q and the density are given.
        """
        period = as_positive("sampling_period", sampling_period)
        A = as_sized("A", A)
        held = np.zeros((len(np.atleast_1d(A)), 0)) if B is None else as_sized("B", B)
        # Ad = exp(A T), Bd = int_0^T exp(A s) ds B
        Ad, Bd = zero_order_hold(A, held, period)
        ode = Ode(A, held, None)
        if density is not None:
            if Q is not None:
                raise InputError("density", "is given beside Q, must be the only one of them")
            noise = as_covariance("density", density, len(Ad))
            ode, Q = ode._replace(density=noise), held_noise(ode.A, noise, period)
        model = cls(
            Ad, Bd, C, D, Q=Q, R=R, sampling_period=period, check=check, state_names=state_names,  # type: ignore[arg-type]
            input_names=input_names, output_names=output_names, state_periods=state_periods,
            output_periods=output_periods,
        )  # fmt: skip
        model._set("ode", ode)
        return model

    @cached_property
    def arrays(self) -> ModelArrays:
        """The matrices as compiled loops take them, which must not write to them."""
        return ModelArrays(*map(for_loop, (self.A, self.B, self.C, self.D, self.Q, self.R)))

    @cached_property
    def rows(self) -> ModelRows:
        """The matrices, the same for all rows."""
        return ModelRows(*(matrix[None] for matrix in self.arrays))

    @property
    def continuous(self) -> bool:
        """True if it is of a differential equation, which can be sampled over any time."""
        return self.ode is not None

    @property
    def density(self) -> Array | None:
        """The spectral density of its noise, if `from_ode` was given that."""
        return None if self.ode is None else self.ode.density

    def by_row(
        self, given: Mapping[str, Any], rows: int, held: Mapping[str, Array], periods: Array | None
    ) -> dict[str, Array]:
        """The matrices of a record of k rows, of which some are given.

        Parameters
        ----------
        given
            A, B, C, D, Q or R by name: as in the model, or one for each row, (k, ., .). Row k of A,
            B and Q leads from row k to row k + 1; C, D and R are those of the row.
        rows
            k.
        held
            A, B and Q that lead to the first row, where they are not the model's.
        periods
            The times [s] from each row to the next, shape (k + 1,) from the row before the record
            on; None where all are the sampling period.

        Returns
        -------
        dict
            Matrices by name, those of A, B and Q from the row before the record on.

        Raises
        ------
        InputError
            If a matrix has another shape or is not finite, or no covariance.
        """
        matrices = self.rows._asdict()
        if periods is not None:
            matrices.update(self._sampled(periods, given))
        for name in ("A", "B", "Q"):
            first = held.get(name)
            if first is not None and name not in given:
                later = matrices[name][0 if periods is None else 1 :]
                matrices[name] = np.concatenate([first[None], later])
        for name, value in given.items():
            own = getattr(self, name)
            if name in "QR":
                read = as_covariances(name, value, len(own), rows)
            else:
                read = as_matrices(name, value, own.shape, rows)
            if name in ("A", "C"):
                of_rows = self.state_periods if name == "A" else self.output_periods
                check_period_of_effects(name, read, self.state_periods, of_rows)
            if name in ("A", "B", "Q"):
                read = np.concatenate([held.get(name, own)[None], read])
            matrices[name] = read
        return matrices

    def _sampled(self, periods: Array, given: Mapping[str, Any]) -> dict[str, Array]:
        """A, B and Q over each of the periods, (k, ., .)."""
        if self.ode is None:
            raise InputError(
                "time", "is uneven, which a model of discrete time cannot follow; make the model "
                "by from_ode, or give A, B and Q by row",
            )  # fmt: skip
        if self.ode.density is None and "Q" not in given:
            raise InputError(
                "Q", "is the covariance of one sampling period; for uneven times give from_ode the "
                "density of the noise, or Q by row",
            )  # fmt: skip
        different, place = np.unique(periods, return_inverse=True)
        pairs = [zero_order_hold(self.ode.A, self.ode.B, period) for period in different]
        matrices = {"A": np.array([A for A, _ in pairs])[place]}
        matrices["B"] = np.array([B for _, B in pairs])[place]
        if self.ode.density is not None:
            noise = [held_noise(self.ode.A, self.ode.density, period) for period in different]
            matrices["Q"] = np.array(noise)[place]
        return matrices

    @property
    def states(self) -> int:
        """The number n of states."""
        return len(self.A)

    @property
    def inputs(self) -> int:
        """The number p of inputs."""
        return int(self.B.shape[1])

    @property
    def outputs(self) -> int:
        """The number m of outputs."""
        return len(self.C)


def as_matrices(name: str, value: ArrayLike, shape: tuple[int, ...], rows: int) -> Array:
    """A matrix, shape (1, ., .), or one for each row, (k, ., .).

    Raises
    ------
    InputError
        If it is neither, or not finite.
    """
    array = as_floats(name, value)
    if array.shape == shape:
        return array[None]
    if array.shape != (rows, *shape):
        raise InputError(name, f"has shape {array.shape}, must be {shape} or {(rows, *shape)}")
    return array


def _check_discrete(A: Array) -> None:
    """Refuse what can hardly be the transition of a sampled system."""
    eigenvalues = np.linalg.eigvals(A)
    outside = eigenvalues[(eigenvalues.real < 0) & (np.abs(eigenvalues) > 1)]
    if np.all(eigenvalues.real <= 0) or outside.size:
        suspect = outside[0] if outside.size else eigenvalues[np.argmin(eigenvalues.real)]
        shown = suspect if suspect.imag else suspect.real
        raise InputError(
            "A",
            f"has the eigenvalue {shown:.4g}, as A of continuous time has; it must be the "
            "transition over one sample (sample it by zero_order_hold, or say check=False)",
        )

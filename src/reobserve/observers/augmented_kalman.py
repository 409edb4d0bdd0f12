"""A Kalman filter that estimates unknown inputs along with the state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.covariances import as_covariance, as_covariances
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_sized, as_vector
from reobserve.observers.gaussian_filter import KEPT
from reobserve.observers.gaussian_state import FilterRows, KalmanState, PredictedRows
from reobserve.observers.kalman import KALMAN, TAKES, LinearFilter
from reobserve.observers.run import AxisNames
from reobserve.synthesis.linear_gain import undetectable_modes
from reobserve.systems.linear import LinearModel, ModelArrays, as_matrices
from reobserve.systems.signal_names import as_names

Array = NDArray[np.float64]

CROSS = "state_unknown_input_covariance"


def as_fault_matrices(model: LinearModel, E: ArrayLike, F: ArrayLike | None) -> tuple[Array, Array]:
    """E, shape (n, q), and F, (m, q), zero if it is None.

    Raises
    ------
    InputError
        If a shape does not fit the model, or there is no fault.
    """
    E = as_sized("fault_matrix", E)
    if E.ndim != 2 or len(E) != model.states or not E.size:
        problem = f"has shape {E.shape}, must be ({model.states}, q), as A has so many rows"
        raise InputError("fault_matrix", problem)
    wanted = (model.outputs, E.shape[1])
    F = np.zeros(wanted) if F is None else as_sized("output_fault_matrix", F)
    if F.shape != wanted:
        raise InputError("output_fault_matrix", f"has shape {F.shape}, must be {wanted}")
    return E, F


@dataclass(frozen=True, eq=False, repr=False)
class AugmentedKalmanFilter(LinearFilter):
    """Kalman filter on the state and q unknown inputs: disturbances, faults and biases d.

        x(k+1) = A x(k) + B u(k) + E d(k) + w(k)
        d(k+1) = d(k) + n(k)                            n ~ N(0, W)
        y(k)   = C x(k) + D u(k) + F d(k) + v(k)

    The unknown inputs are taken for random walks (Friedland 1969): the filter is `KalmanFilter` on
    the state [x, d]. The greater W, the faster its estimates follow, and the noisier they are. A d
    that acts through E alone is seen one sample later.

    `init` takes mean and covariance of x and of d; `run` and `step` take what `KalmanFilter` takes,
    with matrices of the plant, but no uneven times. Estimates, in units of the model: ``state``, x,
    shape (k, n), ``variance``, (k, n), and ``covariance``, (k, n, n); ``unknown_input``, d, (k, q),
    ``unknown_input_variance``, (k, q), and ``unknown_input_covariance``, (k, q, q); ``innovation``,
    (k, m), ``innovation_covariance``, (k, m, m), and ``log_likelihood``, (k,). ``keep`` may also
    name ``state_unknown_input_covariance``, (k, n, q); its predictions and the gain are of [x, d].

    Parameters
    ----------
    model
        The linear model of the plant without them.
    fault_matrix
        E, shape (n, q): what each unknown input adds to the state in a sampling period.
    random_walk
        W, the covariance that the unknown inputs gain in a second: a number, q numbers or (q, q).
    output_fault_matrix
        F, shape (m, q): what it adds to the measurement, zero if left out.
    unknown_input_names
        With which runs are labelled; left out, they are numbered.
    gate, outliers, noise_memory
        As those of `KalmanFilter`.

    Raises
    ------
    InputError
        If the shapes do not fit, W is no covariance, or a mode of [x, d] that does not decay is
        unobservable: two unknown inputs, say, that do the same.

    Examples
    --------
    >>> from reobserve import AugmentedKalmanFilter, LinearModel
    >>> model = LinearModel([[0.9]], C=[[1]], Q=1e-4, R=1e-4)
    >>> observer = AugmentedKalmanFilter(model, fault_matrix=[[1]], random_walk=1e-3)
    >>> run = observer.run([0, 0, 0, 0, 0.2, 0.38, 0.54, 0.69], start=observer.init([0], 0.1))
    >>> print(run["unknown_input"][-1, 0].round(1))
    0.2
    """

    model: LinearModel
    _: KW_ONLY
    fault_matrix: Array
    random_walk: Array
    output_fault_matrix: Array = None  # type: ignore[assignment]  # zeros, once it is made
    unknown_input_names: tuple[str, ...] | None = None

    method = KALMAN
    has_kalman_gain: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = (*TAKES, "S")
    keeps: ClassVar[tuple[str, ...]] = (*KEPT, CROSS)
    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        (*LinearFilter.units, "unknown_input", "unknown_input_variance",
         "unknown_input_covariance"), "",
    )  # fmt: skip

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            model: LinearModel,
            *,
            fault_matrix: ArrayLike,
            random_walk: ArrayLike,
            output_fault_matrix: ArrayLike | None = ...,
            unknown_input_names: Sequence[str] | None = ...,
            gate: float | None = ...,
            outliers: Literal["skip", "inflate"] = ...,
            noise_memory: float | None = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        model, put = as_kind("model", self.model, LinearModel), self._set
        E, F = as_fault_matrices(model, self.fault_matrix, self.output_fault_matrix)
        put("fault_matrix", E)
        put("output_fault_matrix", F)
        put("random_walk", as_covariance("random_walk", self.random_walk, E.shape[1]))
        names = as_names("unknown_input_names", self.unknown_input_names, E.shape[1])
        put("unknown_input_names", names)
        put("sampling_period", model.sampling_period)
        unobservable = undetectable_modes(self.whole.A, self.whole.C)
        if len(unobservable):
            raise InputError(
                "fault_matrix",
                "leaves a mode of state and unknown inputs unobservable that does not decay, of "
                f"the eigenvalue {unobservable[0]:.4g}",
            )
        self._set_rules()

    @property
    def unknown_inputs(self) -> int:
        """The number q of unknown inputs."""
        return int(self.fault_matrix.shape[1])

    @cached_property
    def whole(self) -> LinearModel:
        """The model of [x, d]."""
        whole = self._given({name: getattr(self.model, name) for name in ModelArrays._fields}, 1)
        matrices = {name: matrix.reshape(matrix.shape[-2:]) for name, matrix in whole.items()}
        model = LinearModel(**matrices, check=False, sampling_period=self.sampling_period)
        model._set("state_names", self._all_names)
        model._set("output_names", self.model.output_names)
        model._set("output_periods", self.model.output_periods)
        if self.model.state_periods is not None:
            none = np.zeros(self.unknown_inputs)
            model._set("state_periods", np.concatenate([self.model.state_periods, none]))
        return model

    @cached_property
    def component_names(self) -> Mapping[str, AxisNames]:
        """Names of components of estimates."""
        names, d = dict(super().component_names), self.unknown_input_names
        if d is not None:
            x = self.model.state_names
            names |= {"unknown_input": (d,), "unknown_input_variance": (d,), CROSS: (x, d)}
            names["unknown_input_covariance"] = (d, d)
        return names

    @property
    def _all_names(self) -> tuple[str, ...] | None:
        x, d = self.model.state_names, self.unknown_input_names
        return None if x is None or d is None else x + d

    @property
    def _uneven_hint(self) -> str:
        return "; for other times give from_ode the matrices of [x, d], for a Kalman filter"

    def _given(self, given: Mapping[str, Any], rows: int) -> dict[str, Any]:
        (n, q), T = self.fault_matrix.shape, self.sampling_period
        zeros, matrices = np.zeros, dict(given)
        # [A E; 0 I], [B; 0], [C F], diag(Q, T W), [S; 0]
        for name, right, below in (
            ("A", self.fault_matrix, np.hstack([zeros((q, n)), np.eye(q)])),
            ("B", None, zeros((q, self.model.inputs))),
            ("C", self.output_fault_matrix, None),
            ("Q", zeros((n, q)), np.hstack([zeros((q, n)), T * self.random_walk])),
            ("S", None, zeros((q, self.model.outputs))),
        ):
            if name not in given:
                continue
            if name == "Q":
                matrix = as_covariances(name, given[name], n, rows)
            else:
                own = (n, self.model.outputs) if name == "S" else getattr(self.model, name).shape
                matrix = as_matrices(name, given[name], own, rows)
            for axis, piece in ((2, right), (1, below)):
                if piece is not None:
                    more = np.broadcast_to(piece, (len(matrix), *piece.shape))
                    matrix = np.concatenate([matrix, more], axis=axis)
            matrices[name] = matrix if len(matrix) == rows else matrix[0]
        return matrices

    def init(
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        unknown_input: ArrayLike | None = None,
        unknown_input_covariance: ArrayLike = 1.0,
        u: ArrayLike | None = None,
    ) -> KalmanState:
        """The state before the first row of a record.

        Parameters
        ----------
        mean, covariance, u
            Of the state, and the input, as `GaussianFilter.init`.
        unknown_input
            Its mean, shape (q,); left out, zeros.
        unknown_input_covariance
            A number, q numbers or (q, q).
        """
        n, q = self.model.states, self.unknown_inputs
        d = np.zeros(q) if unknown_input is None else as_vector("unknown_input", unknown_input, q)
        spread = np.zeros((n + q, n + q))
        spread[:n, :n] = as_covariance("covariance", covariance, n)
        spread[n:, n:] = as_covariance("unknown_input_covariance", unknown_input_covariance, q)
        return super().init(np.concatenate([as_vector("mean", mean, n), d]), spread, u=u)

    def _by_name(
        self, rows: FilterRows, kept: PredictedRows | None, keep: Sequence[str]
    ) -> dict[str, Array]:
        n = self.model.states
        cross = [CROSS] if CROSS in keep else []
        estimates = super()._by_name(rows, kept, [name for name in keep if name != CROSS])
        whole, variance, covariance = (
            estimates.pop(name) for name in ("state", "variance", "covariance")
        )
        return {
            "state": whole[..., :n],
            "unknown_input": whole[..., n:],
            "variance": variance[..., :n],
            "unknown_input_variance": variance[..., n:],
            "covariance": covariance[..., :n, :n],
            "unknown_input_covariance": covariance[..., n:, n:],
            **dict.fromkeys(cross, covariance[..., :n, n:]),
            **estimates,
        }

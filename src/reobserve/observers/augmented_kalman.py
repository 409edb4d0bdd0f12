"""A Kalman filter that estimates unknown inputs along with the state.

    x(k+1) = A x(k) + B u(k) + E d(k) + w(k)
    d(k+1) = d(k) + n(k)                            n ~ N(0, W)
    y(k)   = C x(k) + D u(k) + F d(k) + v(k)

Disturbances, faults and biases d are taken for random walks (Friedland 1969): the filter is that of
`reobserve.observers.kalman` on the state [x, d]. The greater W, the faster its estimates follow,
and the noisier they are. A d that acts through E alone is seen one sample later.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, as_vector
from reobserve.observers.contract import Record, Rows
from reobserve.observers.gaussian_filter import KalmanState, NoiseByRow, as_covariances
from reobserve.observers.kalman import KalmanFilter
from reobserve.synthesis.linear import undetectable_modes
from reobserve.systems.linear import LinearModel, as_covariance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class AugmentedKalmanFilter(NoiseByRow):
    """The Kalman filter on the state and q unknown inputs.

    Its estimates are ``state``, shape (k, n), and ``unknown_input``, (k, q); ``variance`` and
    ``unknown_input_variance`` in their shapes; ``covariance``, (k, n, n), and
    ``unknown_input_covariance``, (k, q, q); and ``innovation``, ``innovation_covariance`` and
    ``log_likelihood`` as those of `reobserve.observers.linear_filter.LinearFilter`.

    Parameters
    ----------
    model
        The linear model of the plant without them.
    fault_matrix
        E, shape (n, q): what each unknown input adds to the state in a sampling period.
    random_walk
        W, the covariance of what an unknown input gains a sample: a number, q numbers or (q, q).
    output_fault_matrix
        F, shape (m, q): what it adds to the measurement, zero if left out.

    Raises
    ------
    InputError
        If the shapes do not fit, W is no covariance, or a mode of [x, d] that does not decay is
        unobservable: two unknown inputs, say, that do the same.
    """

    model: LinearModel
    fault_matrix: Array
    random_walk: Array
    output_fault_matrix: Array = None  # type: ignore[assignment]  # zeros, once it is made
    sampling_period: float = field(init=False)

    reads_between: ClassVar[bool] = False
    reads_missing: ClassVar[bool] = True
    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        (
            "state",
            "unknown_input",
            "variance",
            "unknown_input_variance",
            "covariance",
            "unknown_input_covariance",
            "innovation",
            "innovation_covariance",
            "log_likelihood",
        ),
        "",
    )

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            model: LinearModel,
            fault_matrix: ArrayLike,
            random_walk: ArrayLike,
            output_fault_matrix: ArrayLike | None = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        model, put = as_kind("model", self.model, LinearModel), self._set
        E = as_floats("fault_matrix", self.fault_matrix)
        if E.ndim != 2 or len(E) != model.states or not E.size:
            problem = f"has shape {E.shape}, must be ({model.states}, q), as A has so many rows"
            raise InputError("fault_matrix", problem)
        wanted = (model.outputs, E.shape[1])
        given: Any = self.output_fault_matrix
        F = np.zeros(wanted) if given is None else as_floats("output_fault_matrix", given)
        if F.shape != wanted:
            raise InputError("output_fault_matrix", f"has shape {F.shape}, must be {wanted}")
        put("fault_matrix", E)
        put("output_fault_matrix", F)
        put("random_walk", as_covariance("random_walk", self.random_walk, E.shape[1]))
        put("sampling_period", model.sampling_period)
        unobservable = undetectable_modes(self._kalman.model.A, self._kalman.model.C)
        if len(unobservable):
            raise InputError(
                "fault_matrix",
                "leaves a mode of state and unknown inputs unobservable that does not decay, of "
                f"the eigenvalue {unobservable[0]:.4g}",
            )

    @property
    def measurements(self) -> int:
        """How many numbers a row of y has."""
        return self.model.outputs

    @property
    def inputs(self) -> int:
        """How many numbers a row of u has."""
        return self.model.inputs

    @property
    def unknown_inputs(self) -> int:
        """Their number q."""
        return int(self.fault_matrix.shape[1])

    @cached_property
    def _kalman(self) -> KalmanFilter:
        """The filter of [x, d]."""
        A, B, C, D, Q, R = self.model.arrays
        n, q = self.fault_matrix.shape
        whole = np.block([[A, self.fault_matrix], [np.zeros((q, n)), np.eye(q)]])
        noise = np.block([[Q, np.zeros((n, q))], [np.zeros((q, n)), self.random_walk]])
        model = LinearModel(
            whole, np.vstack([B, np.zeros((q, B.shape[1]))]),
            np.hstack([C, self.output_fault_matrix]), D, noise, R,
            check=False, sampling_period=self.sampling_period,
        )  # fmt: skip
        return KalmanFilter(model)

    def init(
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        unknown_input: ArrayLike | None = None,
        unknown_input_covariance: ArrayLike = 1.0,
        *,
        u: ArrayLike | None = None,
    ) -> KalmanState:
        """The state before the first row of a record.

        Parameters
        ----------
        mean, covariance, u
            Of the state, and the input, as `reobserve.observers.linear_filter.LinearFilter.init`.
        unknown_input
            Its mean, shape (q,); left out, zeros.
        unknown_input_covariance
            A number, q numbers or (q, q).

        Raises
        ------
        InputError
            If one of them is not that.
        """
        n, q = self.model.states, self.unknown_inputs
        d = np.zeros(q) if unknown_input is None else as_vector("unknown_input", unknown_input, q)
        spread = np.zeros((n + q, n + q))
        spread[:n, :n] = as_covariance("covariance", covariance, n)
        spread[n:, n:] = as_covariance("unknown_input_covariance", unknown_input_covariance, q)
        return self._kalman.init(np.concatenate([as_vector("mean", mean, n), d]), spread, u=u)

    def _with_noise(self, Q: ArrayLike | None, R: ArrayLike | None, rows: int) -> Self:
        """The same filter with other noise, for one record."""
        if Q is None and R is None:
            return self
        noise, n, q = None, self.model.states, self.unknown_inputs
        if Q is not None:
            of_state = as_covariances("Q", Q, n, rows)
            noise = np.zeros((len(of_state), n + q, n + q))
            noise[:, :n, :n], noise[:, n:, n:] = of_state, self.random_walk
            noise = noise if len(noise) == rows else noise[0]
        other = copy(self)
        vars(other)["_kalman"] = self._kalman._with_noise(noise, R, rows)
        return other

    def innovation_deviation(self, state: KalmanState) -> Array:
        """As `reobserve.observers.linear_filter.LinearFilter.innovation_deviation`."""
        return self._kalman.innovation_deviation(state)

    def _checked(self, state: Any) -> KalmanState:
        return self._kalman._checked(state)

    def _fill(self, state: KalmanState, record: Record) -> Rows:
        found, n = self._kalman._fill(state, record), self.model.states
        whole, variance = found.estimates["state"], found.estimates["variance"]
        covariance = found.estimates["covariance"]
        estimates = {
            "state": whole[:, :n],
            "unknown_input": whole[:, n:],
            "variance": variance[:, :n],
            "unknown_input_variance": variance[:, n:],
            "covariance": covariance[:, :n, :n],
            "unknown_input_covariance": covariance[:, n:, n:],
            **{
                name: found.estimates[name]
                for name in ("innovation", "innovation_covariance", "log_likelihood")
            },
        }
        return Rows(estimates, found.finite, found.state)

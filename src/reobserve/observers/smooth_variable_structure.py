"""Smooth variable structure filter with a covariance (Gadsden et al. 2011, (11) to (18)).

The paper prints (15) without the pseudo-inverse, which only fits as many outputs as states. With
fewer outputs there are other right inverses of C. The pseudo-inverse corrects what the outputs see
and depends on the coordinates of the state; that weighted by the covariance, P C' (C P C')^-1, is
the same in all of them and corrects the rest by its correlation with what is seen.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_word
from reobserve.core.errors import InputError, shown
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.core.matrices import as_floats, as_scalar, as_vector
from reobserve.observers.kalman import TAKES, Gain, LinearFilter, own_gain_function
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

INVERSES = ("pseudo", "weighted")


@dataclass(frozen=True, eq=False, repr=False)
class SmoothVariableStructureFilter(LinearFilter):
    """Filter whose gain switches with the innovation, smoothed within a boundary layer (SVSF).

        K = C^+ diag((|e(k+1|k)| + gamma |e(k|k)|) o sat(e(k+1|k) / psi)) diag(e(k+1|k))^-1
          = C^+ diag((|e(k+1|k)| + gamma |e(k|k)|) / max(|e(k+1|k)|, psi))

    Gadsden et al. 2011, (4) and (15). The second form divides by no innovation that may be zero.
    Outside the boundary layer the a posteriori output error of a square, regular C is
    -sign(e(k+1|k)) gamma |e(k|k)|: it contracts by gamma a sample. Far inside it the gain vanishes,
    and the filter is the open-loop model.

    `init` takes mean and covariance; `run` and `step` take y, shape (k, m), nan where missing, and
    u, (k, p), and by name A, B, D, Q, R and ``keep``, see `run`. Estimates, in units of
    the model: ``state``, shape (k, n), ``covariance``, (k, n, n), and its diagonal ``variance``,
    (k, n); ``innovation``, e(k+1|k), (k, m), ``innovation_covariance``, (k, m, m), and
    ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The linear model of the plant; its Q and R enter the covariance and the likelihood, and
        not the gain.
    boundary_layer
        psi: one width for all outputs, or m widths [units of the outputs].
    convergence_rate
        gamma, from 0 to below 1.
    inverse
        One of `INVERSES`, for C^+: ``pseudo``, or ``weighted`` by the predicted covariance.
    gate, outliers
        As those of `KalmanFilter`.
    noise_memory
        Left out: R is estimated with Kalman's gain alone.

    Raises
    ------
    InputError
        If psi is not positive, gamma not in [0, 1), there is no such inverse, or C has more rows
        than independent columns, so that no gain can bring every output error to zero.

    Examples
    --------
    >>> from reobserve import LinearModel, SmoothVariableStructureFilter
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2, sampling_period=0.1)
    >>> svsf = SmoothVariableStructureFilter(model, boundary_layer=0.5, convergence_rate=0.1)
    >>> run = svsf.run([0.0, 0.11, 0.19, 0.29], start=svsf.init([0.2, 1.0], 1.0))
    >>> print(run["state"][-1].round(3))
    [0.356 1.   ]
    """

    model: LinearModel
    _: KW_ONLY
    boundary_layer: Array
    convergence_rate: float
    inverse: str = "pseudo"

    takes: ClassVar[tuple[str, ...]] = tuple(name for name in TAKES if name != "C")

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            model: LinearModel,
            *,
            boundary_layer: ArrayLike,
            convergence_rate: float,
            inverse: str = ...,
            gate: float | None = ...,
            outliers: Literal["skip", "inflate"] = ...,
            noise_memory: None = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        super().__post_init__()
        m = self.model.outputs
        psi = as_floats("boundary_layer", self.boundary_layer)
        psi = np.full(m, float(psi)) if psi.ndim == 0 else as_vector("boundary_layer", psi, m)
        if psi.min() <= 0:
            raise InputError(
                "boundary_layer", f"{shown(psi.tolist())} must all be greater than zero"
            )
        gamma = as_scalar("convergence_rate", self.convergence_rate)
        if not 0 <= gamma < 1:
            raise InputError("convergence_rate", f"{gamma:g} must be from 0 to below 1")
        as_word("inverse", self.inverse, INVERSES)
        rank = int(np.linalg.matrix_rank(self.model.arrays.C))
        if rank < m:
            raise InputError(
                "model", f"C has {m} rows but rank {rank}: no gain corrects all outputs at once"
            )
        self._set("boundary_layer", psi)
        object.__setattr__(self, "convergence_rate", gamma)

    @cached_property
    def method(self) -> Gain:
        """The switching gain, with a right inverse of C (Gadsden et al. 2011, (15)).

        Its parameters are gamma, psi, and the pseudo-inverse of C, or C itself, row by row.
        """
        C, pseudo = self.model.arrays.C, self.inverse == "pseudo"
        matrix = np.linalg.pinv(C) if pseudo else C
        function = _switching_gain if pseudo else _weighted_gain
        rate = np.array([self.convergence_rate])
        parameters = np.concatenate([rate, self.boundary_layer, matrix.ravel()])
        return Gain(function.compiled, parameters)


@inlined_kernel
def _switching(innovation: Array, error: Array, parameters: Array, o: int) -> float:
    """The share of an output's innovation that is corrected."""
    # (|e(k+1|k)| + gamma |e(k|k)|) / max(|e(k+1|k)|, psi)
    gamma, size = parameters[0], abs(innovation[o])
    share: float = (size + gamma * abs(error[o])) / max(size, parameters[1 + o])
    return share


@own_gain_function
def _switching_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    """(15) in its form without division by the innovation."""
    n, m = gain.shape
    # K = C^+ diag(share)
    for o in range(m):
        share = _switching(innovation, error, parameters, o)
        for a in range(n):
            gain[a, o] = parameters[1 + m + a * m + o] * share


@kernel
def _take_output_root(cross: Array, parameters: Array, root: Array) -> None:
    """Write the lower Cholesky factor of the outputs' covariance."""
    n, m = cross.shape
    # L L' = C P C', row by row
    for o in range(m):
        for q in range(o + 1):
            total = 0.0
            for a in range(n):
                total += parameters[1 + m + o * n + a] * cross[a, q]
            for i in range(q):
                total -= root[o, i] * root[q, i]
            if o == q:
                root[o, o] = math.sqrt(total) if total > 0.0 else math.nan
            else:
                root[o, q] = total / root[q, q]


@own_gain_function
def _weighted_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    """(15) with the inverse that is weighted by the predicted covariance."""
    n, m = gain.shape
    root = np.empty((m, m))
    _take_output_root(cross, parameters, root)
    # C^+ = P C' (C P C')^-1
    for a in range(n):
        # Z L' = P C'
        for o in range(m):
            total = cross[a, o]
            for i in range(o):
                total -= root[o, i] * gain[a, i]
            gain[a, o] = total / root[o, o]
        # C^+ L = Z
        for back in range(m):
            o = m - 1 - back
            total = gain[a, o]
            for i in range(o + 1, m):
                total -= root[i, o] * gain[a, i]
            gain[a, o] = total / root[o, o]
    # K = C^+ diag(share)
    for o in range(m):
        share = _switching(innovation, error, parameters, o)
        for a in range(n):
            gain[a, o] *= share

r"""The error equation of the learning observer, linearised at rest (Chen & Saif 2007, (4)).

Without the gyroscopic torque, the estimation errors of (3) and (4) of the paper are

.. math:: J\dot{\tilde w} = -\Lambda\tilde w - B_f v, \qquad v(t) = K_1 v(t-\tau) + K_2\tilde w(t)

for a zero fault. Read as written this is a neutral-type delay system (`ilo_stability`); with ``v``
updated every ``update_interval`` and held in between it is a linear map (`ilo_sampled_stability`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.covariances import as_positive_definite
from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, as_floats, as_matrix, as_positive

Verdict = Literal["stable", "marginal", "unstable"]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class LearningLaw:
    """An observer's model of a body and its learning law: all that the error equation has.

    Chen & Saif 2007, (4).

    A number or a diagonal stands for a matrix (see `as_matrix`); all are n x n in the end.

    Parameters
    ----------
    inertia
        J [kg m2], symmetric positive definite.
    observer_gain
        Lambda [N m s], which must make the observer without learning stable.
    fault_matrix
        B_f [-].
    K1, K2
        Learning gains [-] and [N m s].
    update_interval
        tau [s].

    Raises
    ------
    InputError
        If ``inertia`` is not symmetric positive definite, ``update_interval`` is not above zero, a
        shape differs, or -J^-1 Lambda is not stable.
    """

    inertia: Matrix
    observer_gain: Matrix
    fault_matrix: Matrix
    K1: Matrix
    K2: Matrix
    update_interval: float

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            inertia: ArrayLike,
            observer_gain: ArrayLike,
            fault_matrix: ArrayLike,
            K1: ArrayLike,
            K2: ArrayLike,
            update_interval: float,
        ) -> None: ...

    def __post_init__(self) -> None:
        put = object.__setattr__
        size = (as_floats("inertia", self.inertia).shape or (1,))[0]
        put(self, "inertia", as_positive_definite("inertia", self.inertia, size))
        for name in ("observer_gain", "fault_matrix", "K1", "K2"):
            put(self, name, as_matrix(name, getattr(self, name), size))
        put(self, "update_interval", as_positive("update_interval", self.update_interval))
        with np.errstate(all="ignore"):
            rates = self.rate_matrix
        if not np.isfinite(rates).all():
            raise InputError(
                "inertia, observer_gain", "make error dynamics too fast for floating-point numbers"
            )
        slowest = float(np.max(np.linalg.eigvals(rates).real))
        if slowest >= 0:
            raise InputError(
                "observer_gain",
                f"-J^-1 Lambda has an eigenvalue with real part {slowest:g}, must be below 0",
            )

    @property
    def rate_matrix(self) -> Matrix:
        """The dynamics of the rate error without learning, -J^-1 Lambda [1/s]."""
        return np.asarray(-np.linalg.solve(self.inertia, self.observer_gain), dtype=np.float64)

    def loop(self, s: ArrayLike) -> Complex:
        """K2 (J s + Lambda)^-1 B_f for every complex frequency ``s`` [rad/s], shape (..., n, n)."""
        frequency = np.asarray(s, dtype=np.complex128)[..., None, None]
        response = solved(frequency * self.inertia + self.observer_gain, self.fault_matrix)
        return np.asarray(self.K2 @ response, dtype=np.complex128)

    def memory(self, s: ArrayLike) -> Complex:
        """I - K1 exp(-s tau) for every complex frequency ``s`` [rad/s], shape (..., n, n)."""
        delay = np.exp(-np.asarray(s, dtype=np.complex128) * self.update_interval)[..., None, None]
        return np.asarray(np.eye(len(self.K1)) - self.K1 * delay, dtype=np.complex128)


def solved(matrix: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """matrix^-1 right, of stacks of matrices.

    Raises
    ------
    InputError
        If there is no such thing in floats, as for gains of many orders of magnitude.
    """
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        raise InputError("K1, K2", "make error dynamics beyond floating-point numbers") from None

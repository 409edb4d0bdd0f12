"""Rigid-body rotation: the model that plants and observers share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.covariances import as_positive_definite
from reobserve.core.matrices import Matrix, as_matrix
from reobserve.core.value import Value, converter


@dataclass(frozen=True, eq=False, repr=False)
class RigidBody(Value):
    """Rotation of a rigid body under control and fault torques (Chen & Saif 2007, (1) and (2)).

        J w' = -w x J w + B u + B_f u_f

    Parameters
    ----------
    inertia
        J [kg m^2], a diagonal or 3 x 3, symmetric but for rounding, and positive definite.
    input_matrix, fault_matrix
        B and B_f [1]: a number (times the identity), a diagonal or 3 x 3.

    Raises
    ------
    InputError
        If a shape is wrong or J is not symmetric positive definite.

    Examples
    --------
    >>> from reobserve import RigidBody
    >>> RigidBody(inertia=[36.0, 17.0, 26.0])  # [kg m^2], a diagonal
    RigidBody(inertia=diag(36, 17, 26), input_matrix=diag(1, 1, 1), fault_matrix=diag(1, 1, 1))
    """

    inertia: Matrix = field(metadata=converter(as_positive_definite, 3))
    input_matrix: Matrix = field(
        default_factory=lambda: np.eye(3), metadata=converter(as_matrix, 3)
    )
    fault_matrix: Matrix = field(
        default_factory=lambda: np.eye(3), metadata=converter(as_matrix, 3)
    )

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self, inertia: ArrayLike, input_matrix: ArrayLike = ..., fault_matrix: ArrayLike = ...
        ) -> None: ...

    @property
    def inverse(self) -> Matrix:
        """The inverse of J [1/(kg m^2)]."""
        inverse: Matrix = np.ascontiguousarray(np.linalg.inv(self.inertia))
        return inverse

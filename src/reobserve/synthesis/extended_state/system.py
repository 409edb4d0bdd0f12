"""The plant with faults, augmented by filtered outputs and the faults.

Indriawati, Agustinah & Jazidie, (1) to (16):

    x' = A x + B u + Dd d + Fa fa,    y = C x + Dw w + Fs fs                        (1), (2)
    xz' = Az (y - xz)                                                               (3)

The filter makes a sensor fault enter like an actuator fault. With X = [x, xz] and f = [fa, fs]

    X' = Aa X + Ba u + F f + Da da,    Y = Ca X = xz,    da = [d, w].               (7)

A constant fault is a state: with [X, f] the error e of the observer (8) obeys

    Eo e' = Ao e + Bo dD,    Ao = A~ - L C~,    Eo = I + Ld C~,    dD = [d, w, f'].     (10) to (16)

The lower block of F is +Az Fs; (3) and (7) print a minus, which turns the sign of the estimated
sensor fault. (7) has Az = I.

Gains that make (10) stable exist if and only if (A~, C~) is detectable. At any s but zero that is
the detectability of (A, C). At s = 0 it asks that no constant x and f go together without being
seen: that the Rosenbrock matrix [A Fa 0; C 0 Fs] has full column rank, which takes p >= r + q. The
observability of (A, C), which the paper asks for, is not enough.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, as_floats, as_matrix
from reobserve.core.value import Value

_RANK = 1e-10  # of the largest singular value: a smaller one counts as zero
_SCALINGS = 20  # each takes the square root of how far the units are apart


@dataclass(frozen=True, eq=False, repr=False)
class AugmentedSystem(Value):
    """A plant with the filter, whose constant faults are observable from its output.

    Indriawati, Agustinah & Jazidie, (1) to (5) and (7).

    Parameters
    ----------
    A, B, C
        Shapes (n, n), (n, m) and (p, n).
    Dd, Dw
        How disturbances enter the dynamics, shape (n, kd), and noise the output, shape (p, kw).
    Fa, Fs
        How r actuator faults enter the dynamics, shape (n, r), and q sensor faults the output,
        shape (p, q). Like B, Dd and Dw they may have no column, but one fault there must be.
    Az
        Rates of the filter [1/s]: a number (times the identity), a diagonal or shape (p, p).

    Raises
    ------
    InputError
        If shapes do not fit, the filter is not stable, outputs are fewer than faults, a
        combination of faults has no effect, (A, C) is not detectable, or there is a zero at the
        origin.

    Examples
    --------
    >>> from reobserve.synthesis.extended_state.system import AugmentedSystem
    >>> motor = AugmentedSystem(
    ...     A=[[-10, 1], [-0.02, -2]], B=[[0], [2]], C=[[1, 0], [0, 1]], Dd=[[1, 0], [0, 2]],
    ...     Dw=[[1], [0]], Fa=[[0], [2]], Fs=[[1], [0]],
    ... )
    >>> print(motor.size)  # x, xz, fa and fs
    6
    """

    A: Matrix
    B: Matrix
    C: Matrix
    Dd: Matrix
    Dw: Matrix
    Fa: Matrix
    Fs: Matrix
    Az: Matrix = field(default_factory=lambda: np.array(1.0))

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self,
            A: ArrayLike,
            B: ArrayLike,
            C: ArrayLike,
            Dd: ArrayLike,
            Dw: ArrayLike,
            Fa: ArrayLike,
            Fs: ArrayLike,
            Az: ArrayLike = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        for name in [each.name for each in fields(self)][:-1]:
            object.__setattr__(self, name, as_floats(name, getattr(self, name)))
        _check_shapes(self)
        object.__setattr__(self, "Az", as_matrix("Az", self.Az, self.outputs))
        _check_reconstruction(self)
        super().__post_init__()

    @property
    def states(self) -> int:
        """n, the states of the plant."""
        return len(self.A)

    @property
    def outputs(self) -> int:
        """p."""
        return len(self.C)

    @property
    def faults(self) -> int:
        """r + q."""
        return int(self.Fa.shape[1] + self.Fs.shape[1])

    @property
    def size(self) -> int:
        """N = n + p + r + q, the states of the observer."""
        return self.states + self.outputs + self.faults

    @cached_property
    def Aa(self) -> Matrix:
        """[A 0; Az C, -Az], shape (n + p, n + p)."""
        upper = np.zeros((self.states, self.outputs))
        return np.block([[self.A, upper], [self.Az @ self.C, -self.Az]])

    @cached_property
    def Ba(self) -> Matrix:
        """[B; 0], shape (n + p, m)."""
        return np.vstack([self.B, np.zeros((self.outputs, self.B.shape[1]))])

    @cached_property
    def F(self) -> Matrix:
        """blkdiag(Fa, Az Fs), shape (n + p, r + q)."""
        return _diagonal(self.Fa, self.Az @ self.Fs)

    @cached_property
    def Da(self) -> Matrix:
        """blkdiag(Dd, Az Dw), shape (n + p, kd + kw)."""
        return _diagonal(self.Dd, self.Az @ self.Dw)

    @cached_property
    def A_tilde(self) -> Matrix:
        """[Aa F; 0 0], shape (N, N) (Indriawati, Agustinah & Jazidie, (12))."""
        faults = self.faults
        below = np.zeros((faults, self.size))
        return np.vstack([np.hstack([self.Aa, self.F]), below])

    @cached_property
    def C_tilde(self) -> Matrix:
        """[Ca 0] = [0 I 0], shape (p, N) (Indriawati, Agustinah & Jazidie, (13))."""
        return np.eye(self.outputs, self.size, self.states)

    @cached_property
    def Bo(self) -> Matrix:
        """blkdiag(Da, I), shape (N, kd + kw + r + q) (Indriawati, Agustinah & Jazidie, (10))."""
        return _diagonal(self.Da, np.eye(self.faults))


@dataclass(frozen=True, eq=False, repr=False)
class Gains(Value):
    """Gains of an observer, whose rows belong to x, xz, fa and fs, in this order.

    Indriawati, Agustinah & Jazidie, (8), (14) and (16).

    Parameters
    ----------
    L
        Of the output's error, [Lx; Lf] (14), shape (N, p).
    Ld
        Of the error's derivative, [LXd; Lfd] (16), shape (N, p); zero in the PI observer (6).
    """

    L: Matrix
    Ld: Matrix


def _diagonal(upper: Matrix, lower: Matrix) -> Matrix:
    (rows, columns), (more_rows, more_columns) = upper.shape, lower.shape
    right, left = np.zeros((rows, more_columns)), np.zeros((more_rows, columns))
    return np.block([[upper, right], [left, lower]])


def _check_shapes(system: AugmentedSystem) -> None:
    a, c = system.A, system.C
    if a.ndim != 2 or a.shape[0] != a.shape[1] or a.size == 0:
        raise InputError("A", f"has shape {a.shape}, must be square and not empty")
    if c.ndim != 2 or c.shape[1] != len(a) or c.size == 0:
        raise InputError("C", f"has shape {c.shape}, must be (p, {len(a)}) as A is {a.shape}")
    for name in ("B", "Dd", "Fa", "Dw", "Fs"):
        matrix = getattr(system, name)
        like, shape = ("C", c.shape) if name in {"Dw", "Fs"} else ("A", a.shape)
        if matrix.ndim != 2 or len(matrix) != shape[0]:
            raise InputError(
                name, f"has shape {matrix.shape}, must have {shape[0]} rows as {like} is {shape}"
            )


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def _check_reconstruction(system: AugmentedSystem) -> None:
    A, C, Az = system.A, system.C, system.Az
    n, p, r, q = system.states, system.outputs, system.Fa.shape[1], system.Fs.shape[1]
    slowest = np.linalg.eigvals(Az).real.min()
    if slowest <= 0:
        raise InputError(
            "Az", f"has an eigenvalue of real part {slowest:g}, must be above zero: xz' = -Az xz"
        )
    if r + q == 0:
        raise InputError("Fa", "and Fs have no column: there is no fault to reconstruct")
    if p < r + q:
        raise InputError(
            "C",
            f"has {p} row{'s' if p > 1 else ''}: fewer outputs than faults, "
            f"of which Fa has {r} and Fs {q}",
        )
    for name, matrix in (("Fa", system.Fa), ("Fs", system.Fs)):
        if (rank := _rank(matrix)) < matrix.shape[1]:
            raise InputError(
                name, f"has rank {rank}, must have {matrix.shape[1]}: a fault has an effect"
            )
    poles = np.linalg.eigvals(A)
    lasting = -_RANK * np.abs(poles).max()
    for pole in poles:
        if pole.real >= lasting and (rank := _rank(np.vstack([A - pole * np.eye(n), C]))) < n:
            raise InputError(
                "C",
                f"does not see the mode of A with eigenvalue {pole:.6g}, which does not decay: "
                f"[A - sI; C] has rank {rank} of {n}, so (A, C) is not detectable",
            )
    rosenbrock = np.hstack([np.vstack([A, C]), _diagonal(system.Fa, system.Fs)])
    if (rank := _rank(rosenbrock)) < n + r + q:
        raise InputError(
            "Fa",
            f"and Fs have a zero at the origin: [A Fa 0; C 0 Fs] has rank {rank} of {n + r + q}, "
            "so a constant fault cannot be distinguished from none",
        )


def _rank(matrix: Matrix) -> int:
    """The rank, after rows and columns are scaled alike, which makes it free of units."""
    if matrix.size == 0:
        return 0
    for _ in range(_SCALINGS):
        for axis in (1, 0):
            largest = np.abs(matrix).max(axis=axis, keepdims=True)
            matrix = matrix / np.sqrt(np.where(largest > 0, largest, 1.0))
    if not np.isfinite(matrix).all():
        raise InputError("A", "has eigenvalues beyond floating-point numbers")
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > _RANK * values[0]))

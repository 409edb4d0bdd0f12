"""Rigid-body rotation: the compiled arithmetic that plants and observers share."""

from __future__ import annotations

from reobserve.core.kernel import kernel
from reobserve.core.matrices import Matrix

Triple = tuple[float, float, float]


@kernel
def row(samples: Matrix, k: int) -> Triple:
    """Row k of an array of shape (n, 3)."""
    return (samples[k, 0], samples[k, 1], samples[k, 2])


@kernel
def product(matrix: Matrix, x: float, y: float, z: float) -> Triple:
    """A 3 x 3 matrix times the vector (x, y, z)."""
    # A [x, y, z]'
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@kernel
def acceleration(inertia: Matrix, inverse: Matrix, rate: Triple, torque: Triple) -> Triple:
    """Euler's equation J w' = -w x J w + torque, solved for w' [rad/s^2].

    Chen & Saif 2007, (1) and after (1).
    """
    x, y, z = rate
    # w' = J^-1 (torque - w x h),   h = J w
    hx, hy, hz = product(inertia, x, y, z)
    return product(
        inverse,
        torque[0] - (y * hz - z * hy),
        torque[1] - (z * hx - x * hz),
        torque[2] - (x * hy - y * hx),
    )


@kernel
def ahead(rate: Triple, slope: Triple, step: float) -> Triple:
    """The point ``rate + step * slope``: where a Runge-Kutta stage is evaluated."""
    return (rate[0] + step * slope[0], rate[1] + step * slope[1], rate[2] + step * slope[2])


@kernel
def rk4_sum(rate: Triple, k1: Triple, k2: Triple, k3: Triple, k4: Triple, step: float) -> Triple:
    """The end of a classical fourth-order Runge-Kutta step with slopes k1 to k4."""
    # w(t + h) = w(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
    weight = step / 6.0
    return (
        rate[0] + weight * (k1[0] + 2.0 * k2[0] + 2.0 * k3[0] + k4[0]),
        rate[1] + weight * (k1[1] + 2.0 * k2[1] + 2.0 * k3[1] + k4[1]),
        rate[2] + weight * (k1[2] + 2.0 * k2[2] + 2.0 * k3[2] + k4[2]),
    )

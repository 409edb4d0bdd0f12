"""Compiled evaluation of a nonlinear model: one step of its state, and Jacobians."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel, kernel

Array = NDArray[np.float64]

# Of differences: how far apart the slopes over two lengths may be, and the derivatives with two
# steps, over the larger; and what rounding may add, over the function.
ALIKE, AGREE, NOISE = 1e-5, 1e-9, 2e-15
REDUCTIONS = 8  # of the step, by 256 each
LOUD, STRAIGHT = 1e-11, 1e-6  # rounding that asks for a longer step, and what that may bend
PART = 2.0**-10  # of a large deviation, for the size of a state


class Functions(NamedTuple):
    """A nonlinear model as compiled loops read it.

    ``f``, ``F``, ``h`` and ``H`` are pointers to functions ``(x, u, out)``; a Jacobian that is None
    is found by differences, where ``numeric_f`` or ``numeric_h`` is True and not None: numba leaves
    out the branches of what is None. ``substeps`` is the number of Runge-Kutta steps in a sampling
    period; ``scale``, (n,), are typical sizes of the states, zero where they are not known.
    """

    f: Any
    F: Any
    h: Any
    H: Any
    substeps: int
    scale: Array
    numeric_f: bool | None
    numeric_h: bool | None


class NonlinearRows(NamedTuple):
    """A nonlinear model as compiled loops read it, with what may be given by row.

    ``steps`` are the lengths [s] of the Runge-Kutta steps that lead to each row, None where f is
    the next state. ``parts``, (., 2), are how many predictions lead to the row, and in how many of
    them, the last ones, Q is added. Q, (., n, n), leads to the row, R, (., m, m), is its own. The
    last of each holds for all later rows. ``correlation`` is that of `ModelRows`.
    """

    functions: Functions
    steps: Any
    parts: NDArray[np.int64]
    Q: Array
    R: Array
    correlation: Any = None


class FlowWork(NamedTuple):
    """Scratch: points and slopes (n,), values (6, n or m), Jacobians (n, n) and (m, n), also flat.

    ``sizes``, (n,), are those of the states for the steps of differences.

    It is made in Python: to compile the allocation of arrays takes seconds.
    """

    point: Array
    stage_point: Array
    slope: Array
    total: Array
    sizes: Array
    values: Array
    A: Array
    A_flat: Array
    C: Array
    C_flat: Array
    sensitivity: Array
    stage: Array
    slopes: Array
    totals: Array


def new_flow_work(states: int, outputs: int) -> FlowWork:
    """Scratch for a model of this size."""
    n, m = states, outputs
    A, C = np.empty((n, n)), np.empty((m, n))
    vectors, squares = np.empty((5, n)), np.empty((4, n, n))
    return FlowWork(
        vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], np.empty((6, max(n, m))), A,
        A.reshape(-1), C, C.reshape(-1), squares[0], squares[1], squares[2], squares[3],
    )  # fmt: skip


@inlined_kernel
def jacobian(
    function: Any, derivative: Any, numeric: bool | None, x: Array, u: Array, flat: Array,
    work: FlowWork,
) -> None:  # fmt: skip
    """Write the Jacobian of a function, row by row: given, or by central differences.

    f'(x) = (8 (f(x+d) - f(x-d)) - (f(x+2d) - f(x-2d))) / (12 d) + O(d^4), with d between 1/1000 and
    1/500 of the larger of |x| and its size: about twelve digits where f is smooth on that scale.
    Where slopes over 2d and 4d differ it may not be, and d is reduced until two derivatives agree.
    Where f is so large that differences lose digits d is lengthened, as long as f is straight.
    """
    if derivative is not None:
        call(derivative, (x, u, flat))
    if numeric is not None:
        differentiate(function, x, u, flat, work)


@inlined_kernel
def differentiate(function: Any, x: Array, u: Array, flat: Array, work: FlowWork) -> None:
    """Write the Jacobian by central differences."""
    n = len(x)
    rows = len(flat) // n
    point = work.point
    for i in range(n):
        point[i] = x[i]
    for j in range(n):
        # A power of two, so that the differences of x are nearly exact.
        size = max(abs(x[j]), work.sizes[j])
        d = math.ldexp(1.0, math.frexp(size if size > 0.0 else 1.0)[1] - 10)
        differ(function, x[j], j, d, u, work.values, rows, point)
        good, loud = True, False
        for i in range(rows):
            # f'(x) = (8 (f(x+d) - f(x-d)) - (f(x+2d) - f(x-2d))) / (12 d)
            near = work.values[0, i] - work.values[1, i]
            far = work.values[2, i] - work.values[3, i]
            flat[i * n + j] = (8.0 * near - far) / (12.0 * d)
            bend, noise = abs(2.0 * near - far), NOISE * abs(work.values[2, i])
            good = good and bend <= ALIKE * abs(far) + noise
            loud = loud or 0.0 < LOUD * abs(far) < noise
        point[j] = x[j]
        if not good:
            refine(function, x[j], j, d, u, flat, work.values, rows, point)
        elif loud:
            lengthen(function, x[j], j, d, u, flat, work.values, rows, point)


@inlined_kernel
def write_sizes(
    numeric: bool | None, scale: Array, x: Array, covariance: Array, sizes: Array
) -> None:
    """Write sizes of the states for `jacobian`, which do not depend on units.

    Where a typical size is not known the deviation of x is taken, and of one above 1 a part, so
    that after a vague start no function is called far from x.
    """
    if numeric is None:
        return
    for j in range(len(x)):
        sizes[j] = scale[j]
        if scale[j] == 0.0 and covariance[j, j] > 0.0:
            deviation = math.sqrt(covariance[j, j])
            sizes[j] = min(deviation, max(1.0, PART * deviation))


@kernel
def differ(
    function: Any, x: float, j: int, d: float, u: Array, values: Array, rows: int, point: Array
) -> None:
    """Write f at x + d, x - d, x + 2d and x - 2d, where j is the component that moves."""
    for side in range(4):
        point[j] = x + (1.0, -1.0, 2.0, -2.0)[side] * d
        call(function, (point, u, values[side, :rows]))


@kernel
def refine(
    function: Any, x: float, j: int, d: float, u: Array, flat: Array, values: Array, rows: int,
    point: Array,
) -> None:  # fmt: skip
    """Reduce the step until two derivatives agree (one that never does stays as it is)."""
    n = len(point)
    first, done = values[4], values[5]
    for i in range(rows):
        first[i], done[i] = flat[i * n + j], 0.0
    for _ in range(REDUCTIONS):
        d /= 256.0
        if d < 1e-11 * abs(x):
            break
        differ(function, x, j, d, u, values, rows, point)
        left = 0
        for i in range(rows):
            if done[i] == 1.0:
                continue
            near, far = values[0, i] - values[1, i], values[2, i] - values[3, i]
            slope, noise = (8.0 * near - far) / (12.0 * d), NOISE * abs(values[2, i]) / d
            old = flat[i * n + j]
            if abs(slope - old) <= ALIKE * abs(slope) + noise:
                # The longer step has less noise of rounding; the shorter one less of curvature.
                good = abs(slope - old) <= AGREE * abs(slope) + noise
                done[i] = 1.0
                flat[i * n + j] = old if good else slope
            else:
                flat[i * n + j] = slope
                left += 1
        if left == 0:
            break
    for i in range(rows):
        if done[i] == 0.0 and math.isfinite(first[i]):
            flat[i * n + j] = first[i]
    point[j] = x


@kernel
def lengthen(
    function: Any, x: float, j: int, d: float, u: Array, flat: Array, values: Array, rows: int,
    point: Array,
) -> None:  # fmt: skip
    """Lengthen the step until rounding is small beside the difference, or f is not straight."""
    n, done = len(point), values[5]
    for i in range(rows):
        far = values[2, i] - values[3, i]
        done[i] = 0.0 if 0.0 < LOUD * abs(far) < NOISE * abs(values[2, i]) else 1.0
    for _ in range(REDUCTIONS):
        last, d = d, 256.0 * d
        differ(function, x, j, d, u, values, rows, point)
        left = 0
        for i in range(rows):
            if done[i] == 1.0:
                continue
            near, far = values[0, i] - values[1, i], values[2, i] - values[3, i]
            slope, noise = (8.0 * near - far) / (12.0 * d), NOISE * abs(values[2, i])
            straight = abs(2.0 * near - far) <= STRAIGHT * abs(far) + noise
            alike = abs(slope - flat[i * n + j]) <= STRAIGHT * abs(slope) + noise / last
            if straight and alike:
                flat[i * n + j] = slope
            if straight and alike and LOUD * abs(far) < noise:
                left += 1
            else:
                done[i] = 1.0
        if left == 0:
            break
    point[j] = x


@inlined_kernel
def move(
    functions: Functions, steps: Any, k: int, x: Array, u: Array, out: Array, work: FlowWork
) -> None:
    """Write the state of row k: f(x, u), or the solution of x' = f(x, u) by Runge-Kutta steps."""
    if steps is None:
        # x(k) = f(x(k-1), u(k-1))
        call(functions.f, (x, u, out))
        return
    n, h = len(x), steps[min(k, len(steps) - 1)]
    point, slope, total = work.point, work.slope, work.total
    for i in range(n):
        out[i] = x[i]
    # x(t + h) = x(t) + h/6 (k1 + 2 k2 + 2 k3 + k4),   k_s = f(x + a_s h k_(s-1), u)
    for _ in range(functions.substeps):
        for stage in range(4):
            ahead = (0.0, 0.5 * h, 0.5 * h, h)[stage]
            weight = (1.0, 2.0, 2.0, 1.0)[stage]
            for i in range(n):
                point[i] = out[i]
                if stage > 0:
                    point[i] += ahead * slope[i]
            call(functions.f, (point, u, slope))
            for i in range(n):
                total[i] = weight * slope[i] + (total[i] if stage > 0 else 0.0)
        for i in range(n):
            out[i] += h / 6.0 * total[i]


@inlined_kernel
def move_and_derive(
    functions: Functions, steps: Any, k: int, x: Array, u: Array, out: Array, work: FlowWork
) -> None:
    """Write the state of row k, and its Jacobian A with respect to the row before to ``work.A``.

    Along Runge-Kutta steps S = dx/dx(k-1) goes by S' = F(x, u) S, stage by stage.
    """
    if steps is None:
        # A = df/dx, x(k) = f(x(k-1), u(k-1))
        jacobian(functions.f, functions.F, functions.numeric_f, x, u, work.A_flat, work)
        call(functions.f, (x, u, out))
        return
    n, h = len(x), steps[min(k, len(steps) - 1)]
    slope, total = work.slope, work.total
    for i in range(n):
        out[i] = x[i]
        for j in range(n):
            work.sensitivity[i, j] = 1.0 if i == j else 0.0
    # x' = f(x, u),   S' = F(x, u) S,   S = I at the start; A = S at the end
    for _ in range(functions.substeps):
        clear(slope, total, work.slopes, work.totals)
        for stage in range(4):
            ahead = (0.0, 0.5 * h, 0.5 * h, h)[stage]
            weight = (1.0, 2.0, 2.0, 1.0)[stage]
            advance(out, work.sensitivity, ahead, slope, work.slopes, work.stage_point, work.stage)
            jacobian(
                functions.f, functions.F, functions.numeric_f, work.stage_point, u, work.A_flat,
                work,
            )  # fmt: skip
            call(functions.f, (work.stage_point, u, slope))
            multiply(work.A, work.stage, work.slopes)
            advance(total, work.totals, weight, slope, work.slopes, total, work.totals)
        advance(out, work.sensitivity, h / 6.0, total, work.totals, out, work.sensitivity)
    for i in range(n):
        for j in range(n):
            work.A[i, j] = work.sensitivity[i, j]


@inlined_kernel
def clear(x: Array, y: Array, X: Array, Y: Array) -> None:
    """Write zeros to two vectors and two matrices."""
    for i in range(len(x)):
        x[i] = y[i] = 0.0
        for j in range(len(x)):
            X[i, j] = Y[i, j] = 0.0


@inlined_kernel
def advance(
    x: Array, X: Array, h: float, slope: Array, slopes: Array, out: Array, outs: Array
) -> None:
    """Write x + h slope of a vector and a matrix."""
    for i in range(len(x)):
        out[i] = x[i] + h * slope[i]
        for j in range(len(x)):
            outs[i, j] = X[i, j] + h * slopes[i, j]


@inlined_kernel
def multiply(A: Array, S: Array, out: Array) -> None:
    """Write A S."""
    for i in range(len(A)):
        for j in range(len(A)):
            total = 0.0
            for k in range(len(A)):
                total += A[i, k] * S[k, j]
            out[i, j] = total

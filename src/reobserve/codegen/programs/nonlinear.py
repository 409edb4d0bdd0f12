"""Extended and unscented Kalman filters on models from text, in the order of the library's sums."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Expression, Name, Number, outer, times
from reobserve.codegen.program import ONE, ZERO, Program
from reobserve.codegen.programs import linear
from reobserve.codegen.programs.right_hand_sides import expression
from reobserve.codegen.programs.rules import FilterRules
from reobserve.core.errors import InputError
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import KalmanState
from reobserve.observers.kalman import ROUNDING
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter, UnscentedKalmanFilter
from reobserve.systems.nonlinear import NonlinearModel

Array = NDArray[np.float64]

# L L' = P for the lower triangular L, NAN where P has a negative eigenvalue; where P is singular a
# column of L is zero.
_ROOT = """\
for (int32_t j = 0; j < {n}; ++j) {{
    double pivot = {P}[j][j];
    const double bound = {rounding} * {P}[j][j];
    for (int32_t i = 0; i < j; ++i) {{
        {L}[i][j] = 0.0;
        pivot -= {L}[j][i] * {L}[j][i];
    }}
    if (!(pivot >= -bound)) {{
        {L}[j][j] = NAN;
    }} else {{
        {L}[j][j] = (pivot <= 1e-4 * bound) ? 0.0 : sqrt(pivot);
    }}
    for (int32_t k = j + 1; k < {n}; ++k) {{
        double total = {P}[k][j];
        for (int32_t i = 0; i < j; ++i) {{
            total -= {L}[k][i] * {L}[j][i];
        }}
        {L}[k][j] = ({L}[j][j] == 0.0) ? 0.0 : total / {L}[j][j];
    }}
}}
"""


class _Filter:
    """Parts that both have in common: the model's functions, the memory, the estimates."""

    def __init__(self, title: str, observer: GaussianFilter, state: KalmanState) -> None:
        model: NonlinearModel = observer.model
        self.program = program = Program(title, model.outputs, model.inputs)
        self.rules = FilterRules(program, observer, state, model.outputs)
        self.model, n = model, model.states
        self.Q, self.R = program.constant("Q", model.Q), program.constant("R", model.R)
        self.x = program.remember("x", state.posterior.mean)
        self.P = program.remember("P", state.posterior.covariance)
        self.inputs = linear.Inputs(program, model, state)
        if model.substeps:
            h = float(model.steps[0])  # type: ignore[index]
            self.ahead = program.constant("ahead", [0.0, 0.5 * h, 0.5 * h, h])
            self.weight = program.constant("weight", [1.0, 2.0, 2.0, 1.0])
            self.sixth = program.constant("sixth", h / 6.0)
        self.function("dynamics", _code(model, "f"), (n,))
        self.function("output", _code(model, "h"), (model.outputs,))

    def function(self, name: str, codes: tuple[str, ...], shape: tuple[int, ...]) -> None:
        """A function of state and input, from the code of its entries."""
        program, model = self.program, self.model
        at = program.local("at", (model.states,))
        given = [program.local("input", (model.inputs,))] if model.inputs else []
        out = program.local(f"{name}_out", shape)

        def entry(array: str, index: int) -> Expression:
            if array == "x":
                return at[index]
            if index < model.inputs:
                return given[0][index]
            values = program.constant("parameters", model.parameter_values)
            return values[index - model.inputs]

        with program.function(name, (at, *given), out):
            for index, code in zip(np.ndindex(shape), codes, strict=True):
                program.let(out[index], expression(code, entry))

    def call(self, target: Name, name: str, at: Name, u: Name | None) -> Name:
        """The value of a function at a point, with an input if the model has any."""
        return self.program.apply(target, name, at, *([] if u is None else [u]))

    @contextmanager
    def substeps(self) -> Iterator[None]:
        """The Runge-Kutta steps of a sampling period."""
        if self.model.substeps == 1:
            yield
            return
        with self.program.for_each("substep", self.model.substeps):
            yield

    def report(self, e: Name, log_likelihood: Name) -> Program:
        """Add the estimates, the last statements."""
        program = self.program
        linear.estimate_innovation(program, e)
        program.estimate("state", self.x)
        program.estimate("variance", linear.diagonal(program, self.P))
        program.estimate("log_likelihood", log_likelihood)
        self.rules.keep()
        self.rules.estimate()
        self.inputs.keep()
        return program


def _code(model: NonlinearModel, name: str) -> tuple[str, ...]:
    """The expressions of a function, if it is text."""
    code = model.code(name)
    if code is None:
        problem = f"of a model with {name} as a function cannot be exported; give it as text"
        raise InputError("observer", problem)
    return code


def extended(observer: ExtendedKalmanFilter, state: KalmanState) -> Program:
    """The filter with Jacobians."""
    model = observer.model
    made = _Filter("Extended Kalman filter", observer, state)
    program, x, P, n, p = made.program, made.x, made.P, model.states, model.outputs
    made.function("dynamics_jacobian", _code(model, "F"), (n, n))
    made.function("output_jacobian", _code(model, "H"), (p, n))
    with made.inputs.moves():
        A = _derived_step(made)
        made.rules.wrap(x, made.rules.states)
        cross = program.let(program.local("cross", (n, n)), P @ A.T)
        program.let(P, A @ cross + made.Q, symmetric=True)
    u = program.u if model.inputs else None
    C = made.call(program.local("C", (p, n)), "output_jacobian", x, u)
    expected = made.call(program.local("expected", (p,)), "output", x, u)
    matrices = linear.Matrices(None, None, C, None, made.Q, made.R, expected)
    e, log_likelihood = linear.correct(program, matrices, x, P, None, None, made.rules)
    return made.report(e, log_likelihood)


def _derived_step(made: _Filter) -> Name:
    """Move the mean and its Jacobian A by the mean before: A' = F(x, u) A, stage by stage."""
    program, x, n, u = made.program, made.x, made.model.states, made.inputs.held
    A = program.local("A", (n, n))
    if not made.model.substeps:
        made.call(A, "dynamics_jacobian", x, u)
        moved = made.call(program.local("moved", (n,)), "dynamics", x, u)
        program.let(x, moved)
        return A
    F, inside, slopes, totals = (
        program.local(name, (n, n)) for name in ("F", "A_inside", "A_slope", "A_total")
    )
    point, slope, total = (program.local(name, (n,)) for name in ("inside", "slope", "x_total"))
    program.let(A, Number(0.0, (n, n)))
    with program.for_each("row", n) as row:
        program.let(A[row, row], ONE)
    with made.substeps():
        for variable in (slope, total, slopes, totals):
            program.let(variable, Number(0.0, variable.shape))
        with program.for_each("stage", 4) as stage:
            program.let(point, x + made.ahead[stage] * slope)
            program.let(inside, A + made.ahead[stage] * slopes)
            made.call(F, "dynamics_jacobian", point, u)
            made.call(slope, "dynamics", point, u)
            program.let(slopes, F @ inside)
            program.let(total, total + made.weight[stage] * slope)
            program.let(totals, totals + made.weight[stage] * slopes)
        program.let(x, x + made.sixth * total)
        program.let(A, A + made.sixth * totals)
    return A


class _SigmaPoints:
    """Points x, x + c L_i and x - c L_i, with L L' = P, and sums over what becomes of them."""

    def __init__(self, made: _Filter, observer: UnscentedKalmanFilter) -> None:
        self.made, weights, n = made, observer.weights, made.model.states
        self.program, self.count = made.program, 2 * n + 1
        values = {"spread": weights.spread, "each": weights.each, "first": weights.first}
        self.spread, self.each, self.first = (
            made.program.constant(name, value) for name, value in values.items()
        )
        self.crossed = made.program.constant("each_spread", weights.each * weights.spread)
        self.root = made.program.local("root", (n, n))
        self.points = made.program.local("points", (self.count, n))

    def place(self) -> None:
        """Write the points."""
        program, x, points, n = self.program, self.made.x, self.points, self.made.model.states
        program.code(self.root, _ROOT, L=self.root, P=self.made.P, n=n, rounding=ROUNDING)
        program.let(points[0], x)
        apart = program.local("apart")
        with program.for_each("row", n) as row, program.for_each("column", n) as column:
            program.let(apart, self.spread * self.root[row, column])
            program.let(points[f"1 + {column}", row], x[row] + apart)
            program.let(points[f"{1 + n} + {column}", row], x[row] - apart)

    def average(self, images: Name, mean: Name, periods: Array) -> None:
        """The mean of images, which then are what they differ by from it."""
        program = self.program
        off, total = (program.local(f"{name}_{images.name}", mean.shape) for name in ("off", "sum"))
        program.let(total, Number(0.0, mean.shape))
        with program.for_each("point", self.count - 1) as point:
            program.let(off, images[f"1 + {point}"] - images[0])
            self.made.rules.wrap(off, periods)
            program.let(total, total + off)
        program.let(mean, images[0] + self.each * total)
        self.subtract(images, mean, periods)

    def subtract(self, rows: Name, mean: Name, periods: Array | None = None) -> None:
        """Subtract a mean from each row, angles the shortest way round."""
        with self.program.for_each("point", self.count) as point:
            self.program.let(rows[point], rows[point] - mean)
            if periods is not None:
                self.made.rules.wrap(rows[point], periods)

    def scatter(self, rows: Name, into: Name, *noise: Name) -> None:
        """Sum w d d' of the rows d, and the noise."""
        program, size = self.program, rows.shape[1]
        total = program.local(f"scatter_{rows.name}", (size, size))
        program.let(total, Number(0.0, total.shape))
        with program.for_each("point", self.count - 1) as point:
            deviation = rows[f"1 + {point}"]
            program.let(total, total + outer(deviation, deviation))
        central = outer(self.first * rows[0], rows[0])
        if noise:
            program.let(into, noise[0] + central + self.each * total, symmetric=True)
        else:
            program.let(into, self.each * total + central, symmetric=True)

    def cross(self, images: Name, into: Name) -> None:
        """Sum w (X - x) d' of the images d, where X - x is 0, c L_i or -c L_i."""
        program, n = self.program, self.made.model.states
        pairs = program.local("pairs", into.shape)
        with program.for_each("column", n) as column:
            above, below = images[f"1 + {column}"], images[f"{1 + n} + {column}"]
            program.let(pairs[column], above - below)
        program.let(into, self.root @ pairs)
        program.let(into, self.crossed * into)


def unscented(observer: UnscentedKalmanFilter, state: KalmanState) -> Program:
    """The filter with sigma points."""
    model = observer.model
    made = _Filter("Unscented Kalman filter", observer, state)
    points, program, n, p = _SigmaPoints(made, observer), made.program, model.states, model.outputs
    with made.inputs.moves():
        _move_points(made, points)
    e, valid = program.local("e", (p,)), program.local("valid", (p,))
    measured, log_likelihood = program.local("measured"), program.local("log_likelihood")
    for variable in (measured, log_likelihood):
        program.let(variable, ZERO)
    with program.for_each("row", p) as row:
        program.let(e[row], ZERO)
        program.flag(valid[row], f"!isnan({program.y[row]})")
        made.rules.reset(row)
        program.let(measured, measured + valid[row])
    with program.when(f"{measured} > 0.5"):
        points.place()
        images, expected = program.local("outputs", (points.count, p)), program.local("h", (p,))
        u = program.u if model.inputs else None
        with program.for_each("point", points.count) as point:
            made.call(images[point], "output", points.points[point], u)
        points.average(images, expected, made.rules.outputs)
        with program.for_each("row", p) as row, program.when(f"{valid[row]} > 0.5"):
            program.let(e[row], program.y[row] - expected[row])
        made.rules.wrap(e, made.rules.outputs)
        R = made.rules.noise_of(made.R)
        S, K = program.local("S", (p, p)), program.local("K", (n, p))
        points.scatter(images, S, R)
        made.rules.apply_gate(e, valid, S)
        L = linear.factor(program, S, valid)
        linear.log_likelihood_of(program, L, e, valid)
        made.rules.learn(L, valid, R)
        cross = program.local("output_cross", (n, p))
        points.cross(images, cross)
        program.solve_right(K, cross, L)  # K = sum w (X - x) (h(X) - y)' S^-1
        points.subtract(points.points, made.x)
        linear.move(program, made.x, K, e, valid)
        made.rules.wrap(made.x, made.rules.states)
        _joseph(made, points, images, K, R)
    return made.report(e, log_likelihood)


def _move_points(made: _Filter, points: _SigmaPoints) -> None:
    """x = sum w f(X), P = sum w (f(X) - x) (f(X) - x)' + Q."""
    program, n, u = made.program, made.model.states, made.inputs.held
    points.place()
    images = program.local("images", points.points.shape)
    with program.for_each("point", points.count) as point:
        at, image = points.points[point], images[point]
        if not made.model.substeps:
            made.call(image, "dynamics", at, u)
        else:
            inside, slope, total = (
                program.local(name, (n,)) for name in ("inside", "slope", "x_total")
            )
            program.let(image, at)
            with made.substeps():
                for variable in (slope, total):
                    program.let(variable, Number(0.0, (n,)))
                with program.for_each("stage", 4) as stage:
                    program.let(inside, image + made.ahead[stage] * slope)
                    made.call(slope, "dynamics", inside, u)
                    program.let(total, total + made.weight[stage] * slope)
                program.let(image, image + made.sixth * total)
    points.average(images, made.x, made.rules.states)
    made.rules.wrap(made.x, made.rules.states)
    points.scatter(images, made.P, made.Q)


def _joseph(made: _Filter, points: _SigmaPoints, images: Name, K: Name, R: Name) -> None:
    """P = sum w r r' + K R K' of r = (X - x) - K (h(X) - y)."""
    program, P, rows = made.program, made.P, points.points
    n, p = K.shape
    with program.for_each("point", points.count) as point:
        program.let(rows[point], rows[point] - K @ images[point])
    points.scatter(rows, P)
    with program.for_each("row", n) as a, program.for_each("column", f"{a} + 1") as b:
        with program.for_each("i", p) as i, program.for_each("j", p) as j:
            program.let(P[a, b], P[a, b] + times(times(K[a, i], R[i, j]), K[b, j]))
        program.let(P[b, a], P[a, b])

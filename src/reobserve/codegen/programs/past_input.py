"""The past of an input in a program: a ring of polynomials, as long as the greatest delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Expression, Name, call
from reobserve.codegen.statements import ZERO, Program
from reobserve.observers.delay_estimator import DelayEstimator, State
from reobserve.observers.row_derivatives import derivative_weights

Array = NDArray[np.float64]


class PastInput:
    """Statements that keep u over periods, and the function ``past`` that reads it.

    A period is a row of six numbers: the polynomial of degree five in s, from -1 to 1 over the
    period, that `reobserve.signals.input_history` reads its samples by.
    """

    def __init__(self, program: Program, observer: DelayEstimator, state: State) -> None:
        self.program, self.period = program, observer.sampling_period
        self.steps = observer.history_steps
        self.alone = program.inputs == 1
        before = np.zeros(2) if state.sample is None else state.sample[observer.measurements :]
        right, left = state.history.right, state.history.left
        cells = _polynomials(right[:-1:2], right[1::2], left[2::2], self.period)
        self.cells = program.remember("cells", [*cells, np.zeros(6)], "c")
        self.slot = program.counter("slot", self.steps - 1, "q")
        self.before = program.remember("u_before", before, "u_{k-1}")
        self.now = program.u
        if self.alone:
            known = right[::2, 0]
            recent = known[-2:-4:-1] if state.sample is None else (before[0], known[-2])
            self.recent = program.remember("u_recent", recent, r"\bar u")
            self.now = program.local("u_now", (2,), "u_k")
            weights = derivative_weights(3, 1)[:, 0] / self.period
            self.weights = program.constant("u_weights", weights, "d")
        self._define()
        program.notes.append(
            f"Past inputs are kept over {self.steps + 1} periods in a ring, $q$ the present one: "
            "of each the polynomial of degree five in $s$, from -1 to 1 over the period, that has "
            r"$u$ and $\dot u$ at its start, middle and end"
        )

    def _define(self) -> None:
        """u and u' ``lag`` periods before a part of the present one."""
        program, size = self.program, self.cells.shape[0]
        slot, fraction = program.local("present", (), "q"), program.local("fraction", (), r"\theta")
        lag, ring = program.local("lag", (), r"\ell"), program.local("ring", self.cells.shape, "c")
        place, cell = program.local("place", (), "p"), program.local("cell", (), "j")
        index, s = program.local("index", (), "i"), program.local("s", ())
        c, out = (
            program.local("c", (6,), r"\gamma"),
            program.local("past_out", (2,), r"(u, \dot u)"),
        )
        program.symbols["whole(index)"] = r"(q + j) \bmod " + str(size)
        with program.function("past", (ring, slot, fraction, lag), out, r"\mathit{past}"):
            program.let(place, fraction - lag)
            with program.hidden():
                program.let(out[0], Name("NAN"))
                program.let(out[1], Name("NAN"))
                program.let(cell, ZERO)
            with program.when("isfinite(place)", r"p \text{ is a number}"):
                with program.when("place < 0.0", "p < 0"):
                    program.let(cell, call("floor", place))
                    with program.when(f"place <= {-float(self.steps)!r}", f"p \\le -{self.steps}"):
                        program.let(cell, -float(self.steps))
                program.let(s, 2.0 * (place - cell) - 1.0)
                with program.hidden():
                    for sign, bound in (("<", -3.0), (">", 3.0)):
                        with program.when(f"s {sign} {bound!r}"):
                            program.let(s, bound)
                    program.let(index, slot + cell)
                    with program.when("index < 0.0"):
                        program.let(index, index + float(size))
                program.let(c, ring["whole(index)"])
                program.let(out[0], _nested([c[i] for i in range(6)], s))
                rate = _nested([float(i) * c[i] if i > 1 else c[i] for i in range(1, 6)], s)
                program.let(out[1], rate / (0.5 * self.period))

    def find(self) -> None:
        """u and u' at the row."""
        if not self.alone:
            return
        program, u = self.program, self.program.u
        with program.hidden():
            program.let(self.now[0], u[0])
        found: Expression = self.weights[0] * u[0]
        for i in (0, 1):
            found = found + self.weights[i + 1] * self.recent[i]
        program.let(self.now[1], found)
        program.notes.append(r"$\bar u$ is $u$ at the two samples before")

    def append(self) -> None:
        """The period from the row before to this one."""
        program, h = self.program, self.period
        a, b = self.before, self.now
        with program.hidden():
            program.advance(self.slot, self.cells.shape[0])
        value, slope = program.local("value", (), r"\nu"), program.local("incline", (), r"\mu")
        bend, rest = program.local("bend", ()), program.local("rest", ())
        cell = self.cells["slot"]
        with program.hidden():
            program.let(value, 0.5 * (a[0] + b[0]) + (0.125 * h) * (a[1] - b[1]))
            middle = (1.5 / h) * (b[0] - a[0]) - 0.25 * (a[1] + b[1])
            program.let(slope, (0.5 * h) * middle)
            program.let(bend, 0.5 * (b[0] + a[0]) - value)
            program.let(rest, 0.5 * (b[0] - a[0]) - slope)
            program.let(cell[0], value)
            program.let(cell[1], slope)
            program.let(cell[4], (0.125 * h) * (b[1] - a[1]) - bend)
            program.let(cell[2], bend - cell[4])
            program.let(cell[5], 0.5 * ((0.25 * h) * (b[1] + a[1]) - slope - 3.0 * rest))
            program.let(cell[3], rest - cell[5])

    def keep(self) -> None:
        """Remember the row; among the last statements of a program."""
        program = self.program
        with program.hidden():
            if self.alone:
                program.let(self.recent[1], self.recent[0])
                program.let(self.recent[0], program.u[0])
            program.let(self.before, self.now)


def _nested(coefficients: list[Expression], s: Expression) -> Expression:
    """A polynomial by Horner's rule."""
    *rest, found = coefficients
    for each in reversed(rest):
        found = each + s * found
    return found


def _polynomials(start: Array, middle: Array, end: Array, period: float) -> Array:
    """The six numbers of each period, from rows of u and u'."""
    half = 0.5 * period
    value, slope = middle[:, 0], half * middle[:, 1]
    first, last = half * start[:, 1], half * end[:, 1]
    bend = 0.5 * (end[:, 0] + start[:, 0]) - value
    rest = 0.5 * (end[:, 0] - start[:, 0]) - slope
    c4 = 0.25 * (last - first) - bend
    c5 = 0.5 * (0.5 * (last + first) - slope - 3.0 * rest)
    return np.column_stack([value, slope, bend - c4, rest - c5, c4, c5])

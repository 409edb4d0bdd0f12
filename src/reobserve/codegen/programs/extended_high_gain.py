"""The extended high-gain observer: steps in parts, each in one mode of the delay and its gain."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Expression, Name, call
from reobserve.codegen.program import ONE, ZERO, Program
from reobserve.codegen.programs.chandrupatla import next_trial
from reobserve.codegen.programs.derivatives import SmoothSignal
from reobserve.codegen.programs.right_hand_sides import right_hand_sides
from reobserve.codegen.programs.sampling import runge_kutta
from reobserve.core.errors import InputError
from reobserve.observers.extended_high_gain import (
    MAX_CHANGES,
    MAX_TRIALS,
    NEAREST,
    ExtendedHighGainObserver,
    ExtendedHighGainState,
)
from reobserve.synthesis.high_gain_design import high_gain


def extended(
    observer: ExtendedHighGainObserver, state: ExtendedHighGainState, columns: tuple[int, int]
) -> Program:
    """x^ and tau^, for an input whose derivatives are given, or found from its samples."""
    if observer.initial_matrix is not None:
        raise InputError(
            "observer",
            "with an initial_matrix cannot be exported: its gain is another at each sample until "
            "it has settled",
        )
    program = Program("Extended high-gain observer", *columns)
    n, m = observer.model.states, observer.order
    sample = np.zeros(m + 2) if state.sample is None else state.sample
    y_before = program.remember("y_before", sample[:1])
    started = program.counter("started", int(state.sample is not None))
    known = 0 if state.sample is None else state.count + 1
    u = SmoothSignal(
        program, "u", program.u, sample[1:], state.recent, known, observer.sampling_period
    )
    z = program.remember("z", state.values)
    step = _Step(program, observer, z)
    off = program.let(program.local("off_share"), ZERO)
    u.find()
    with program.when(f"{started} == 1"):
        for row, y, signal in (step.first, y_before, u.before), (step.last, program.y, u.now):
            program.let(row[0], y[0])
            for i in range(m + 1):
                program.let(row[1 + i], signal[i])
        step.take(off)
    program.estimate_part("state", z, 0, n)
    program.estimate("delay", z[n])
    program.estimate("switched_off", off, size=1.0)
    u.keep()
    program.line(f"{started} = 1;")
    program.let(y_before, program.y)
    return program


class _Step:
    """A step from row to row in parts, each up to a change of mode of the delay or of the gain.

    ``z`` holds x^ and tau^; ``first`` and ``last`` hold y, u, u', ..., u^(m) of the row before and
    of this one, ``row`` the same in between, and G(y). ``mode[0]`` is 1 or -1 where the delay is
    held at its upper or lower bound, which it would leave, else 0; ``mode[1]`` is 1 where |xi^| is
    below its threshold, else 0.
    """

    def __init__(self, program: Program, observer: ExtendedHighGainObserver, z: Name) -> None:
        self.program, self.observer, self.z = program, observer, z
        self.n, self.order = observer.model.states, observer.order
        self.K = program.constant("K", high_gain(self.n + 1, observer.rho))
        self.h = program.constant("h", observer.sampling_period)
        least, most = observer.delay_bounds
        self.least, self.most = program.constant("least", least), program.constant("most", most)
        self.threshold = program.constant("threshold", observer.threshold)
        self.point, self.to = program.local("point", z.shape), program.local("to", z.shape)
        self.row = program.local("row", (self.order + 3,))
        self.first, self.last = (program.local(name, (self.order + 2,)) for name in _ROWS)
        self.mode, self.delay = program.local("mode", (2,)), program.local("tau")
        self.xi, self.distance, self.trial = (
            program.local(name, (1,)) for name in ("xi", "distance", "trial_at")
        )
        self.rate = program.local("rate")
        self.begin, self.end, self.holds, self.searching, self.turning = map(program.local, _PLACES)
        self.xi_first, self.rate_first = map(program.local, ("xi_first", "rate_first"))
        right_hand_sides(program, observer.model)
        self._inputs_at()
        self._factor()
        self._slope()
        self._part()
        self._margin()
        next_trial(program, NEAREST)

    # --- Functions ---

    def _inputs_at(self) -> None:
        """Inputs at a part of the step, along straight lines."""
        program, size = self.program, self.order + 2
        place, out = program.local("place"), program.local("row_out", (size + 1,))
        y, gain = program.local("y_there", (1,)), program.local("gain_there", (1,))
        with program.function("inputs_at", (self.first, self.last, place), out):
            for i in range(size):
                program.let(out[i], (ONE - place) * self.first[i] + place * self.last[i])
            program.let(y[0], out[0])
            program.apply(gain, "input_gain", y)
            program.let(out[size], gain[0])

    def _factor(self) -> None:
        """xi^, term by term as the observer computes it: here rounding is amplified most."""
        program, row = self.program, self.row
        out, total = program.local("xi_out", (1,)), program.local("xi_sum")
        factor = program.local("factor")
        with program.function("factor_at", (self.delay, row), out):
            program.let(total, -row[2])
            for i in range(2, self.order + 1):
                before: Expression = -ONE if i == 2 else factor
                program.let(factor, before * (-self.delay / float(i)))
                program.let(total, total + factor * row[1 + i])
            program.let(out[0], row[self.order + 2] * total)

    def _slope(self) -> None:
        """The right-hand side in a mode."""
        program, n, point, row = self.program, self.n, self.point, self.row
        out, f = program.local("slope_out", (n + 1,)), program.local("f", (n,))
        error = program.local("error")
        with program.function("slope", (point, row, self.mode), out):
            program.apply(f, "drift", point)
            program.apply(self.xi, "factor_at", point[n], row)
            program.let(error, point[0] - row[0])
            if self.observer.switched == "all":
                with program.when("mode[1] > 0.5"):
                    program.let(error, ZERO)
            for i in range(n):
                pushed = self.xi[0] * point[n] + row[self.order + 2] * row[1]
                more: Expression = point[i + 1] if i + 1 < n else pushed
                program.let(out[i], more + f[i] - self.K[i] * error)
            program.let(out[n], ZERO)
            with program.when("mode[0] == 0.0 && mode[1] == 0.0"):
                program.let(out[n], -(self.K[n] * error / self.xi[0]))

    def _part(self) -> None:
        """The classical method from one part of the step to another."""
        program, begin, end = self.program, self.begin, self.end
        middle, width = program.local("half"), program.local("width")
        out = program.local("part_out", self.z.shape)
        given = (self.first, self.last, begin, end, self.mode, self.point)
        with program.function("part", given, out):
            program.let(width, (end - begin) * self.h)
            program.let(middle, begin + 0.5 * (end - begin))
            stages = []
            for number, place in enumerate((begin, middle, end), start=1):
                row = program.local(f"row_{number}", self.row.shape)
                program.apply(row, "inputs_at", self.first, self.last, place)
                stages.append((row, self.mode))
            runge_kutta(program, "slope", self.point, stages, width, out)

    def _margin(self) -> None:
        """The distance of a mode from its end at a point, with ``xi_begun`` xi^ where it began."""
        program, out = self.program, self.program.local("margin_out", (1,))
        rate, begun, xi = map(program.local, ("rate_here", "xi_begun", "xi_here"))
        given = (self.delay, rate, xi, begun, self.mode)
        with program.function("margin", given, out):
            with program.when("mode[1] > 0.5"):
                program.let(out[0], self.threshold - call("fabs", xi))
            with program.otherwise():
                with program.when("xi_begun > 0.0"):
                    program.let(out[0], xi - self.threshold)
                with program.otherwise():
                    program.let(out[0], -xi - self.threshold)
                with program.when("mode[0] == 0.0"):
                    self._at_most(out[0], self.delay - self.least)
                    self._at_most(out[0], self.most - self.delay)
                with program.otherwise():
                    self._at_most(out[0], self.mode[0] * rate)

    def _at_most(self, target: Name, value: Expression) -> None:
        """The smaller of two, not a number where the target is none."""
        margin = self.program.let(self.program.local("margin"), value)
        with self.program.when(f"{margin} < {target}"):
            self.program.let(target, margin)

    # --- The step ---

    def take(self, off: Name) -> None:
        """Step from row to row, and add the share of the step with the gain off to ``off``."""
        program, z, begin, end = self.program, self.z, self.begin, self.end
        going = program.let(program.local("going"), ONE)
        program.let(begin, ZERO)
        with program.for_each("change", MAX_CHANGES), program.when(f"{going} > 0.5"):
            self._evaluate_at(z, begin)
            program.let(self.xi_first, self.xi[0])
            program.let(self.rate_first, self.rate)
            self._clamp()
            self._choose()
            program.let(end, ONE)
            self._move()
            self._cut()
            with program.when("mode[1] > 0.5"):
                program.let(off, off + end - begin)
            program.let(z, self.to)
            with program.when(f"{end} == 1.0"):
                program.let(going, ZERO)
            program.let(begin, end)
        self._clamp()

    def _evaluate_at(self, at: Name, place: Name) -> None:
        """Inputs, xi^ and the raw rate at a point."""
        program = self.program
        program.apply(self.row, "inputs_at", self.first, self.last, place)
        program.apply(self.xi, "factor_at", at[self.n], self.row)
        program.let(self.rate, -(self.K[self.n] * (at[0] - self.row[0]) / self.xi[0]))

    def _move(self) -> None:
        """Move from the begin of the part to its end: the mode's margin there, and if it holds.

        A margin that is not a number, where the state has left their range, does not hold.
        """
        program, given = self.program, (self.first, self.last, self.begin, self.end, self.mode)
        program.apply(self.to, "part", *given, self.z)
        self._evaluate_at(self.to, self.end)
        at = (self.to[self.n], self.rate, self.xi[0], self.xi_first, self.mode)
        program.apply(self.distance, "margin", *at)
        program.flag(self.holds, "distance[0] >= 0.0")

    def _clamp(self) -> None:
        """The delay in its interval."""
        tau = self.z[self.n]
        for sign, bound in (("<", self.least), (">", self.most)):
            with self.program.when(f"{tau} {sign} {bound}"):
                self.program.let(tau, bound)

    def _choose(self) -> None:
        """The mode that holds from here on."""
        program, tau, (off, held) = self.program, self.z[self.n], (self.mode[1], self.mode[0])
        program.flag(off, "fabs(xi[0]) < threshold || xi[0] == 0.0")
        program.let(held, ZERO)
        for bound, sign, value in ((self.most, ">", ONE), (self.least, "<", -ONE)):
            with program.when(f"{off} < 0.5 && {tau} == {bound} && rate {sign} 0.0"):
                program.let(held, value)

    def _cut(self) -> None:
        """End the part where the mode does, or where a free delay that turns round left it."""
        program, begin, rate = self.program, self.begin, self.rate_first
        program.let(self.turning, begin + 0.5 * (ONE - begin))
        program.let(self.searching, ONE - self.holds)
        free = f"{self.holds} > 0.5 && mode[0] == 0.0 && mode[1] < 0.5"
        with program.when(f"{free} && {rate} != 0.0 && !({rate} * {self.rate} >= 0.0)"):
            program.let(self.searching, ONE)
            program.let(self.turning, begin + (ONE - begin) * rate / (rate - self.rate))
        with program.when(f"change < {MAX_CHANGES - 1} && {self.searching} > 0.5"):
            self._search()

    def _search(self) -> None:
        """Go on to the first point beyond the end of the mode. ``turning`` is tried first."""
        program, end, xi, rate = self.program, self.end, self.xi_first, self.rate_first
        newest, opposite, former = (Name(name, (2,)) for name in ("newest", "opposite", "former"))
        held, other, apart = map(program.local, ("newest_holds", "opposite_holds", "apart"))
        program.let(opposite[0], ONE)
        program.let(opposite[1], self.distance[0])
        program.let(other, self.holds)
        program.apply(self.distance, "margin", self.z[self.n], rate, xi, xi, self.mode)
        program.let(newest[0], self.begin)
        program.let(newest[1], self.distance[0])
        program.let(former, newest)
        program.flag(held, "distance[0] >= 0.0")
        program.let(end, self.turning)
        with program.for_each("trial", MAX_TRIALS), program.when(f"{self.searching} > 0.5"):
            self._move()
            with program.when(f"{self.holds} == {held}"):
                program.let(former, newest)
            with program.otherwise():
                program.let(former, opposite)
                program.let(opposite, newest)
                program.let(other, held)
            program.let(newest[0], end)
            program.let(newest[1], self.distance[0])
            program.let(held, self.holds)
            program.let(apart, call("fabs", end - opposite[0]))
            with program.when(f"{apart} > {2.0 * NEAREST!r} && {held} * {other} < 0.5"):
                program.apply(self.trial, "next_trial", newest, opposite, former)
                program.let(end, self.trial[0])
            with program.otherwise():
                # the point beyond the end of the mode is the later one
                with program.when(f"{end} >= {opposite[0]}"):
                    program.let(self.searching, ZERO)
                with program.otherwise():
                    program.let(end, opposite[0])
        program.let(end, newest[0])


_ROWS = ("first", "last")
_PLACES = ("begin", "end", "holds", "searching", "turning")

"""The extended high-gain observer: steps in parts, each in one mode of the delay and its gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reobserve.codegen.expressions import Expression, Name, call
from reobserve.codegen.programs.chandrupatla import next_trial
from reobserve.codegen.programs.derivatives import SmoothSignal
from reobserve.codegen.programs.right_hand_sides import right_hand_sides
from reobserve.codegen.programs.sampling import tell_part
from reobserve.codegen.statements import ONE, ZERO, Program
from reobserve.core.errors import InputError
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver, State
from reobserve.observers.extended_high_gain_loop import MOST_CHANGES, MOST_TRIALS, NEAREST
from reobserve.synthesis.high_gain import high_gain


def extended(observer: ExtendedHighGainObserver, state: State, columns: tuple[int, int]) -> Program:
    """x^ and tau^, for an input whose derivatives are given, or found from its samples."""
    if observer.initial_matrix is not None:
        raise InputError(
            "observer",
            "with an initial_matrix cannot be exported: its gain is another at each sample until "
            "it has settled",
        )
    maker = _Maker(observer, state, columns)
    program, n = maker.program, maker.n
    y_before = program.remember(
        "y_before", [0.0] if state.sample is None else state.sample[:1], "y_{k-1}"
    )
    started = program.counter("started", int(state.sample is not None))
    known = 0 if state.sample is None else state.count + 1
    before = np.zeros(observer.order + 1) if state.sample is None else state.sample[1:]
    u = SmoothSignal(
        program, "u", program.u, before, state.recent, known, observer.sampling_period
    )  # fmt: skip
    z = program.remember("z", state.values, r"\hat z")
    maker.functions()
    share = program.local("share", (), r"\sigma")
    with program.hidden():
        program.let(share, ZERO)
    u.find()
    with program.when("started == 1", "k > 0"):
        first = program.local("first", (observer.order + 2,), r"(y, u)_{k-1}")
        last = program.local("last", (observer.order + 2,), r"(y, u)_k")
        with program.hidden():
            for row, y, signal in ((first, y_before, u.before), (last, program.y, u.now)):
                program.let(row[0], y[0])
                for i in range(observer.order + 1):
                    program.let(row[1 + i], signal[i])
        maker.step(z, first, last, share)
    tell_part(program, "state", z, 0, n)
    program.estimate("delay", z[n])
    program.estimate("switched_off", share, size=1.0)
    u.keep()
    with program.hidden():
        program.set_counter(started, 1)
        program.let(y_before, program.y)
    return program


@dataclass
class _Maker:
    observer: ExtendedHighGainObserver
    state: State
    columns: tuple[int, int]

    def __post_init__(self) -> None:
        observer = self.observer
        self.n, self.order = observer.model.states, observer.order
        self.program = program = Program("Extended high-gain observer", *self.columns)
        self.K = program.constant("K", high_gain(self.n + 1, observer.rho), gain=True)
        self.h = program.constant("h", observer.sampling_period)
        least, most = observer.delay_bounds
        self.least = program.constant("least", least, r"\tau_{min}")
        self.most = program.constant("most", most, r"\tau_{max}")
        program.constant("threshold", observer.threshold, r"\xi_{min}")
        # What functions are handed: inputs at an instant are y, u, u', ..., u^(m), G(y).
        self.point = program.local("point", (self.n + 1,), r"\hat z")
        self.row = program.local("row", (self.order + 3,), "r")
        self.mode = program.local("mode", (2,), "m")
        self.delay = program.local("tau", (), r"\hat\tau")
        self.xi = program.local("xi", (1,), r"\xi")
        self.rate = program.local("rate", (1,), r"\dot\tau")
        self.distance, self.trial = program.local("distance", (1,)), program.local("trial_at", (1,))
        self.off = program.local("off", (1,))
        program.notes.append(
            r"$\hat z$ holds $\hat x$ and $\hat\tau$; $a$ and $b$ hold $y, u, \dot u, \dots$ of "
            "the row before and of this one, $r$ the same in between, and $G$ last"
        )
        program.notes.append(
            "$m_1$ is 1 or -1 where the delay is held at a bound that it would leave, else 0; $m_2$"
            " is 1 where $\\lvert\\xi\\rvert$ is below its threshold, else 0. A step is cut where "
            "they change, and goes on from there; $\\sigma$ is the share of parts with $m_2 = 1$"
        )

    # --- Functions ---

    def functions(self) -> None:
        right_hand_sides(self.program, self.observer.model)
        self.inputs_at()
        self.seen()
        self.slope()
        self.part()
        with self.program.hidden():
            self.raw_rate()
            self.unseen()
            self.margin()
            next_trial(self.program, NEAREST)

    def inputs_at(self) -> None:
        """Inputs at a part of the step, along straight lines."""
        program, size = self.program, self.order + 2
        first, last = program.local("first", (size,)), program.local("last", (size,))
        place = program.local("place", (), r"\theta")
        out = program.local("row_out", (size + 1,), "r")
        y, gain = program.local("y_there", (1,), "y"), program.local("gain_there", (1,), "G")
        program.symbols.update(first="a", last="b")
        with program.function("inputs_at", (first, last, place), out, "r"):
            for i in range(size):
                program.let(out[i], (ONE - place) * first[i] + place * last[i])
            program.let(y[0], out[0])
            program.apply(gain, "input_gain", y)
            program.let(out[size], gain[0])

    def seen(self) -> None:
        """The factor xi^, term by term as the observer has it: here rounding is amplified most."""
        program, row = self.program, self.row
        out, sum_ = program.local("xi_out", (1,), r"\xi"), program.local("seen_sum", (), "S")
        factor = program.local("factor", (), r"\varphi")
        with program.function("seen", (self.delay, row), out, r"\xi"):
            program.let(sum_, -row[2])
            for i in range(2, self.order + 1):
                before: Expression = -ONE if i == 2 else factor
                program.let(factor, before * (-self.delay / float(i)))
                program.let(sum_, sum_ + factor * row[1 + i])
            program.let(out[0], row[self.order + 2] * sum_)

    def slope(self) -> None:
        """The right-hand side in a mode."""
        program, n, point, row = self.program, self.n, self.point, self.row
        out, f = program.local("slope_out", (n + 1,), "s"), program.local("f", (n,))
        error = program.local("error", (), r"\epsilon")
        with program.function("slope", (point, row, self.mode), out, "F"):
            program.apply(f, "drift", point)
            program.apply(self.xi, "seen", point[n], row)
            program.let(error, point[0] - row[0])
            if self.observer.switched == "all":
                with program.when("mode[1] > 0.5", "m_2 = 1"):
                    program.let(error, ZERO)
            for i in range(n):
                pushed = self.xi[0] * point[n] + row[self.order + 2] * row[1]
                more: Expression = point[i + 1] if i + 1 < n else pushed
                program.let(out[i], more + f[i] - self.K[i] * error)
            program.let(out[n], ZERO)
            with (
                program.when("mode[0] == 0.0", "m_1 = 0"),
                program.when("mode[1] == 0.0", "m_2 = 0"),
                program.when("xi[0] != 0.0", r"\xi \ne 0") as zero,
            ):
                program.let(out[n], -(self.K[n] * error / self.xi[0]))
                with program.hidden(), program.otherwise(zero):
                    program.let(out[n], Name("NAN"))

    def part(self) -> None:
        """The classical method from one part of the step to another."""
        program, n, point = self.program, self.n, self.point
        size = self.order + 2
        first, last = Name("first", (size,)), Name("last", (size,))
        begin, end = program.local("begin", (), r"\theta_0"), program.local("end", (), r"\theta_1")
        out = program.local("to_out", (n + 1,), r"\hat z^+")
        middle = program.local("half", (), r"\theta_{1/2}")
        width = program.local("width", (), r"\delta")
        ahead = program.local("ahead", (n + 1,), r"(\hat x, \hat\tau)'")
        with program.function("part", (first, last, begin, end, self.mode, point), out, "P"):
            program.let(width, (end - begin) * self.h)
            program.let(middle, begin + 0.5 * (end - begin))
            rows = []
            for number, place in enumerate((begin, middle, end), start=1):
                row = program.local(f"row_{number}", (size + 1,), f"r_{number}")
                rows.append(program.apply(row, "inputs_at", first, last, place))
            slopes = [program.local(f"slope_{i}", (n + 1,), f"s_{i}") for i in (1, 2, 3, 4)]
            program.apply(slopes[0], "slope", point, rows[0], self.mode)
            stages = ((0.5 * width, rows[1]), (0.5 * width, rows[1]), (width, rows[2]))
            for i, (length, row) in enumerate(stages):
                program.let(ahead, point + length * slopes[i])
                program.apply(slopes[i + 1], "slope", ahead, row, self.mode)
            a, b, c, d = slopes
            program.let(out, point + width / 6.0 * (a + 2.0 * b + 2.0 * c + d))

    def raw_rate(self) -> None:
        """The rate of the delay before its projection, zero where it cannot be seen."""
        program, point, row = self.program, self.point, self.row
        out = program.local("rate_out", (1,))
        xi = program.local("xi_here", ())
        with program.function("raw_rate", (point, row, xi), out):
            program.let(out[0], ZERO)
            with program.when("xi_here != 0.0"):
                program.let(out[0], -(self.K[self.n] * (point[0] - row[0]) / xi))

    def unseen(self) -> None:
        """Whether |xi^| is below its threshold."""
        program, xi, out = self.program, Name("xi_here"), self.program.local("off_out", (1,))
        size = program.local("size", ())
        with program.function("unseen", (xi,), out):
            program.let(size, call("fabs", xi))
            program.let(out[0], ZERO)
            for condition in ("size < threshold", "size == 0.0"):
                with program.when(condition):
                    program.let(out[0], ONE)

    def margin(self) -> None:
        """How far a mode is from its end at a point; ``seen_before`` is xi^ where it began."""
        program, out = self.program, self.program.local("margin_out", (1,))
        rate, before = program.local("rate_here", ()), program.local("seen_before", ())
        xi, size, room = Name("xi_here"), Name("size"), program.local("room", ())
        given, threshold = (self.delay, rate, xi, before, self.mode), Name("threshold")
        rooms = (self.delay - self.least, self.most - self.delay), (self.mode[0] * rate,)
        with program.function("margin", given, out), program.when("mode[1] > 0.5") as on:
            program.let(size, call("fabs", xi))
            program.let(out[0], threshold - size)
            with program.otherwise(on):
                with program.when("seen_before > 0.0") as above:
                    program.let(out[0], xi - threshold)
                    with program.otherwise(above):
                        program.let(out[0], -xi - threshold)
                for condition, distances in zip(("==", "!="), rooms, strict=True):
                    with program.when(f"mode[0] {condition} 0.0"):
                        for distance in distances:
                            program.let(room, distance)
                            with program.when("room < margin_out[0]"):
                                program.let(out[0], room)

    # --- The step ---

    def step(self, z: Name, first: Name, last: Name, share: Name) -> None:
        """From row to row, in parts."""
        program = self.program
        begin, end = Name("begin"), Name("end")
        going, to = (
            program.local("going", ()),
            program.local("to", z.shape, program.symbols["to_out"]),
        )
        before, rate = program.local("xi_first", ()), program.local("rate_first", ())
        with program.hidden():
            program.let(begin, ZERO)
            program.let(going, ONE)
        with program.for_each("change", MOST_CHANGES), program.when("going > 0.5", r"\theta_0 < 1"):
            with program.hidden():
                self.look(z, first, last, begin)
                program.let(before, self.xi[0])
                program.let(rate, self.rate[0])
                self.clamp(z)
                self.choose(z)
                program.let(end, ONE)
            program.apply(to, "part", first, last, begin, end, self.mode, z)
            with program.hidden():
                self.judge(to, first, last, end, before)
                self.cut(z, to, first, last, before, rate)
                with program.when("mode[1] > 0.5"):
                    program.let(share, share + end - begin)
            program.let(z, to)
            with program.hidden():
                with program.when("end == 1.0"):
                    program.let(going, ZERO)
                program.let(begin, end)
        with program.hidden():
            self.clamp(z)

    def look(self, at: Name, first: Name, last: Name, place: Name) -> None:
        """Inputs, xi^ and the raw rate at a point."""
        program = self.program
        program.apply(self.row, "inputs_at", first, last, place)
        program.apply(self.xi, "seen", at[self.n], self.row)
        program.apply(self.rate, "raw_rate", at, self.row, self.xi[0])

    def judge(self, at: Name, first: Name, last: Name, place: Name, before: Name) -> None:
        """The mode's margin there."""
        self.look(at, first, last, place)
        given = (at[self.n], self.rate[0], self.xi[0], before, self.mode)
        self.program.apply(self.distance, "margin", *given)

    def clamp(self, z: Name) -> None:
        """The delay in its interval."""
        program, tau = self.program, z[self.n]
        for sign, bound in (("<", self.least), (">", self.most)):
            with program.when(f"z[{self.n}] {sign} {bound.name}"):
                program.let(tau, bound)

    def choose(self, z: Name) -> None:
        """The mode that holds from here on."""
        program, tau = self.program, f"z[{self.n}]"
        program.apply(self.off, "unseen", self.xi[0])
        program.let(self.mode[0], ZERO)
        program.let(self.mode[1], self.off[0])
        with program.when("off[0] < 0.5"):
            for bound, sign, held in (("most", ">", ONE), ("least", "<", -ONE)):
                with program.when(f"{tau} == {bound}"), program.when(f"rate[0] {sign} 0.0"):
                    program.let(self.mode[0], held)

    def cut(self, z: Name, to: Name, first: Name, last: Name, before: Name, rate: Name) -> None:
        """End the part where the mode does, or where a free delay that turns round left it.

        ``before`` and ``rate`` are xi^ and the rate where the part begins.
        """
        program, begin = self.program, Name("begin")
        holds, searching, turning, sign = (
            program.local(name, ()) for name in ("holds", "searching", "turning", "sign")
        )
        program.let(turning, begin + 0.5 * (ONE - begin))
        self.whether_held(holds)
        program.let(searching, ONE - holds)
        program.let(sign, rate * self.rate[0])
        free = ("holds > 0.5", "mode[0] == 0.0", "mode[1] < 0.5", "rate_first != 0.0")
        with (
            program.when(free[0]), program.when(free[1]), program.when(free[2]),
            program.when(free[3]), program.when("sign >= 0.0") as not_turning,
        ):  # fmt: skip
            program.let(searching, ZERO)
            with program.otherwise(not_turning):
                program.let(searching, ONE)
                program.let(turning, begin + (ONE - begin) * rate / (rate - self.rate[0]))
        with program.when(f"change < {MOST_CHANGES - 1}"), program.when("searching > 0.5"):
            self.search(z, to, first, last, before, rate)

    def search(self, z: Name, to: Name, first: Name, last: Name, before: Name, rate: Name) -> None:
        """Go on to the first point beyond the end of the mode; ``turning`` is tried first."""
        program, begin, end = self.program, Name("begin"), Name("end")
        newest, opposite, former = (Name(name, (2,)) for name in ("newest", "opposite", "former"))
        holds, searching, turning = Name("holds"), Name("searching"), Name("turning")
        held, other, both, apart = (
            program.local(name, ())
            for name in ("newest_holds", "opposite_holds", "both_hold", "apart")
        )
        program.let(opposite[0], ONE)
        program.let(opposite[1], self.distance[0])
        program.let(other, holds)
        given = (z[self.n], rate, before, before, self.mode)
        program.apply(self.distance, "margin", *given)
        program.let(newest[0], begin)
        program.let(newest[1], self.distance[0])
        program.let(former, newest)
        self.whether_held(held)
        program.let(end, turning)
        with program.for_each("trial", MOST_TRIALS), program.when("searching > 0.5"):
            program.apply(to, "part", first, last, begin, end, self.mode, z)
            self.judge(to, first, last, end, before)
            self.whether_held(holds)
            with program.when("holds == newest_holds") as same:
                program.let(former, newest)
                with program.otherwise(same):
                    program.let(former, opposite)
                    program.let(opposite, newest)
                    program.let(other, held)
            program.let(newest[0], end)
            program.let(newest[1], self.distance[0])
            program.let(held, holds)
            program.let(both, holds * other)
            program.let(apart, call("fabs", end - opposite[0]))
            with program.when("both_hold > 0.5"):
                program.let(apart, ZERO)
            with program.when(f"apart > {2.0 * NEAREST!r}") as far:
                program.apply(self.trial, "next_trial", newest, opposite, former)
                program.let(end, self.trial[0])
                with program.otherwise(far), program.when("end >= opposite[0]") as beyond:
                    program.let(searching, ZERO)
                    with program.otherwise(beyond):
                        program.let(end, opposite[0])
        program.let(end, newest[0])

    def whether_held(self, holds: Name) -> None:
        """From a mode's margin, which is not a number where the state has left their range."""
        program = self.program
        program.let(holds, ZERO)
        with program.when("distance[0] >= 0.0"):
            program.let(holds, ONE)

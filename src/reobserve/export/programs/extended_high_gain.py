"""The extended high-gain observer: steps in parts, each in one mode of the delay and its gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reobserve.errors import InputError
from reobserve.export.expressions import Expression, Name, call
from reobserve.export.programs.derivatives import SmoothSignal
from reobserve.export.programs.right_hand_sides import right_hand_sides
from reobserve.export.programs.sampling import tell_part
from reobserve.export.statements import ONE, ZERO, Program
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver, State
from reobserve.observers.extended_high_gain_loop import BISECTIONS, MOST_CHANGES
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
        self.good = program.local("good", (1,))
        self.off = program.local("off", (1,))
        program.notes.append(
            r"$\hat z$ holds $\hat x$ and $\hat\tau$; $a$ and $b$ hold $y, u, \dot u, \dots$ of "
            "the row before and of this one, $r$ the same in between, and $G$ last"
        )
        program.notes.append(
            "$m_1$ is 1 or -1 where the delay is held at a bound that it would leave, else 0; $m_2$"
            " is 1 where $\\lvert\\xi\\rvert$ is below its threshold, else 0. A step is cut where "
            "they change, by bisection, and goes on from there; $\\sigma$ is the share of parts "
            "with $m_2 = 1$"
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
            self.holds()

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

    def holds(self) -> None:
        """Whether a mode still holds at a point; ``seen_before`` is xi^ where it began."""
        program, out = self.program, self.program.local("good_out", (1,))
        rate, before = program.local("rate_here", ()), program.local("seen_before", ())
        xi, sign = Name("xi_here"), program.local("sign", ())
        given = (self.delay, rate, xi, before, self.mode)
        with program.function("holds", given, out):
            program.let(out[0], ZERO)
            program.apply(self.off, "unseen", xi)
            program.let(sign, xi * before)
            with program.when("off[0] == mode[1]"), program.when("mode[1] > 0.5") as on:
                program.let(out[0], ONE)
                with program.otherwise(on), program.when("sign < 0.0") as same:
                    program.let(out[0], ZERO)
                    with program.otherwise(same), program.when("mode[0] == 0.0") as held:
                        with program.when("tau >= least"), program.when("tau <= most"):
                            program.let(out[0], ONE)
                        with program.otherwise(held):
                            program.let(sign, self.mode[0] * rate)
                            with program.when("sign >= 0.0"):
                                program.let(out[0], ONE)

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
        """Whether the mode still holds there."""
        self.look(at, first, last, place)
        given = (at[self.n], self.rate[0], self.xi[0], before, self.mode)
        self.program.apply(self.good, "holds", *given)

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
        program, begin, end = self.program, Name("begin"), Name("end")
        low, high = program.local("low", ()), program.local("high", ())
        turns, ends = program.local("turns", ()), program.local("ends", ())
        turning, sign = program.local("turning", ()), Name("sign")
        searching = program.local("searching", ())
        program.let(turns, ZERO)
        program.let(ends, ONE - self.good[0])
        free = ("good[0] > 0.5", "mode[0] == 0.0", "mode[1] < 0.5", "rate_first != 0.0")
        program.let(sign, rate * self.rate[0])
        with (
            program.when(free[0]), program.when(free[1]), program.when(free[2]),
            program.when(free[3]), program.when("sign >= 0.0") as not_turning,
        ):  # fmt: skip
            program.let(turns, ZERO)
            with program.otherwise(not_turning):
                program.let(turns, ONE)
                program.let(ends, ONE)
                program.let(turning, begin + (ONE - begin) * rate / (rate - self.rate[0]))
                with program.when("turning == 1.0"):
                    program.let(turns, ZERO)
        with program.when(f"change < {MOST_CHANGES - 1}"), program.when("ends > 0.5"):
            program.let(low, begin)
            program.let(high, ONE)
            program.let(searching, ONE)
            with program.for_each("halving", BISECTIONS), program.when("searching > 0.5"):
                with program.when("turns > 0.5") as halves:
                    program.let(end, turning)
                    with program.otherwise(halves):
                        program.let(end, 0.5 * (low + high))
                        for condition in ("end <= low", "end >= high"):
                            with program.when(condition):
                                program.let(searching, ZERO)
                with program.when("searching > 0.5"):
                    program.apply(to, "part", first, last, begin, end, self.mode, z)
                    self.judge(to, first, last, end, before)
                    with program.when("good[0] < 0.5") as inside:
                        program.let(high, end)
                        with program.otherwise(inside), program.when("turns > 0.5") as plain:
                            program.let(searching, ZERO)
                            with program.otherwise(plain):
                                program.let(low, end)
                    program.let(turns, ZERO)
            program.let(end, high)
            program.apply(to, "part", first, last, begin, end, self.mode, z)

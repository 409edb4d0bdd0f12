"""Estimators of an input delay: two laws that are integrated in parts of a step, and a relay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reobserve.codegen.expressions import Expression, Name, call
from reobserve.codegen.programs.derivatives import SmoothSignal
from reobserve.codegen.programs.past_input import PastInput
from reobserve.codegen.statements import ONE, ZERO, Program
from reobserve.observers.delay_adaptive import AdaptiveDelayEstimator
from reobserve.observers.delay_estimator import DelayEstimator, State
from reobserve.observers.delay_estimator_loop import BISECTIONS, MOST_CHANGES
from reobserve.observers.delay_least_squares import LeastSquaresDelayEstimator
from reobserve.observers.delay_variable_structure import VariableStructureDelayEstimator

# From values, x, u and u' to the derivatives of the values.
Law = Callable[[Name, Expression, Expression, Expression], list[Expression]]
Columns = tuple[int, int]


def least_squares(observer: LeastSquaresDelayEstimator, state: State, columns: Columns) -> Program:
    """theta, x_m, phi and R."""
    program = Program("Delay by recursive least squares", *columns)
    a, b = _plant(program, observer)
    forgetting = program.constant("forgetting", observer.forgetting, "f")

    def law(v: Name, x: Expression, u: Expression, rate: Expression) -> list[Expression]:
        return [
            v[2] * (x - v[1]) / v[3], b * u - a * v[1], -(a * v[2]) - b * rate,
            v[2] * v[2] - forgetting * v[3],
        ]  # fmt: skip

    symbol = r"(\hat\tau, x_m, \varphi, R)"
    return _integrated(program, observer, state, law, symbol)


def adaptive(observer: AdaptiveDelayEstimator, state: State, columns: Columns) -> Program:
    """theta, x_f, g_f, phi_f, P and Q."""
    program = Program("Delay by filtered regressors", *columns)
    a, b = _plant(program, observer)
    k = program.constant("k", observer.filter_time)
    forgetting = program.constant("forgetting", observer.forgetting, "l")
    gain = program.constant("gain", observer.adaptation_gain, r"\Gamma", gain=True)

    def law(v: Name, x: Expression, u: Expression, rate: Expression) -> list[Expression]:
        filtered = (x - v[1]) / k + a * v[1] - v[2]
        return [
            -(gain * (v[4] * v[0] - v[5])), (x - v[1]) / k, (b * (u + v[0] * rate) - v[2]) / k,
            (-(b * rate) - v[3]) / k, v[3] * v[3] - forgetting * v[4],
            v[3] * filtered - forgetting * v[5],
        ]  # fmt: skip

    symbol = r"(\hat\tau, x_f, g_f, \varphi_f, P, Q)"
    return _integrated(program, observer, state, law, symbol)


def relay(observer: VariableStructureDelayEstimator, state: State, columns: Columns) -> Program:
    """theta, moved by a relay on it or on its inverse that is held over a period."""
    program = Program("Delay by a relay", *columns)
    a, b = _plant(program, observer)
    M = program.constant("M", observer.relay_gain, gain=True)
    started = program.counter("started", int(state.sample is not None))
    before = np.zeros(2) if state.sample is None else state.sample[:2]
    known = 0 if state.sample is None else state.count + 1
    x = SmoothSignal(
        program, "y", program.y, before, state.recent, known, observer.sampling_period
    )  # fmt: skip
    past = PastInput(program, observer, state)
    z = program.remember("z", state.values, r"\hat\tau")
    h, most = Name("h"), Name("most")
    u, w = program.local("u_past", (2,), "v"), program.local("w", ())
    side, sign = program.local("side", (), "s"), program.local("sign", (), r"\sigma")
    x.find()
    past.find()
    with program.when("started == 1", "k > 0"):
        past.append()
        lag, zero = program.local("lag_now", (), r"\ell"), program.local("zero", (), "0")
        program.let(lag, z[0] / h)
        with program.hidden():
            program.let(zero, ZERO)
        program.apply(u, "past", past.cells, past.slot, zero, lag)
        program.let(w, x.before[1] + a * x.before[0])
        program.let(side, (w / b - u[0]) * u[1])
        with program.hidden():
            program.let(sign, ZERO)
            for condition, value in (("side > 0.0", ONE), ("side < 0.0", -ONE)):
                with program.when(condition):
                    program.let(sign, value)
        program.notes.append(r"$\sigma$ is the sign of $s$")
        if observer.relay_on == "inverse":
            inverse, reach = program.local("inverse", (), "v"), program.local("reach", ())
            program.symbols["inverse"] = r"\eta"
            program.let(inverse, ONE / z[0] + M * h * sign)
            with program.hidden():
                program.let(reach, inverse * most)
            with program.when("reach > 1.0", r"\eta\, \tau_{max} > 1") as beyond:
                program.let(z[0], ONE / inverse)
                with program.otherwise(beyond):
                    program.let(z[0], most)
        else:
            program.let(z[0], z[0] - M * h * sign)
        _clamp(program, z)
    _tell(program, z)
    x.keep()
    _finish(program, past, started)
    return program


def _plant(program: Program, observer: DelayEstimator) -> tuple[Name, Name]:
    """Constants that all have."""
    a = program.constant("a", observer.decay)
    b = program.constant("b", observer.input_gain)
    program.constant("h", observer.sampling_period)
    least, most = observer.delay_bounds
    program.constant("least", least, r"\tau_{min}")
    program.constant("most", most, r"\tau_{max}")
    return a, b


def _clamp(program: Program, z: Name) -> None:
    """The delay in its interval."""
    for sign, bound in (("<", "least"), (">", "most")):
        told = rf"\hat\tau {sign} {program.symbols[bound]}"
        with program.when(f"z[0] {sign} {bound}", told):
            program.let(z[0], Name(bound))


def _tell(program: Program, z: Name) -> None:
    program.estimate("delay", z[0])
    program.estimate("values", z)


def _finish(program: Program, past: PastInput, started: Name) -> None:
    past.keep()
    with program.hidden():
        program.set_counter(started, 1)


def _integrated(
    program: Program, observer: DelayEstimator, state: State, law: Law, symbol: str
) -> Program:
    """The classical method, in parts where the delay meets a bound or leaves it."""
    first = 0.0 if state.sample is None else state.sample[0]
    started = program.counter("started", int(state.sample is not None))
    y_before = program.remember("y_before", [first], "y_{k-1}")
    past = PastInput(program, observer, state)
    z = program.remember("z", state.values, "z")
    parts = _Parts(program, past, law, len(state.values))
    past.find()
    with program.when("started == 1", "k > 0"):
        past.append()
        x = program.local("x", (3,), "(y_{k-1}, y_{k-1/2}, y_k)")
        with program.hidden():
            program.let(x[0], y_before[0])
            program.let(x[1], 0.5 * y_before[0] + 0.5 * program.y[0])
            program.let(x[2], program.y[0])
        parts.step(z, x)
    _tell(program, z)
    _finish(program, past, started)
    with program.hidden():
        program.let(y_before, program.y)
    program.notes.append(
        f"$z$ is ${symbol}$; $m$ is 1 or -1 where the delay is held at a bound that it would "
        "leave, else 0. A step is cut where this changes, by bisection, and goes on from there"
    )
    return program


class _Parts:
    """Functions that lead through a part of a step, and the step that is made of them."""

    def __init__(self, program: Program, past: PastInput, law: Law, size: int) -> None:
        self.program, self.size = program, size
        self.past = past.cells, past.slot
        self.begin, self.end = program.local("begin", (), r"\theta_0"), program.local("end", ())
        program.symbols["end"] = r"\theta_1"
        self.held, self.good = program.local("held", (), "m"), program.local("good", (1,))
        self.slopes = [program.local(f"slope_{i}", (size,), f"s_{i}") for i in (1, 2, 3, 4)]
        # What each function is handed: the ring, the present period, x over it.
        self.given = Name("ring", past.cells.shape), Name("present"), program.local("x", (3,))
        self.values = program.local("values", (size,), "z")
        self._slope(law)
        self._part()
        self._stays()

    def _slope(self, law: Law) -> None:
        program, f, x = self.program, Name("fraction"), self.given[2]
        out, u = program.local("slope_out", (self.size,), "s"), program.local("u_past", (2,), "v")
        here, lag = program.local("x_here", (), "x"), program.local("lag_here", (), r"\ell")
        ring, present, _ = self.given
        with program.function("slope", (*self.given, f, self.values), out, "F"):
            early = 2.0 * ((f - 0.5) * (f - 1.0)) * x[0]
            program.let(here, early + 4.0 * (f * (ONE - f)) * x[1] + 2.0 * (f * (f - 0.5)) * x[2])
            program.let(lag, self.values[0] / Name("h"))
            program.apply(u, "past", ring, present, f, lag)
            for i, rate in enumerate(law(self.values, here, u[0], u[1])):
                program.let(out[i], rate)

    def _part(self) -> None:
        program, begin, end, values = self.program, self.begin, self.end, self.values
        out = program.local("part_out", (self.size,), "z^+")
        width, middle = program.local("width", (), r"\delta"), program.local("half", ())
        program.symbols["half"] = r"\theta_{1/2}"
        ahead, s = program.local("ahead", (self.size,), "z'"), self.slopes
        given = (*self.given, begin, end, self.held, values)
        with program.function("part", given, out, "P"):
            program.let(width, (end - begin) * Name("h"))
            program.let(middle, begin + 0.5 * (end - begin))
            program.apply(s[0], "slope", *self.given, begin, values)
            self._hold(s[0])
            for i, (factor, place) in enumerate(((0.5, middle), (0.5, middle), (1.0, end))):
                length: Expression = factor * width if factor < 1.0 else width
                program.let(ahead, values + length * s[i])
                program.apply(s[i + 1], "slope", *self.given, place, ahead)
                self._hold(s[i + 1])
            program.let(out, values + width / 6.0 * (s[0] + 2.0 * s[1] + 2.0 * s[2] + s[3]))

    def _hold(self, slope: Name) -> None:
        with self.program.when("held != 0.0", r"m \ne 0"):
            self.program.let(slope[0], ZERO)

    def _stays(self) -> None:
        """Whether a mode still holds at the end of the part that it has led to."""
        program, f = self.program, Name("fraction")
        out, away = program.local("stays_out", (1,)), program.local("away", ())
        given = (*self.given, f, self.held, self.values)
        with program.hidden(), program.function("stays", given, out):
            program.let(out[0], ONE)
            with program.when("held == 0.0") as held:
                for condition in ("values[0] < least", "values[0] > most"):
                    with program.when(condition):
                        program.let(out[0], ZERO)
                with program.otherwise(held):
                    program.apply(self.slopes[0], "slope", *self.given, f, self.values)
                    program.let(away, self.held * self.slopes[0][0])
                    with program.when("away < 0.0"):
                        program.let(out[0], ZERO)

    def step(self, z: Name, x: Name) -> None:
        """From row to row, in parts; ``x`` over the period is what functions are handed, too."""
        program, begin, end, held = self.program, self.begin, self.end, self.held
        now = (*self.past, x)
        going, to = program.local("going", ()), program.local("to", (self.size,), "z^+")
        with program.hidden():
            program.let(begin, ZERO)
            program.let(going, ONE)
        with program.for_each("change", MOST_CHANGES), program.when("going > 0.5", r"\theta_0 < 1"):
            with program.hidden():
                program.apply(self.slopes[0], "slope", *now, begin, z)
                program.let(held, ZERO)
                for bound, sign, mode in (("<= least", "<", -ONE), (">= most", ">", ONE)):
                    with program.when(f"z[0] {bound}"), program.when(f"slope_1[0] {sign} 0.0"):
                        program.let(held, mode)
                program.let(end, ONE)
            program.apply(to, "part", *now, begin, end, held, z)
            with program.hidden(), program.when(f"change < {MOST_CHANGES - 1}"):
                program.apply(self.good, "stays", *now, end, held, to)
                with program.when("good[0] > 0.5"), program.when("held == 0.0"):
                    self._turned(now, z, to)
                with program.when("good[0] < 0.5"):
                    self._cut(now, z, to)
            program.let(z, to)
            with program.hidden():
                _clamp(program, z)
                with program.when("end == 1.0"):
                    program.let(going, ZERO)
                program.let(begin, end)

    def _turned(self, now: tuple[Name, ...], z: Name, to: Name) -> None:
        """A delay that turns round inside the step may have been outside on the way."""
        program, begin, end = self.program, self.begin, self.end
        room = program.local("room", ())
        reach, product = program.local("reach", ()), program.local("product", ())
        first, last = self.slopes[0][0], self.slopes[1][0]
        program.let(room, z[0] - Name("least"))
        with program.when("slope_1[0] > 0.0"):
            program.let(room, Name("most") - z[0])
        program.let(reach, call("fabs", first) * Name("h"))
        with program.when("room < reach"):
            program.apply(self.slopes[1], "slope", *now, end, to)
            program.let(product, first * last)
            with program.when("product < 0.0"):
                program.let(end, begin + (ONE - begin) * first / (first - last))
                program.apply(to, "part", *now, begin, end, self.held, z)
                program.apply(self.good, "stays", *now, end, self.held, to)
                with program.when("good[0] > 0.5"):
                    program.let(end, ONE)
                    program.apply(to, "part", *now, begin, end, self.held, z)

    def _cut(self, now: tuple[Name, ...], z: Name, to: Name) -> None:
        """End the part where its mode does."""
        program, begin, end = self.program, self.begin, self.end
        low, high = program.local("low", ()), program.local("high", ())
        program.let(low, begin)
        program.let(high, end)
        with program.for_each("halving", BISECTIONS):
            program.let(end, 0.5 * (low + high))
            program.apply(to, "part", *now, begin, end, self.held, z)
            program.apply(self.good, "stays", *now, end, self.held, to)
            with program.when("good[0] > 0.5") as inside:
                program.let(low, end)
                with program.otherwise(inside):
                    program.let(high, end)
        program.let(end, high)
        program.apply(to, "part", *now, begin, end, self.held, z)

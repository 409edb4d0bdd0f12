"""Delayed inputs and the gate of banks of filters, in C."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from reobserve.codegen.expressions import Name
from reobserve.codegen.program import Program
from reobserve.codegen.programs import linear
from reobserve.codegen.programs.rules import FilterRules
from reobserve.observers.grid_filter import GridFilter
from reobserve.observers.imm import ImmState


class DelayedInputs(linear.Inputs):
    """The inputs of rows before, of which each mode has those of its own delay."""

    def __init__(self, program: Program, observer: GridFilter, state: ImmState) -> None:
        late = observer.periods_late
        assert late is not None
        self.program, p = program, observer.inputs
        deepest = int(late.max()) + 1
        self.started = program.counter("started", 0 if state.sample is None else 1)
        past = np.zeros((deepest + 1, p))
        if state.sample is not None:
            before = np.repeat(state.sample[None, observer.measurements :], deepest, axis=0)
            past[:-1] = before if state.past is None else state.past
            past[-1] = state.sample[observer.measurements :]
        self.past = program.remember("past", past)  # the latest input last
        self.held = self.past
        self.late = program.constant("periods_late", late)
        self.pair = program.local("held_input", (2 * p,))
        self.deepest, self.size = deepest, p

    def of_mode(self, mode: str) -> Name:
        """u(k-d) and u(k-d-1) of a mode."""
        program, p = self.program, self.size
        program.line(f"const int32_t late = (int32_t){self.late[mode]};")
        with program.for_each("row", p) as row:
            for place, extra in ((f"{row}", ""), (f"{p} + {row}", " - 1")):
                at = f"{self.deepest} - late{extra}"
                program.let(self.pair[place], self.past[at, row])
        return self.pair

    @contextmanager
    def moves(self) -> Iterator[None]:
        """The step to a row that is not the first, before which its own input was held."""
        program = self.program
        with program.when(f"{self.started} == 1"):
            yield
        with (
            program.when(f"{self.started} == 0"),
            program.for_each("place", self.deepest + 1) as place,
            program.for_each("row", self.size) as row,
        ):
            program.let(self.past[place, row], program.u[row])
        program.line(f"{self.started} = 1;")

    def keep(self) -> None:
        """The input of this row, for the next."""
        program = self.program
        with program.for_each("place", self.deepest) as at, program.for_each("row", self.size) as i:
            program.let(self.past[at, i], self.past[f"{at} + 1", i])
        with program.for_each("row", self.size) as row:
            program.let(self.past[self.deepest, row], program.u[row])


_LEAST_DEVIATIONS = """\
for (int32_t o = 0; o < {p}; ++o) {{
    double least = INFINITY;
    for (int32_t mode = 0; mode < {r}; ++mode) {{
        double off = y[o]{fed};
        double variance = {noise};
        for (int32_t a = 0; a < {n}; ++a) {{
            off -= C[mode][o][a] * {means}[mode][a];
            for (int32_t b = 0; b < {n}; ++b) {{
                variance += C[mode][o][a] * {P}[mode][a][b] * C[mode][o][b];
            }}
        }}
        if (periods[o] > 0.0) {{
            off -= periods[o] * floor(off / periods[o] + 0.5);
        }}
        const double deviations = off / sqrt(variance);
        if (!(fabs(deviations) >= fabs(least))) {{
            least = deviations;
        }}
    }}
    {outlier}[o] = 0.0;
    if (fabs(least) > {gate}) {{
        {outlier}[o] = least;
        {taken}[o] = NAN;
    }}
}}
"""


def gate_of_bank(
    program: Program, gate: float, models: dict[str, Name], means: Name, covariances: Name,
    rules: FilterRules,
) -> None:  # fmt: skip
    """Write measurements that are not beyond the gates of all filters, in place of y."""
    (r, n), p = means.shape, program.measurements
    taken = program.local("within_gate", (p,))
    program.let(taken, program.y)
    program.constant("periods", rules.outputs)
    feed = "".join(f" - D[mode][o][{i}] * u[{i}]" for i in range(program.inputs))
    program.code(
        rules.outlier, _LEAST_DEVIATIONS, p=p, r=r, n=n, gate=gate, means=means, P=covariances,
        noise=rules.variances["o"] if rules.forgetting else Name("R[mode][o][o]"),
        fed=Name(feed if "D" in models else ""), outlier=rules.outlier, taken=taken,
    )  # fmt: skip
    program.y = taken

"""What observers of one step a sampling period share: the row before, and who steps from it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from reobserve.codegen.expressions import Name
from reobserve.codegen.statements import Program


class Rows:
    """Remembers y and u of the row before; ``moves`` holds the statements of a step from it."""

    def __init__(self, program: Program, state: Any) -> None:
        p, m, sample = program.measurements, program.inputs, state.sample
        self.program, self.begun = program, sample is not None
        last = np.zeros(p + m) if sample is None else np.asarray(sample)
        self.started = program.counter("started", int(self.begun))
        self.y_before = program.remember("y_before", last[:p], "y_{k-1}")
        self.u_before = program.remember("u_before", last[p:], "u_{k-1}") if m else None

    @contextmanager
    def moves(self) -> Iterator[None]:
        """The step to a row that is not the first."""
        with self.program.when("started == 1", "k > 0"):
            yield

    def keep(self) -> None:
        """Remember the row; the last statements of a program."""
        with self.program.hidden():
            self.program.set_counter(self.started, 1)
            self.program.let(self.y_before, self.program.y)
            if self.u_before is not None:
                self.program.let(self.u_before, self.program.u)


def tell_part(program: Program, name: str, values: Name, first: int, last: int) -> None:
    """An estimate that is a part of a vector."""
    whole = program.symbols[values.name]
    span = f"{first + 1}, \\dots, {last}" if last > first + 1 else str(last)
    told = program.local(f"{name}_part", (last - first,), f"({whole})_{{{span}}}")
    with program.hidden():
        for place in range(first, last):
            program.let(told[place - first], values[place])
    program.estimate(name, told)


def runge_kutta(
    program: Program,
    slope: str,
    x: Name,
    stages: tuple[tuple[Name, ...], tuple[Name, ...], tuple[Name, ...]],
    step: float,
    symbol: str = r"\hat x",
) -> None:
    """The classical method; ``stages`` are the other arguments at start, middle and end."""
    h = program.constants.get("h")
    size = Name("h") if h is not None else program.constant("h", step)
    kept = [program.local(f"slope_{i}", x.shape, f"s_{i}") for i in (1, 2, 3, 4)]
    ahead = program.local("ahead", x.shape, rf"{symbol}^+")
    program.apply(kept[0], slope, x, *stages[0])
    for i, (factor, place) in enumerate(((0.5, 1), (0.5, 1), (1.0, 2)), start=1):
        program.let(ahead, x + (factor * size if factor != 1.0 else size) * kept[i - 1])
        program.apply(kept[i], slope, ahead, *stages[place])
    program.let(x, x + size / 6.0 * (kept[0] + 2.0 * kept[1] + 2.0 * kept[2] + kept[3]))

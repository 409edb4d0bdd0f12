"""Steps from the row before to this one, and the classical Runge-Kutta method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from reobserve.codegen.expressions import Expression, Name
from reobserve.codegen.program import Program


class RowBuffer:
    """Remembers y and u of the row before. ``moves`` holds the statements of a step from it."""

    def __init__(self, program: Program, state: Any) -> None:
        p, m, sample = program.measurements, program.inputs, state.sample
        self.program = program
        last = np.zeros(p + m) if sample is None else np.asarray(sample)
        self.started = program.counter("started", int(sample is not None))
        self.y_before = program.remember("y_before", last[:p])
        self.u_before = program.remember("u_before", last[p:]) if m else None

    @contextmanager
    def moves(self) -> Iterator[None]:
        """The step to a row that is not the first."""
        with self.program.when(f"{self.started} == 1"):
            yield

    def start_from(self, target: Name, measured: Name) -> None:
        """Start a part of the state from the first measurement."""
        with self.program.when(f"{self.started} == 0"):
            self.program.let(target, measured)

    def y_middle(self) -> Name:
        """The measurement half-way between the rows."""
        program = self.program
        middle = program.local("y_middle", (program.measurements,))
        return program.let(middle, 0.5 * self.y_before + 0.5 * program.y)

    def keep(self) -> None:
        """Remember the row, as the last statements of a program."""
        self.program.line(f"{self.started} = 1;")
        self.program.let(self.y_before, self.program.y)
        if self.u_before is not None:
            self.program.let(self.u_before, self.program.u)


def runge_kutta(
    program: Program,
    slope: str,
    x: Name,
    stages: Sequence[tuple[Name, ...]],
    step: Expression,
    into: Name | None = None,
) -> None:
    """One step of the classical method.

    ``slope`` is a function of the program; its arguments after x at the start, the middle and the
    end are the ``stages``. The result replaces x unless it goes ``into`` another variable.
    """
    s_1, s_2, s_3, s_4 = (program.local(f"slope_{i}", x.shape) for i in (1, 2, 3, 4))
    ahead = program.local("ahead", x.shape)
    start, middle, end = stages
    program.apply(s_1, slope, x, *start)
    program.let(ahead, x + 0.5 * step * s_1)
    program.apply(s_2, slope, ahead, *middle)
    program.let(ahead, x + 0.5 * step * s_2)
    program.apply(s_3, slope, ahead, *middle)
    program.let(ahead, x + step * s_3)
    program.apply(s_4, slope, ahead, *end)
    program.let(into or x, x + step / 6.0 * (s_1 + 2.0 * s_2 + 2.0 * s_3 + s_4))

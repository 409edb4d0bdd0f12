"""A signal with its derivatives, which come in columns of their own or are found from samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Name
from reobserve.codegen.program import Program
from reobserve.observers.row_derivatives import derivative_weights

Array = NDArray[np.float64]


class SmoothSignal:
    """Statements that make ``now`` and ``before``, at a row and at the one before it.

    Parameters
    ----------
    program, name
        The program, and what the signal is called in it.
    given
        The columns of the row: all n + 1, or the signal alone.
    before
        The row before, shape (n + 1,).
    recent, known
        The signal at the n + 1 samples before the row, the latest last, shape (n + 1,), and how
        many of them were taken.
    period
        The sampling period [s].
    """

    def __init__(
        self, program: Program, name: str, given: Name, before: Array, recent: Array, known: int,
        period: float,
    ) -> None:  # fmt: skip
        self.program, self.given = program, given
        self.order = order = len(before) - 1
        self.alone = given.shape[0] == 1 and order > 0
        self.before = program.remember(f"{name}_before", before)
        self.now = given
        if not self.alone:
            return
        self.now = program.local(f"{name}_now", (order + 1,))
        self.recent = program.remember(f"{name}_recent", recent[::-1])
        self.known = program.counter(f"{name}_known", min(known, order + 1))
        # The polynomial through the latest samples, for as many as there are.
        weights = np.zeros((order + 2, order, order + 2))
        for points in range(1, order + 3):
            scaled = derivative_weights(points, order) / period ** np.arange(1.0, order + 1)
            weights[points - 1, :, :points] = scaled.T
        self.weights = program.constant(f"{name}_weights", weights)
        self.samples = program.local(f"{name}_samples", (order + 2,))
        self.rates = program.local(f"{name}_rates", (order,))

    def find(self) -> None:
        """The derivatives at the row, and those of the first row from the second."""
        if not self.alone:
            return
        program, given = self.program, self.given
        program.let(self.samples[0], given[0])
        for place in range(self.order + 1):
            program.let(self.samples[place + 1], self.recent[place])
        program.let(self.rates, self.weights[self.known] @ self.samples)
        program.let(self.now[0], given[0])
        for place in range(self.order):
            program.let(self.now[place + 1], self.rates[place])
        with program.when(f"{self.known} == 1"):
            for place in range(self.order):
                program.let(self.before[place + 1], self.rates[place])

    def keep(self) -> None:
        """Remember the row, among the last statements of a program."""
        program = self.program
        program.let(self.before, self.now)
        if not self.alone:
            return
        for place in reversed(range(self.order)):
            program.let(self.recent[place + 1], self.recent[place])
        program.let(self.recent[0], self.given[0])
        with program.when(f"{self.known} < {self.order + 1}"):
            program.advance(self.known)

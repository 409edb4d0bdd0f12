"""The line that says on a terminal that a long compilation is under way."""

from __future__ import annotations

import io
import sys
import time
from typing import Any

import numpy as np
import pytest

from reobserve.core import compile_notice
from reobserve.core.kernel import inlined_kernel, kernel


class Screen(io.StringIO):
    """A terminal, or a file."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


def compiled_afresh() -> None:
    """Compile a kernel that calls another one, and run it again."""

    @inlined_kernel
    def inner(x: Any) -> float:
        total = 0.0
        for value in x:
            total += np.sin(value)
        return total

    @kernel
    def outer(x: Any) -> float:
        return inner(x) + inner(x)

    outer(np.ones(3))
    outer(np.ones(3))


@pytest.mark.parametrize(
    ("terminal", "seconds", "lines"), [(True, 1e-3, 1), (False, 1e-3, 0), (True, 60.0, 0)]
)
def test_long_compilation_says_so_once(
    terminal: bool, seconds: float, lines: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Screen(terminal)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(compile_notice, "_LONG", seconds)
    compiled_afresh()
    time.sleep(0.05)
    assert screen.getvalue().count("compiling the loop") == lines
    assert screen.getvalue().count("\n") == lines

"""The errors a user can cause, each one sentence that says what to change."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class ReobserveError(Exception):
    """An error with a message for the user; the command line prints it without a traceback."""


class InputError(ReobserveError, ValueError):
    """A parameter, a config entry or a data file is not what it must be.

    Parameters
    ----------
    parameter
        The parameter, config key or file that is wrong.
    problem
        What it is, and what is allowed: the rest of the sentence.
    """

    def __init__(self, parameter: str, problem: str) -> None:
        super().__init__(f"{parameter}: {problem}")
        self.parameter = parameter
        self.problem = problem


class DivergenceError(ReobserveError, ArithmeticError):
    """A simulation left the range of floating-point numbers.

    Parameters
    ----------
    what
        The plant or observer that diverged.
    time
        The last time [s] at which its state was finite.
    """

    def __init__(self, what: str, time: float) -> None:
        super().__init__(f"{what} diverged: its state is finite up to t = {time:g} s and not after")
        self.what = what
        self.time = time


@contextmanager
def located(place: str) -> Iterator[None]:
    """Put the config key ``place`` before the parameter that an `InputError` inside names."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}.{error.parameter}", error.problem) from None
    except DivergenceError as error:
        raise DivergenceError(f"{place} ({error.what})", error.time) from None

"""The errors a user can cause, each one sentence that says what to change."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# Characters of a message that a value, a place or a whole sentence may take.
_VALUE = 100
_PLACE = 300
_SENTENCE = 600


def one_line(text: object, most: int = _SENTENCE) -> str:
    """Text on one line, what cannot be printed escaped, its middle left out where it is long."""
    told = "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in " ".join(str(text).split())
    )
    if len(told) <= most:
        return told
    tail = most // 3
    return f"{told[: most - tail - 3]} … {told[-tail:]}"


def shown(value: Any, most: int = _VALUE) -> str:
    """A value as a message repeats it: bounded, whatever a user wrote."""
    try:
        return one_line(repr(value), most)
    except (ValueError, RecursionError):  # an integer of thousands of digits, or a deep tree
        return f"a {type(value).__name__} too large to show"


class ReobserveError(Exception):
    """An error with a message for the user; the command line prints it without a traceback."""


class InputError(ReobserveError, ValueError):
    """A parameter, a config entry or a data file is not what it must be.

    Parameters
    ----------
    parameter
        The parameter, config key or file that is wrong.
    problem
        What it is, and what is allowed: the rest of the sentence. Both are kept to one line and to
        some hundred characters, whatever of a user's text they repeat.
    """

    def __init__(self, parameter: str, problem: str) -> None:
        self.parameter = one_line(parameter, _PLACE)
        self.problem = one_line(problem)
        super().__init__(f"{self.parameter}: {self.problem}")


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

"""The errors a user can cause, each one sentence that says what to change."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from reprlib import Repr

_MOST_SHOWN = 100  # characters of a value that is refused
_MOST_SAID = 400  # characters of a key, and of what is said of it

_brief = Repr()
_brief.maxlevel, _brief.maxlist, _brief.maxtuple, _brief.maxdict = 4, 8, 8, 8
_brief.maxstring = _brief.maxother = _brief.maxlong = _MOST_SHOWN - 2


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
        self.parameter = shortened(parameter, _MOST_SAID)
        self.problem = shortened(problem, _MOST_SAID)
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


def shown(value: object) -> str:
    """``value`` as a message shows it: on one line, and cut in the middle where it is long."""
    try:
        return shortened(_brief.repr(value), _MOST_SHOWN)
    except ValueError:  # a whole number of thousands of digits
        return f"<{type(value).__name__}>"


def shortened(text: str, most: int) -> str:
    """``text`` on one line, its middle left out where it has more than ``most`` characters."""
    if len(text) > 10 * most:
        text = f"{text[: 5 * most]} {text[-5 * most :]}"
    line = " ".join(text.split()) if "\n" in text or "\r" in text else text
    if len(line) <= most:
        return line
    half = (most - 3) // 2
    return f"{line[:half]}...{line[-half:]}"

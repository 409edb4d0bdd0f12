"""The errors a user can cause, each one sentence that says what to change."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# A sentence longer than this is cut in the middle: its ends say what is wrong and what is allowed.
_LONGEST = 800


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
        parameter, problem = shortened(parameter), shortened(problem)
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
        The last time [s] at which its state was finite; of a filter, which knows no period, the
        number of the first sample, counted from 0, after which its belief is not.
    finding
        What else is known: whether a shorter step would have done.
    sample
        ``time`` is the number of a sample.
    """

    def __init__(self, what: str, time: float, finding: str = "", *, sample: bool = False) -> None:
        said = f"{what} diverged: its state is finite up to t = {time:g} s and not after"
        if sample:
            said = f"{what} diverged: its belief is not finite from sample {time:g} on"
        super().__init__(f"{said}; {finding}" if finding else said)
        self.what = what
        self.time = time
        self.finding = finding
        self.sample = sample


@contextmanager
def located(place: str) -> Iterator[None]:
    """Put the config key ``place`` before the parameter that an `InputError` inside names."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}.{error.parameter}", error.problem) from None
    except DivergenceError as error:
        raise DivergenceError(
            f"{place} ({error.what})", error.time, error.finding, sample=error.sample
        ) from None


def shown(value: Any) -> str:
    """A value as a message shows it: in one line, of a hundred characters at most.

    Of objects that may be long it names the type and, of arrays, the shape.
    """
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and (len(shape) > 1 or shape > (8,)):
        return f"{type(value).__name__} of shape {shape}"
    if not isinstance(value, _BUILT_IN):
        plain = value is None or shape is not None
        return shortened(repr(value), 100) if plain else f"an object of type {type(value).__name__}"
    try:
        return shortened(_SHORT.repr(value), 100)
    except (ValueError, RecursionError):  # a whole number of thousands of digits
        return f"a {type(value).__name__} too long to show"


_BUILT_IN = (bool, int, float, complex, str, bytes, list, tuple, dict, set)
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 80
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = _SHORT.maxset = 8


def shortened(text: str, longest: int = _LONGEST) -> str:
    """The text in one line, its middle replaced by dots if it is too long."""
    line = " ".join(str(text).splitlines())
    half = longest // 2
    return line if len(line) <= longest else f"{line[:half]} ... {line[-half:]}"

"""The errors a user can cause, each one sentence that says what to change."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

# Characters of a message that a value, a place or a whole sentence may take.
_VALUE = 100
_PLACE = 300
_SENTENCE = 600


class ReobserveError(Exception):
    """An error with a message for the user. The command line prints it without a traceback."""


class InputError(ReobserveError, ValueError):
    """A parameter, a config entry or a data file is not what it must be.

    Parameters
    ----------
    parameter
        The parameter, config key or file that is wrong.
    problem
        What it is, and what is allowed: the rest of the sentence. Both are kept to one line and to
        some hundred characters, whatever of a user's text they repeat.

    Examples
    --------
    >>> from reobserve import KalmanFilter
    >>> KalmanFilter("model")
    Traceback (most recent call last):
        ...
    reobserve.core.errors.InputError: model: 'model' must be of type LinearModel
    """

    def __init__(self, parameter: str, problem: str) -> None:
        self.parameter = one_line(parameter, _PLACE)
        self.problem = one_line(problem)
        super().__init__(f"{self.parameter}: {self.problem}")

    def renamed(self, parameter: str) -> InputError:
        """The same problem, of what a caller calls the parameter."""
        return InputError(parameter, self.problem)


class ProblemsError(InputError):
    """All ``problems`` of an input, of which the first one has its parameter and its problem."""

    def __init__(self, problems: Sequence[InputError]) -> None:
        self.problems = problems
        super().__init__(problems[0].parameter, problems[0].problem)

    def __str__(self) -> str:
        lines = [[str(one), *getattr(one, "__notes__", ())] for one in self.problems]
        return "\n".join("\n  ".join(part) for part in lines)


class DivergenceError(ReobserveError, ArithmeticError):
    """A simulation left the range of floating-point numbers.

    Parameters
    ----------
    what
        The plant or observer that diverged.
    time
        The last time [s] at which its state was finite.
    finding
        What else is known, such as a step that may be too long.

    Examples
    --------
    >>> from reobserve import DivergenceError, KalmanFilter, LinearModel
    >>> kalman = KalmanFilter(LinearModel([[1e200]], C=[[1]], Q=1, R=1))
    >>> try:
    ...     kalman.run([0.0, 0.0, 0.0], start=kalman.init([0.0], 1.0))
    ... except DivergenceError as error:
    ...     print(error.what, error.time)
    KalmanFilter 0.0
    """

    def __init__(self, what: str, time: float, finding: str = "") -> None:
        said = f"{what} diverged: its state is finite up to t = {time:g} s and not after"
        super().__init__(f"{said}; {finding}" if finding else said)
        self.what = what
        self.time = time
        self.finding = finding


@contextmanager
def located(place: str, mark: str = ".") -> Iterator[None]:
    """Put a key, or a file and its mark, before the parameter that an `InputError` inside names."""
    try:
        yield
    except InputError as error:
        key = f"{place}{mark}{error.parameter}" if error.parameter else place
        raise error.renamed(key) from None
    except DivergenceError as error:
        raise DivergenceError(f"{place} ({error.what})", error.time, error.finding) from None


def one_line(text: object, most: int = _SENTENCE) -> str:
    """Text on one line, what cannot be printed escaped, its middle left out where it is long."""
    try:
        spelled = str(text)
    except Exception:  # of an object of the user's own
        spelled = f"a {type(text).__name__} that cannot be shown"
    text = "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in " ".join(spelled.split())
    )
    if len(text) <= most:
        return text
    tail = most // 3
    return f"{text[: most - tail - 3]} … {text[-tail:]}"


def shown(value: Any, most: int = _VALUE) -> str:
    """A value as a message repeats it: in one line and bounded, whatever a user wrote.

    Of objects that may be long it names the type and, of arrays, the shape.
    """
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and (len(shape) > 1 or shape > (8,)):
        return f"{type(value).__name__} of shape {shape}"
    if not isinstance(value, _BUILT_IN):
        plain = value is None or shape is not None
        return one_line(repr(value), most) if plain else f"an object of type {type(value).__name__}"
    try:
        return one_line(_SHORT.repr(value), most)
    except (ValueError, RecursionError):  # an integer of thousands of digits, or a deep tree
        return f"a {type(value).__name__} too large to show"
    except Exception:  # of what it holds: a repr of the user's own may raise anything
        return f"a {type(value).__name__} that cannot be shown"


def nearest(key: str, known: Any) -> str:
    """The end of a sentence about an unknown name."""
    names = [str(name) for name in known]
    close = difflib.get_close_matches(str(key)[:100], names, n=1, cutoff=0.5)
    listed = ", ".join(names) if names else "none"
    return f"; did you mean {close[0]!r}?" if close else f"; there are: {listed}"


_BUILT_IN = (bool, int, float, complex, str, bytes, list, tuple, dict, set)
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 80
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = _SHORT.maxset = 8

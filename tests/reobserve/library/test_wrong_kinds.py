"""A wrong type for any argument of any public class or function is refused naming the argument."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.errors import InputError
from tests.reobserve.library.calls import Call, calls


class Nothing:
    """Neither number, nor word, nor model, nor anything else that a call could use."""


# The name that a call uses in place of the parameter's.
SAID = {
    "terms": "fault",  # name of the signal
    "value": "x",  # name given by the caller
    "name": "kind",  # of design, as above
    "text": "poles",  # as above
    "step": "sampling_period",  # of the constructed observer
    "faults": "fault_matrix",  # all four are matrices
    "matrix": "values",
}


def parameters(call: Call) -> Iterator[str]:
    """The names of the arguments; empty for those known by position only."""
    for parameter in inspect.signature(call.function).parameters.values():
        if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
            break
        yield parameter.name
    while True:
        yield ""


def refused(call: Call, place: int, parameter: str) -> bool:
    """Whether a call with one argument of a wrong type names that argument."""
    arguments: list[Any] = list(call.arguments)
    arguments[place] = Nothing()
    try:
        call.function(*arguments)
    except InputError as error:
        wanted = {parameter, SAID.get(parameter, parameter)}
        return not parameter or not wanted.isdisjoint(error.parameter.split("."))
    except Exception:
        return False
    return False


def not_refused(every: Mapping[str, Call], labels: Mapping[str, str]) -> list[str]:
    """Arguments that accept anything; ``labels`` are texts that are only printed."""
    wrong = []
    for name, call in every.items():
        call.function(*call.arguments)  # everything else is valid
        named = zip(range(len(call.arguments)), parameters(call), strict=False)
        wrong += [
            f"{name}: {parameter or place + 1}"
            for place, parameter in named
            if labels.get(name) != parameter and not refused(call, place, parameter)
        ]
    return wrong


def test_argument_of_wrong_type_is_refused_naming_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A single test, since the shared preparation is made once."""
    monkeypatch.chdir(tmp_path)  # some write a file
    assert not_refused(calls(), {}) == []

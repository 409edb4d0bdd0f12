"""Whole numbers and shapes of arrays of public calls have bounds: no crash, no memory without end.

The calls run with a gigabyte more than is in use; a `MemoryError` fails.
"""

from __future__ import annotations

import contextlib
import inspect
import pkgutil
import re
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve import (
    KalmanFilter,
    LinearModel,
    rts_smoother,
    tune,
)
from reobserve.core.arguments import MOST_COUNTED, as_poles
from reobserve.core.errors import InputError, ReobserveError
from reobserve.core.matrices import as_floats, as_numbers, as_samples
from tests.reobserve.bad_input.outcome import limited_memory

from .calls import calls
from .test_docstrings import PUBLIC
from .test_wrong_kinds import parameters

BEYOND = [MOST_COUNTED + 1, 2**32, 2**63 - 2, 2**63 - 1, 2**63, 2**64 - 1, 2**64, 2**128 + 1]
KALMAN = KalmanFilter(LinearModel([[1]], C=[[1]], Q=1, R=1))
RUN = KALMAN.run(np.arange(50.0), start=KALMAN.init([0], 1))
MANY = KALMAN.run(np.zeros((2, 5, 1)), start=KALMAN.init([0], 1))

# Whole numbers that the calls of `calls` leave out.
OTHERS: dict[str, Callable[[Any], object]] = {
    "observers.run.Run.record: number": MANY.record,
    "systems.linear.LinearModel.by_row: rows": lambda n: KALMAN.model.by_row(
        {"Q": [[[1.0]]]}, n, {}, None
    ),
    "tuning.search.Tuned.after: evaluations": lambda n: tune(
        lambda found: found, {"a": (1.0, 2.0)}, [0], lambda *_: 1.0, budget=1
    ).after(n),
}
LABELS = {"observers.run.Run.labels: index"}  # of components, not a size
SEEDS = ("seed",)  # which may be greater


def public() -> Iterator[Any]:
    """Exported names and what has an entry in `calls`, with their public methods."""
    found = set(PUBLIC)
    for name in calls():
        with contextlib.suppress(AttributeError):
            found.add(pkgutil.resolve_name(f"reobserve.{name.partition(',')[0]}"))
    for one in found:
        yield one
        if inspect.isclass(one):
            yield from (getattr(one, name) for name in dir(one) if not name.startswith("_"))


def whole_numbers() -> set[str]:
    """Parameters of public functions that are annotated as whole numbers."""
    found = set()
    for one in public():
        if callable(one) and getattr(one, "__module__", "").startswith("reobserve"):
            name = f"{one.__module__.partition('.')[2]}.{one.__qualname__}"
            for parameter in inspect.signature(one).parameters.values():
                if re.search(r"\bint\b", str(parameter.annotation)):
                    found.add(f"{name}: {parameter.name}")
    return found - LABELS


@cache
def whole_number_calls() -> dict[str, Callable[[Any], object]]:
    """A call for each of them by its value."""
    found = dict(OTHERS)
    for call in calls().values():
        for at, (name, _) in enumerate(zip(parameters(call), call.arguments, strict=False)):

            def replaced(value: Any, call: Any = call, at: int = at) -> object:
                return call.function(*call.arguments[:at], value, *call.arguments[at + 1 :])

            found[f"{call.name.partition(',')[0]}: {name}"] = replaced
    return found


def attempt(function: Callable[[], object]) -> bool:
    """True if a call returns, False if it is refused; no other error and no large memory."""
    with limited_memory(2**30), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            function()
        except ReobserveError:
            return False
    return True


def test_every_whole_number_of_a_public_function_has_a_call() -> None:
    assert sorted(whole_numbers() - set(whole_number_calls())) == []


def check_whole_number(name: str) -> None:
    """Call with numbers at the limit of counts and beyond."""
    call, last = whole_number_calls()[name], name.rpartition(" ")[2]
    if last not in ("rows", *SEEDS):
        for value in BEYOND:
            assert not attempt(lambda value=value: call(value)), (name, value)
    for value in (MOST_COUNTED - 1, MOST_COUNTED, -1, -(2**63), -(2**64), 10**400):
        attempt(lambda value=value: call(value))


def test_whole_numbers_are_refused_beyond_the_limit() -> None:
    code = f"from {__name__} import *\nfor name in sorted(whole_numbers()):\n"
    code += "    print(name, flush=True)\n    check_whole_number(name)\n"
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-60:] + done.stderr[-2000:]


@given(st.integers(1, 200) | st.integers() | st.sampled_from(BEYOND))
def test_lag_is_within_the_record(lag: int) -> None:
    if lag in range(1, len(RUN) + 1):
        late = rts_smoother(RUN, lag=lag)
        assert late["variance"].min() > 0
        whole = rts_smoother(RUN)
        assert np.array_equal(late["state"][-1 - lag :], whole["state"][-1 - lag :])
    else:
        with pytest.raises(InputError, match=r"^lag: .* must be a whole number, from 1 to 50$"):
            rts_smoother(RUN, lag=lag)


@pytest.mark.parametrize("function", [as_numbers, as_floats])
def test_arrays_larger_than_their_memory_have_a_limit(function: Any) -> None:
    base = np.arange(1000.0)
    for small in (np.broadcast_to(0.0, 10**5), range(1000), base[::2], base.reshape(10, -1).T):
        assert np.array_equal(function("x", small), small)
    for large in (
        np.broadcast_to(0.0, 10**7 + 1),
        np.broadcast_to(base, (10**5, 1000)),
        np.lib.stride_tricks.sliding_window_view(np.zeros(2 * 10**6), 10**6),
        range(10**7 + 1),
    ):
        with pytest.raises(InputError, match=r"^x: of shape \(.+\) is too large for memory"):
            function("x", large)
        with pytest.raises(InputError, match=r"^x: "):
            as_samples("x", large, 1)
    with pytest.raises(InputError, match="too large for memory, above 1 GiB"):
        as_floats("x", np.zeros(2**27 + 1))
    with pytest.raises(InputError, match="must have 1000 numbers or fewer"):
        as_poles("x", np.zeros(1001))

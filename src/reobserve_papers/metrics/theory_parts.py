"""Parts of a theory: while claims are sampled, only those are computed that are asked for.

A theory is some thousand runs and solutions behind a few hundred numbers, of which a claim needs
one or two, in every sample. Which numbers a part gives is remembered when all of it is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import ParamSpec

from reobserve_papers.metrics.metrics import Metric

Parameters = ParamSpec("Parameters")

_ASKED: ContextVar[frozenset[str] | None] = ContextVar("asked", default=None)
_GIVES: dict[Callable[..., Iterable[Metric]], set[str]] = {}


def part(
    function: Callable[Parameters, Iterable[Metric]],
) -> Callable[Parameters, tuple[Metric, ...]]:
    """A function that gives metrics, or none where nobody asks for one of their names."""

    @wraps(function)
    def computed(*args: Parameters.args, **kwargs: Parameters.kwargs) -> tuple[Metric, ...]:
        asked = _ASKED.get()
        if asked is not None and function in _GIVES and not asked & _GIVES[function]:
            return ()
        metrics = tuple(function(*args, **kwargs))
        if asked is None:
            _GIVES.setdefault(function, set()).update(metric.metric for metric in metrics)
        return metrics

    return computed


@contextmanager
def only(names: Iterable[str] | None) -> Iterator[None]:
    """Compute parts, where those without any of these metrics may give nothing, None for all."""
    token = _ASKED.set(None if names is None else frozenset(names))
    try:
        yield
    finally:
        _ASKED.reset(token)

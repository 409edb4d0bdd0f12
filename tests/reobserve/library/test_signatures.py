"""Signatures of observers and models: every argument has a name and a type, and shows in help."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import reobserve
from reobserve import KalmanFilter, LinearModel, NonlinearModel
from reobserve.observers.contract import Observer

# What may be given by position: a model or what makes one (with Q and R a nonlinear one),
# measurements and inputs, a state or what makes one.
BY_POSITION = {
    "model", "system", "normal_form", "filters", "transition", "make",
    "A", "B", "C", "D", "f", "h", "Q", "R",
    "y", "u",
    "state", "start", "posterior", "mean", "covariance", "rate", "estimate", "derivatives",
}  # fmt: skip
METHODS = ("__init__", "init", "run", "step", "predict", "correct")


def _derived(kind: type[Any]) -> Iterator[type[Any]]:
    for each in kind.__subclasses__():
        yield each
        yield from _derived(each)


KINDS: dict[str, type[Any]] = {"LinearModel": LinearModel, "NonlinearModel": NonlinearModel}


def _callables() -> dict[str, Callable[..., Any]]:
    """Constructors and methods of all observers of the library, and of models from equations."""
    for module in pkgutil.walk_packages(reobserve.__path__, "reobserve."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    found: dict[str, Callable[..., Any]] = {
        f"{model.__name__}.{name}": getattr(model, name)
        for model in (LinearModel, NonlinearModel) for name in ("__init__", "from_ode")
    }  # fmt: skip
    for kind in _derived(Observer):
        base = inspect.isabstract(kind) or (kind.__doc__ or "").startswith("Base class")
        if kind.__module__.startswith("reobserve.") and not base:
            made = [name for name, value in vars(kind).items() if isinstance(value, classmethod)]
            for name in (*METHODS, *made):
                if hasattr(kind, name):
                    KINDS[kind.__qualname__] = kind
                    found[f"{kind.__qualname__}.{name}"] = getattr(kind, name)
    return found


CALLABLES = _callables()
DOCUMENTED = {  # a constructor by the text of its class
    name: KINDS[name.partition(".")[0]] if name.endswith(".__init__") else function
    for name, function in CALLABLES.items()
}


@pytest.mark.parametrize("name", CALLABLES)
def test_every_argument_is_named_and_typed(name: str) -> None:
    for each in inspect.signature(CALLABLES[name]).parameters.values():
        if each.name in ("self", "cls"):
            continue
        assert each.annotation is not each.empty, each.name
        assert each.kind is each.KEYWORD_ONLY or (
            each.kind is each.POSITIONAL_OR_KEYWORD and each.name in BY_POSITION
        ), f"{each.name} is {each.kind.description}"


@pytest.mark.parametrize("name", CALLABLES)
def test_help_names_every_argument(name: str) -> None:
    text = inspect.getdoc(DOCUMENTED[name])
    assert text is not None
    for argument in inspect.signature(CALLABLES[name]).parameters:
        assert argument in ("self", "cls") or re.search(rf"\b{argument}\b", text), argument


def test_observers_of_the_library_are_all_looked_at() -> None:
    kinds = {name.partition(".")[0] for name in CALLABLES}
    public = {
        name for name in reobserve.__all__
        if isinstance(value := getattr(reobserve, name), type) and issubclass(value, Observer)
    }  # fmt: skip
    assert public <= kinds
    assert len(public) > 12


@pytest.mark.parametrize("method", ["run", "step"])
def test_unknown_argument_is_refused_by_python(method: str) -> None:
    observer = KalmanFilter(LinearModel([[0.5]], C=[[1.0]], Q=1.0, R=1.0))
    state = observer.init([0.0], 1.0)
    first: Any = [np.zeros(3)] if method == "run" else [state, 0.0]
    with pytest.raises(TypeError, match="unexpected keyword argument 'gates'"):
        getattr(observer, method)(*first, gates=3.0)

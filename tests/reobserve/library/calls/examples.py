"""Valid calls of all public names: those of the examples in docstrings, and of other methods.

An argument that an example leaves out has its default. A method that no example calls gets its
arguments by name from calls of the same example, as the first rows of a record for a step.
"""

from __future__ import annotations

import ast
import contextlib
import doctest
import inspect
import io
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from tests.reobserve.library.test_docstrings import EXAMPLES

from .call import COMPLEX, MISSING, Call

OTHERS = ("main", "Gains")  # of a command line, and whose fields are checked when used
MAY_MISS = {"y", "increments", "distances", "statistic", "squares", "values", "score", "innovation"}


class _Recorded(ast.NodeTransformer):
    """Hands each call of an example, with its place, to a function ``called_``."""

    def visit_Call(self, node: ast.Call) -> ast.Call:
        self.generic_visit(node)
        place = ast.Constant((node.lineno, node.col_offset))
        function = ast.Name("called_", ast.Load())
        return ast.Call(function, [place, node.func, *node.args], node.keywords)


Found = tuple[Callable[..., Any], dict[str, Any]]


def _ours(one: object) -> bool:
    return (getattr(one, "__module__", None) or "").startswith("reobserve.")


def _executed(test: doctest.DocTest) -> tuple[list[Found], list[Any]]:
    """The calls of an example, each of its places once, and all objects of the library in it."""
    calls: dict[Any, Found] = {}
    objects: list[Any] = []
    number = 0

    def called_(place: Any, function: Any, /, *given: Any, **named: Any) -> Any:
        made = function(*given, **named)
        owner = getattr(function, "__self__", None)
        if _ours(function) and function.__name__ not in OTHERS and (number, place) not in calls:
            bound = inspect.signature(function).bind(*given, **named)
            bound.apply_defaults()
            calls[number, place] = (
                function,
                {
                    name: Path(one).absolute()
                    if isinstance(one, str) and Path(one).exists()
                    else one
                    for name, one in bound.arguments.items()
                },
            )
            objects.extend(one for one in (owner, made) if _ours(type(one)))
        return made

    values: dict[str, Any] = {"called_": called_}
    for number, one in enumerate(test.examples):  # noqa: B007
        tree = ast.fix_missing_locations(_Recorded().visit(ast.parse(one.source)))
        with contextlib.redirect_stdout(io.StringIO()):
            try:
                exec(compile(tree, test.name, "exec"), values)
            except Exception:
                assert one.exc_msg, one.source
    return list(calls.values()), objects


def _rows(known: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a step from those of a run."""
    first = {name: np.asarray(known[name])[0] for name in "yu" if np.ndim(known.get(name))}
    posterior = getattr(known.get("start"), "posterior", None)
    return {**known, **first, "prior": posterior, "posterior": posterior, "estimate": posterior}


def _methods(calls: list[Found], objects: list[Any]) -> Iterator[Found]:
    """Calls of the methods that an example does not call."""
    known: dict[str, Any] = {}
    for _, arguments in calls:
        known |= {name: one for name, one in arguments.items() if one is not None}
    made = {(type(getattr(one, "__self__", None)), one.__name__) for one, _ in calls}
    for one in {id(each): each for each in objects}.values():
        for name, method in inspect.getmembers(one, inspect.ismethod):
            if name.startswith("_") or not _ours(method) or (type(one), name) in made:
                continue
            made.add((type(one), name))
            parameters = inspect.signature(method).parameters.values()
            needed = {each.name: each.default is each.empty for each in parameters}
            values = known if name in ("run", "init") else _rows(known)
            if all(values.get(name) is not None for name, is_needed in needed.items() if is_needed):
                usual = {each.name: each.default for each in parameters}
                usual |= {"u": values.get("u")} if "u" in needed else {}
                yield method, usual | {name: values[name] for name in needed if needed[name]}


def _call(name: str, function: Callable[..., Any], arguments: dict[str, Any]) -> Call:
    every = inspect.signature(function).parameters
    usual = {k: v for k, v in arguments.items() if every[k].kind not in (2, 4)}
    more = [v for k, v in arguments.items() if every[k].kind == 4]

    def call(*values: Any) -> Any:
        named = dict(zip(usual, values, strict=True))
        return function(**{k: v for one in (named, *more) for k, v in one.items()})

    call.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [every[k].replace(kind=1, default=inspect.Parameter.empty) for k in usual]
    )
    takes = (*(MISSING if MAY_MISS & {*usual} else ()), *(COMPLEX if "poles" in usual else ()))
    takes += MISSING if ".nees" in name else ()
    return Call(name, call, tuple(usual.values()), takes)


def calls() -> Iterator[Call]:
    """All of them, named by function and example."""
    for name, test in EXAMPLES.items():
        with contextlib.chdir(tempfile.mkdtemp()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made, objects = _executed(test)
            for number, (function, arguments) in enumerate([*made, *_methods(made, objects)]):
                owner = getattr(function, "__self__", None)
                kind = owner if inspect.isclass(owner) or owner is None else type(owner)
                of = function if kind is None else kind
                last = "" if kind is None else f".{function.__name__}"
                place = f"{of.__module__.partition('.')[2]}.{of.__qualname__}{last}"
                call = _call(
                    f"{place}, {name.removeprefix('reobserve.')} {number}", function, arguments
                )
                with contextlib.suppress(InputError):  # of a method that this object refuses
                    call.function(*call.arguments)
                    yield call

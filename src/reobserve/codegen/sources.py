"""Functions of Python as their trees, and what can be said of these."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from textwrap import dedent
from typing import Any

from reobserve.core.errors import InputError
from reobserve.systems.text_functions import compiled_rows


@cache
def source(function: Callable[..., Any]) -> tuple[ast.FunctionDef, dict[int, str], str, int]:
    """The tree of a function, its equations by the lines below them, its file and first line."""
    try:
        lines, first = inspect.getsourcelines(function)
    except OSError:
        lines, first = [], 0
    text = dedent("".join(lines))
    tree = ast.parse(text).body[0] if lines else None
    if not isinstance(tree, ast.FunctionDef):
        name = function.__name__
        raise InputError("observer", f"cannot be exported: {name} is defined in no file")
    equations, own = {}, [line.strip() for line in text.splitlines()]
    for place, line in enumerate(own):
        if line.startswith("# ") and "=" in line and "numba" not in line:
            equations[place + 2] = line[2:]
    return tree, equations, inspect.getsourcefile(function) or "", first


def plain(function: Any) -> Any:
    """The Python function behind a kernel or a pointer, or the function itself."""
    names = ("source",) if hasattr(function, "pickled") else ("py_func", "_function", "_pyfunc")
    return next((getattr(function, name) for name in names if hasattr(function, name)), function)


def rows_of(function: Any) -> tuple[str, ...] | None:
    """The code of the entries of a function that was compiled of text."""
    recipe = getattr(function, "pickled", None)
    if isinstance(recipe, tuple) and recipe[0] is compiled_rows:
        return tuple(recipe[1][0])
    return None


@cache
def text_function(rows: tuple[str, ...]) -> tuple[ast.FunctionDef, dict[str, Any]]:
    """The tree of a function that writes the values of expressions, and the names in it."""
    body = "".join(f"    out[{i}] = {row}\n" for i, row in enumerate(rows))
    tree = ast.parse(f"def field(x, parameters, out):\n{body}").body[0]
    assert isinstance(tree, ast.FunctionDef)
    return tree, {"math": math}


def jumps(loop: ast.For) -> bool:
    """True if a loop is left or gone on with elsewhere than by a condition among its statements."""
    inner = [one for one in ast.walk(loop) if isinstance(one, ast.For) and one is not loop]
    own = [one for one in ast.walk(loop) if isinstance(one, ast.Break | ast.Continue)]
    own = [one for one in own if not any(one in ast.walk(other) for other in inner)]
    direct = [one.body[-1] for one in loop.body if isinstance(one, ast.If) and not one.orelse]
    return any(one not in (*direct, *loop.body) for one in own)


def changed(nodes: Iterable[ast.AST]) -> set[str]:
    """The names that statements give a value, otherwise than as the variable of a loop."""
    inside = [inner for node in nodes for inner in ast.walk(node)]
    loops = [one.target for one in inside if isinstance(one, ast.For)]
    return {name for one in inside if one not in loops for name in stored(one)}


def stored(node: ast.AST) -> Iterator[str]:
    """The name that a node gives a value."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id

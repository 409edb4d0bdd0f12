"""New changes, drawn by a seed: a line of any module, then one of the changes that fit it.

All are made on the syntax tree and written back where the node stands, so that the rest of the
file keeps its bytes. Messages, annotations and docstrings are left alone, and so are modules that
no tests are named for in ``rooms.yaml``, which says why.
"""

from __future__ import annotations

import ast
import re
from bisect import bisect
from collections import defaultdict
from collections.abc import Iterator
from fnmatch import fnmatch
from functools import cache
from itertools import accumulate, islice
from pathlib import Path
from random import Random
from typing import Any

import yaml

from tests.mutations.trial import Mutation

ROOMS = Path(__file__).with_name("rooms.yaml")

_COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">")),
    ast.LtE: ("<=", ("<", ">=")),
    ast.Gt: (">", (">=", "<")),
    ast.GtE: (">=", (">", "<=")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
_OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "//"),
    ast.Pow: ("**", "*"),
}
_CALLS = {"all": "any", "any": "all", "min": "max", "max": "min", "argmin": "argmax"}
_CALLS |= {"argmax": "argmin", "ceil": "floor", "floor": "ceil", "minimum": "maximum"}
_CALLS |= {"maximum": "minimum", "startswith": "endswith", "endswith": "startswith"}

Change = tuple[ast.AST, str]


def changes(tree: ast.AST, source: str) -> Iterator[Change]:
    """Nodes and the text to put in their place."""
    for node in _code(tree):
        if hasattr(node, "end_lineno"):
            for new in _replacements(node, source):
                yield node, new


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes that compute something."""
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            # Python 3.11 does not know where the parts of an f-string stand.
            if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                yield from _code(child)


def _replacements(node: ast.AST, source: str) -> Iterator[str]:
    if isinstance(node, ast.Call):
        yield from _other_call(node, source)
    elif isinstance(node, ast.Constant):
        yield from _other_constant(node.value)
    else:
        yield from _other_operator(node, source)


def _other_operator(node: ast.AST, source: str) -> Iterator[str]:
    match node:
        case ast.Compare():
            parts = zip([node.left, *node.comparators], node.ops, node.comparators, strict=False)
            for one, op, other in parts:
                old, news = _COMPARISONS[type(op)]
                for new in news:
                    yield _between(source, node, one, other, old, new)
        case ast.BinOp() if type(node.op) in _OPERATORS:
            yield _between(source, node, node.left, node.right, *_OPERATORS[type(node.op)])
        case ast.BoolOp(values=[first, second, *_]):
            words = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            yield _between(source, node, first, second, *words)
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield f"({_text(source, node.operand)})"
        case ast.AugAssign(op=ast.Add() | ast.Sub() as op):
            old, new = _OPERATORS[type(op)]
            yield _text(source, node).replace(f"{old}=", f"{new}=", 1)
        case ast.IfExp():
            yield f"({_text(source, node.orelse)})"
        case ast.If():
            asked = _text(source, node.test)
            yield _text(source, node).replace(asked, f"not ({asked})", 1)
        case ast.Raise() | ast.Expr(value=ast.Call()) | ast.Continue() | ast.Break():
            yield "pass"


def _other_call(node: ast.Call, source: str) -> Iterator[str]:
    text, called = _text(source, node), _text(source, node.func)
    name = called.rpartition(".")[2]
    if name in _CALLS:
        yield called.removesuffix(name) + _CALLS[name] + text.removeprefix(called)
    if name in ("abs", "sorted") and len(node.args) == 1 and not node.keywords:
        yield {"abs": "({})", "sorted": "list({})"}[name].format(_text(source, node.args[0]))


def _other_constant(value: object) -> Iterator[str]:
    if isinstance(value, bool):
        yield str(not value)
    elif isinstance(value, int):
        yield str(value + 1)
    elif isinstance(value, float):
        # A small one is a tolerance, of which a hundredth means nothing.
        yield repr(value * (1e6 if abs(value) < 1e-4 else 1.01) or 0.01)


def _between(source: str, whole: ast.AST, left: ast.AST, right: ast.AST, old: str, new: str) -> str:
    """The text of ``whole`` with the operator between two of its parts replaced."""
    (start, end), (_, low), (high, _) = (_span(source, node) for node in (whole, left, right))
    pattern = rf"\b{old}\b" if old[0].isalpha() else re.escape(old)
    return source[start:low] + re.sub(pattern, new, source[low:high], count=1) + source[high:end]


@cache
def _lines(source: str) -> tuple[list[str], list[int]]:
    """The lines, and where each begins, in characters."""
    lines = source.splitlines(keepends=True)
    return lines, [0, *accumulate(map(len, lines))]


def _span(source: str, node: Any) -> tuple[int, int]:
    """Where a node starts and ends, in characters, of which Python counts the bytes."""
    lines, begins = _lines(source)
    ends = ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
    start, end = (
        begins[line - 1] + len(lines[line - 1].encode()[:column].decode()) for line, column in ends
    )
    return start, end


def _text(source: str, node: ast.AST) -> str:
    start, end = _span(source, node)
    return source[start:end]


def sites(file: str, source: str, tests: str) -> dict[int, list[Mutation]]:
    """All changes of a file by the line on which they stand."""
    found = defaultdict(list)
    begins = _lines(source)[1]
    for node, new in changes(ast.parse(source), source):
        start, end = _span(source, node)
        line, last = bisect(begins, start), bisect(begins, end - 1)
        begin, stop = begins[line - 1], begins[last] - source[: begins[last]].endswith("\n")
        old, changed = source[begin:stop], source[begin:start] + new + source[end:stop]
        if changed != old:
            found[line].append(Mutation(file, old, changed, tests, line=line))
    return found


def _compiles(project: Path, mutation: Mutation) -> bool:
    """Whether it is Python still; a few are not, such as a message that spans lines."""
    try:
        ast.parse(mutation.applied((project / mutation.file).read_text(encoding="utf-8")))
    except SyntaxError:
        return False
    return True


@cache
def rooms() -> dict[str, str]:
    """The tests of files by their patterns."""
    return dict(yaml.safe_load(ROOMS.read_text(encoding="utf-8")))


def room(file: str) -> str:
    """The tests of a file, as arguments of pytest; empty if it has none."""
    for pattern, tests in rooms().items():
        if fnmatch(file, pattern):
            return tests
    raise LookupError(f"{file} has no room in {ROOMS.name}")


def generate(project: Path, count: int, seed: int) -> list[Mutation]:
    """``count`` changes of different lines, every line with one as likely as any other."""
    paths = sorted((project / "src/reobserve").rglob("*.py"))
    found: list[list[Mutation]] = []
    for path in paths:
        file = path.relative_to(project).as_posix()
        if tests := room(file):
            found += sites(file, path.read_text(encoding="utf-8"), tests).values()
    draw = Random(seed)
    drawn = (draw.choice(choices) for choices in draw.sample(found, len(found)))
    return list(islice((one for one in drawn if _compiles(project, one)), count))

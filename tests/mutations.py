"""Do tests notice random changes of the code: `python -m tests.mutations CHANGES SEED [FILE...]`.

Draws lines of the files, or else of `src`, and on each an operator, condition, number or statement
that is changed, but nothing of messages, annotations and representations. The changed file stands
in the place of its own while tests run, so call it in a copy, as `make mutations` does.
"""

from __future__ import annotations

import ast
import os
import random
import re
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LIMIT = 120  # [s] of the tests of a change
FILES = 10  # with tests of a change
PAIRS = "+ -, * /, < <=, > >=, == !=, in notin, is isnot, and or, min max, any all, True False"
OTHER = {a: b for pair in PAIRS.split(", ") for a, b in (pair.split(), pair.split()[::-1])}
OTHER |= {"**": "*", "//": "/"}
SIGNS = re.compile(r"\*\*|//|[<>=!]=|[-+*/<>]|\b(?:not\s+in|is\s+not|in|is|and|or)\b")

Change = tuple[int, int, str]  # first byte that is replaced, first that stays, what is put there


def changes(code: bytes) -> Iterator[tuple[int, Change]]:
    """All changes of a module, with their lines."""
    starts = [0]
    for line in code.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def span(node: Any) -> tuple[int, int]:
        begin, end = starts[node.lineno - 1], starts[node.end_lineno - 1]
        return begin + node.col_offset, end + node.end_col_offset

    def of(node: ast.AST) -> Iterator[Change]:
        match node:
            case (
                ast.BinOp(left=left, right=right)
                | ast.Compare(left=left, comparators=[right, *_])
                | ast.BoolOp(values=[left, right, *_])
            ):
                begin, end = span(left)[1], span(right)[0]
                found = SIGNS.search(code[begin:end].decode())
                if found and (other := OTHER.get("".join(found[0].split()))):
                    yield begin + found.start(), begin + found.end(), other.replace("not", " not ")
            case ast.If() | ast.While() | ast.IfExp():
                first, last = span(node.test)
                yield first, last, f"(not ({code[first:last].decode()}))"
            case ast.Constant(bool() as value) | ast.Name(str() as value) if str(value) in OTHER:
                yield *span(node), OTHER[str(value)]
            case ast.Constant(int() as value):
                yield *span(node), f"({value + 1})"
                yield *span(node), f"({value - 1})"
            case ast.Constant(float() as value):
                yield *span(node), repr(1.1 * value or 1.0)
            case ast.UnaryOp(ast.Not() | ast.USub()):
                begin = span(node)[0]
                yield begin, begin + (3 if isinstance(node.op, ast.Not) else 1), " "
            case (
                ast.Assign([ast.Attribute() | ast.Subscript()])
                | ast.Expr(ast.Call()) | ast.Raise() | ast.AugAssign() | ast.Continue()
            ):  # fmt: skip
                yield *span(node), "pass"

    def within(node: ast.AST) -> Iterator[tuple[int, Change]]:
        for change in of(node):
            yield code.count(b"\n", 0, change[0]) + 1, change
        for field, value in ast.iter_fields(node):
            for part in value if isinstance(value, list) else [value]:
                text = getattr(part, "name", "") in {"__repr__", "__str__"}
                text |= isinstance(node, ast.Raise) or isinstance(part, ast.JoinedStr)
                if (
                    isinstance(part, ast.AST)
                    and not text
                    and field not in {"annotation", "returns"}
                ):
                    yield from within(part)

    yield from within(ast.parse(code))


def tests_of(path: Path) -> list[str]:
    """Its own tests before others, and those first that name it and what it defines most often."""
    affected = ["sh", "tests/affected.sh"]
    own = subprocess.run(affected, input=f"{path}\n", capture_output=True, text=True, check=True)
    defined = [getattr(node, "name", "_") for node in ast.parse(path.read_bytes()).body]
    public = "|".join([re.escape(path.stem), *(name for name in defined if name[0] != "_")])
    rank = {}
    for file in Path("tests").rglob("test_*.py"):
        named = len(re.findall(rf"\b(?:{public})\b", file.read_text(encoding="utf-8")))
        near = any(file.is_relative_to(one) for one in own.stdout.split())
        if near or named > 2:
            rank[str(file)] = (near and named > 0, named, str(file))
    return sorted(rank, key=lambda file: rank[file], reverse=True)[:FILES]


def failing(tests: list[str], *options: str, limit: float = LIMIT) -> list[str]:
    """The tests that fail, or where none is named, the end of what pytest says."""
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--tb=no"]
    with subprocess.Popen(
        [*command, *options, *tests], stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        try:
            said = run.communicate(timeout=limit)[0]
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            return [f"{limit} s"]
    found = re.findall(r"^(?:FAILED|ERROR) (tests/.+?)(?: - .*)?$", said, re.MULTILINE)
    return found or [said[-200:]] * (run.returncode != 0)


def main(count: int, seed: int, files: list[str]) -> None:
    """Print for each change the test that notices it."""
    lines, drawn, noticing = defaultdict(list), random.Random(seed), []
    for path in sorted(map(Path, files) if files else Path("src").rglob("*.py")):
        for line, change in changes(path.read_bytes()):
            lines[path, line].append(change)
    places = drawn.sample(sorted(lines), min(count, len(lines)))
    for (path, line), (first, last, text) in [(at, drawn.choice(lines[at])) for at in places]:
        code, tests = path.read_bytes(), tests_of(path)
        try:
            path.write_bytes(code[:first] + text.encode() + code[last:])
            by = failing(tests, "-x")
        finally:
            path.write_bytes(code)
        noticing += [one for one in by if "::" in one]
        was = " ".join(code[first:last].decode().split())
        print(f"{path}:{line}: {was} -> {text}: {by[0] if by else 'SURVIVED'}", flush=True)
    if noticing:
        print("They fail unchanged, too:", failing(noticing, limit=LIMIT * len(noticing)))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])

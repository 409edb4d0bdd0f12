"""The library: a page for each module that has public names, by the rooms of the house."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import reobserve
from docs.generate.markdown import Page, code, plain, table, ticks

# The rooms that are the library, and what each holds; the others are told of by `house`.
ROOMS = {
    "observers": "One algorithm a file, one contract for all",
    "synthesis": "How gains are found and judged",
    "models": "What an observer is told of a plant",
    "plants": "What is simulated",
    "designs": "Gains with their certificate, as files",
    "export": "Observers as C, Python and LaTeX",
    "own_data": "Records of one's own: specification, policies, streams, reports",
    "replication": "A figure of a paper recomputed in one process",
    "scoring": "Errors, settling times, tables of studies",
    "timeseries": "Series and their files, grids, signals, past inputs",
    "power_series": "Series in several variables",
    "numerics": "Compiled loops, matrices, sampling",
    "plain_data": "Files written whole and read as checked values",
    "errors": "The sentences that users read",
}


def pages(source: Path) -> Iterator[Page]:
    """The pages of the library in the package at ``source``."""
    for room, told in ROOMS.items():
        yield from _room(source, room, told)


def rooms() -> str:
    """The rooms of the library, with links to their pages."""
    return table(
        ("room", "what it holds"),
        [(f"[`{room}`]({_of_room(room)})", plain(told)) for room, told in ROOMS.items()],
    )


def public_names(source: Path) -> str:
    """The public names of the package itself, with what each is."""
    rows = []
    for name in reobserve.__all__:
        home = reobserve._HOME[name]
        file = source / Path(*home.split(".")).with_suffix(".py")
        tree = ast.parse(file.read_text(encoding="utf-8"))
        (found,) = (node for node in tree.body if getattr(node, "name", "") == name)
        # An algorithm is a file: it says better what it is than the class.
        is_algorithm = home.startswith("observers.") and home.rpartition(".")[2] != "run"
        told = tree if is_algorithm and isinstance(found, ast.ClassDef) else found
        assert isinstance(told, ast.Module | ast.ClassDef | ast.FunctionDef)
        summary = ticks(first_sentence(ast.get_docstring(told)))
        rows.append((f"[`{name}`][reobserve.{home}.{name}]", summary))
    return table(("name", "what it is"), rows)


def is_shown(name: str) -> bool:
    """Whether a module, named from `reobserve` on, is in a room with pages."""
    return name.split(".")[1:2] != [] and name.split(".")[1] in ROOMS


def first_sentence(docstring: str | None) -> str:
    """The summary of a docstring, on one line."""
    return " ".join((docstring or "").partition("\n\n")[0].split())


def modules(source: Path, room: str) -> list[tuple[str, ast.Module]]:
    """The modules of a room that are public, packages before what is in them."""
    files = [source / f"{room}.py"] if (source / f"{room}.py").is_file() else []
    files += sorted((source / room).rglob("*.py"))
    found = []
    for file in files:
        parts = file.relative_to(source.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if not any(part.startswith("_") for part in name.split(".")):
            found.append((name, ast.parse(file.read_text(encoding="utf-8"))))
    return sorted(found, key=lambda pair: pair[0])


def _of_room(room: str) -> str:
    return "errors.md" if room == "errors" else f"{room}/index.md"


def _room(source: Path, room: str, told: str) -> Iterator[Page]:
    """The page of a room and those of its modules."""
    listed = []
    for name, tree in modules(source, room):
        page = f"reference/library/{'/'.join(name.split('.')[1:])}"
        if name == f"reobserve.{room}" and room != "errors":
            continue
        if not _public_names(tree):
            continue
        short = ".".join(name.split(".")[2:]) or room
        summary = ticks(first_sentence(ast.get_docstring(tree)))
        path = f"{page}.md"
        if (source / Path(*name.split(".")[1:])).is_dir():
            path = f"{page}/index.md"
        target = path.removeprefix(f"reference/library/{room}/")
        listed.append((f"[{code(short)}]({target})", summary))
        yield Page(path, short.rpartition(".")[2] or room, f"::: {name}\n")
    if room != "errors":
        text = f"# {code(room)}\n\n{told}.\n\n{table(('module', 'what it is'), listed)}"
        yield Page(f"reference/library/{room}/index.md", room, text)


def _public_names(tree: ast.Module) -> list[str]:
    """What a module defines for others: what has a docstring and no underscore."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return [
        node.name
        for node in tree.body
        if isinstance(node, kinds) and not node.name.startswith("_") and ast.get_docstring(node)
    ]

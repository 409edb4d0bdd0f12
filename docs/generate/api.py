"""Reference pages of the library: one for each module that has public names."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import reobserve
from docs.generate.markdown import Page, code, plain, table, ticks

# The packages that a user of the library imports from.
PACKAGES = {
    "observers": "State and fault observers, one algorithm per file, one interface",
    "systems": "Models that observers are built on: linear, rigid body, polynomial, triangular",
    "plants": "Simulated plants",
    "synthesis": "Gains and certificates",
    "codegen": "C code of observers",
    "estimation": "Observers on recorded data: specifications, designs, reading, reports",
    "bench": "Observers and filters on the same tasks, tuned by one rule",
    "replication": "Parameters, figures, claims and verdicts of the papers",
    "signals": "Time series and their files, sampling grids, input signals",
    "polynomials": "Multivariate polynomial maps, Taylor series, expressions",
    "core": "Errors, arrays, compiled kernels, random streams, files",
}


def pages(source: Path) -> Iterator[Page]:
    """The pages of the library in the package at ``source``."""
    for package, text in PACKAGES.items():
        yield from _pages_of(source, package, text)


def packages() -> str:
    """The packages of the library, with links to their folders."""
    return table(
        ("package", "contents"),
        [
            (f"[`{name}`](../../../../src/reobserve/{name})", plain(text))
            for name, text in PACKAGES.items()
        ],
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
        documented = tree if is_algorithm and isinstance(found, ast.ClassDef) else found
        assert isinstance(documented, ast.Module | ast.ClassDef | ast.FunctionDef)
        summary = ticks(first_sentence(ast.get_docstring(documented)))
        rows.append((f"[`{name}`][reobserve.{home}.{name}]", summary))
    return table(("name", "what it is"), rows)


def is_shown(name: str) -> bool:
    """Whether a module, named from `reobserve` on, is in a package with pages."""
    return name.split(".")[1:2] != [] and name.split(".")[1] in PACKAGES


def first_sentence(docstring: str | None) -> str:
    """The summary of a docstring, on one line."""
    return " ".join((docstring or "").partition("\n\n")[0].split())


def modules(source: Path, package: str) -> list[tuple[str, ast.Module]]:
    """The public modules of a package, packages before what is in them."""
    files = [source / f"{package}.py"] if (source / f"{package}.py").is_file() else []
    files += sorted((source / package).rglob("*.py"))
    found = []
    for file in files:
        parts = file.relative_to(source.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if not any(part.startswith("_") for part in name.split(".")):
            found.append((name, ast.parse(file.read_text(encoding="utf-8"))))
    return sorted(found, key=lambda pair: pair[0])


def _pages_of(source: Path, package: str, text: str) -> Iterator[Page]:
    """The page of a package and those of its modules."""
    listed = []
    for name, tree in modules(source, package):
        if name == f"reobserve.{package}" or not _public_names(tree):
            continue
        page = f"reference/library/{'/'.join(name.split('.')[1:])}"
        short = ".".join(name.split(".")[2:])
        summary = ticks(first_sentence(ast.get_docstring(tree)))
        path = f"{page}.md"
        if (source / Path(*name.split(".")[1:])).is_dir():
            path = f"{page}/index.md"
        target = path.removeprefix(f"reference/library/{package}/")
        listed.append((f"[{code(short)}]({target})", summary))
        yield Page(path, short.rpartition(".")[2], f"::: {name}\n")
    body = f"# {code(package)}\n\n{text}.\n\n{table(('module', 'what it is'), listed)}"
    yield Page(f"reference/library/{package}/index.md", package, body)


def _public_names(tree: ast.Module) -> list[str]:
    """What a module defines for others: what has a docstring and no underscore."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return [
        node.name
        for node in tree.body
        if isinstance(node, kinds) and not node.name.startswith("_") and ast.get_docstring(node)
    ]

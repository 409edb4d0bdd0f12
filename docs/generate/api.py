"""Reference pages of both packages: one for each module that users meet."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import reobserve
from docs.generate.markdown import Page, code, plain, table, ticks

# The parts that users import from, by package.
PARTS = {
    "reobserve": {
        "observers": "State and fault observers, one algorithm per file, one interface",
        "systems": "Models that observers are built on: linear, rigid body, polynomial, triangular",
        "synthesis": "Gains and certificates",
        "detection": "Tests of innovations, thresholds from healthy records",
        "tuning": "Settings of observers, found by one rule",
        "codegen": "C code of observers",
        "estimation": "Observers on recorded data: specifications, designs, reading, reports",
        "polynomials": "Multivariate polynomial maps, Taylor series, expressions",
        "core": "Errors, command lines, arrays, compiled kernels, files",
    },
    "reobserve_papers": {
        "steps": "A figure in one call, and the steps behind it",
        "plants": "Simulated plants",
        "signals": "Time series and their files, sampling grids, input signals, random streams",
        "metrics": "Metrics of estimates",
        "parameters": "Parameter files",
        "claims": "Claims and verdicts",
        "plotting": "Style, layout and formats of figures",
    },
}
# Where the reference has their pages.
FOLDERS = {"reobserve": "library", "reobserve_papers": "papers"}

# A name that a page refers to, or a module that it imports from.
_NAMED = re.compile(r"(?:\]\[|^ *from )(reobserve[\w.]*)", re.MULTILINE)


def pages(root: Path) -> Iterator[Page]:
    """The pages of all parts of the packages of the project at ``root``."""
    for package, parts in PARTS.items():
        for part, text in parts.items():
            yield from _pages_of(root, root / "src" / package, part, text)


def is_shown(root: Path, name: str) -> bool:
    """Whether a module, or a name on the page of the module that defines it, is shown."""
    package, part, *_ = [*name.split("."), ""]
    if part not in PARTS.get(package, ()) or (file := source(root, name)) not in _shown(root):
        return False
    module = ".".join(file.relative_to(root / "src").with_suffix("").parts)
    within = name.removeprefix(module).removeprefix(".").partition(".")[0]
    members = _members(root, module)
    return not within or not members or within in members


@cache
def _shown(root: Path) -> frozenset[Path]:
    """Modules that define public names, and those that pages of the repository name."""
    written = "\n".join(
        page.read_text(encoding="utf-8") for page in (root / "docs/pages").rglob("*.md")
    )
    public = {f"reobserve.{home}" for home in reobserve._HOME.values()}
    return frozenset(source(root, name) for name in public.union(_NAMED.findall(written)))


def source(root: Path, name: str) -> Path:
    """The file of a module, or of the module that a name is in."""
    base = root / "src" / Path(*name.split("."))
    for file in (base / "__init__.py", base.with_suffix(".py")):
        if file.is_file():
            return file
    return source(root, name.rpartition(".")[0])


def parts(package: str) -> str:
    """The parts of a package, with links to their folders."""
    return table(
        ("package", "contents"),
        [
            (f"[`{package}.{name}`]({name}/index.md)", plain(text))
            for name, text in PARTS[package].items()
        ],
    )


def public_names(source: Path) -> str:
    """The public names of the library at ``source``, with what each is."""
    rows = []
    for name in reobserve.__all__:
        home = reobserve._HOME[name]
        file = source / Path(*home.split(".")).with_suffix(".py")
        tree = ast.parse(file.read_text(encoding="utf-8"))
        (found,) = (node for node in tree.body if getattr(node, "name", "") == name)
        # An algorithm is a file: it says better what it is than the class.
        alone = list(reobserve._HOME.values()).count(home) == 1
        is_algorithm = alone and home.startswith("observers.") and not home.endswith(".run")
        documented = tree if is_algorithm and isinstance(found, ast.ClassDef) else found
        assert isinstance(documented, ast.Module | ast.ClassDef | ast.FunctionDef)
        summary = ticks(first_sentence(ast.get_docstring(documented)))
        rows.append((f"[`{name}`][reobserve.{home}.{name}]", summary))
    return table(("name", "description"), rows)


def first_sentence(docstring: str | None) -> str:
    """The summary of a docstring, on one line."""
    return " ".join((docstring or "").partition("\n\n")[0].split())


def modules(source: Path, part: str) -> list[tuple[str, ast.Module]]:
    """The public modules of a part of the package at ``source``, packages before their modules."""
    found = []
    for file in (source / part).rglob("*.py"):
        parts = file.relative_to(source.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if not any(word.startswith("_") for word in name.split(".")):
            found.append((name, ast.parse(file.read_text(encoding="utf-8"))))
    return sorted(found, key=lambda pair: pair[0])


def _pages_of(root: Path, package: Path, part: str, text: str) -> Iterator[Page]:
    """The page of a part of a package, which lists its modules, and those of modules shown."""
    whole, folder = f"{package.name}.{part}", f"reference/{FOLDERS[package.name]}"
    listed = []
    for name, tree in modules(package, part):
        if name == whole or not _public_names(tree):
            continue
        short = name.removeprefix(f"{whole}.")
        summary = ticks(first_sentence(ast.get_docstring(tree)))
        if not is_shown(root, name):
            listed.append((code(short), summary))
            continue
        page = "/".join(short.split("."))
        path = f"{page}/index.md" if (package / part / page).is_dir() else f"{page}.md"
        listed.append((f"[{code(short)}]({path})", summary))
        shown = f"::: {name}\n"
        if members := _members(root, name):
            shown += f"    options:\n      members: [{', '.join(members)}]\n"
        yield Page(f"{folder}/{part}/{path}", short.rpartition(".")[2], shown)
    body = f"# {code(whole)}\n\n{text}.\n\n{table(('module', 'description'), listed)}"
    yield Page(f"{folder}/{part}/index.md", part, body)


@cache
def _members(root: Path, module: str) -> list[str]:
    """What the page of a module with public names shows: these, and what pages name of it."""
    public = {name for name, home in reobserve._HOME.items() if f"reobserve.{home}" == module}
    if not public:
        return []
    written = "\n".join(
        page.read_text(encoding="utf-8") for page in (root / "docs/pages").rglob("*.md")
    )
    tree = ast.parse(source(root, module).read_text(encoding="utf-8"))
    public |= {
        node.name
        for node in tree.body
        if isinstance(node, ast.ClassDef)
        and not node.name.startswith("_")
        and "NamedTuple" not in map(ast.unparse, node.bases)
    }  # what users are given or catch
    named = re.findall(rf"\]\[{re.escape(module)}\.(\w+)", written)
    for listed in re.findall(rf"from {re.escape(module)} import ([\w, ]+)", written):
        named += listed.split(", ")
    return sorted(public.union(named))


def _public_names(tree: ast.Module) -> list[str]:
    """What a module defines for others: what has a docstring and no underscore."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return [
        node.name
        for node in tree.body
        if isinstance(node, kinds) and not node.name.startswith("_") and ast.get_docstring(node)
    ]

"""Docstrings of public names: examples that run, descriptions of arguments and estimates."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reobserve
from tests import ROOT


def packages() -> list[Any]:
    """The library, and its subpackages that export names."""
    names = [found.name for found in pkgutil.walk_packages(reobserve.__path__, "reobserve.")]
    folders = [name for name in names if (ROOT / "src" / Path(*name.split("."))).is_dir()]
    every = [reobserve, *(importlib.import_module(name) for name in folders)]
    return [package for package in every if hasattr(package, "__all__")]


def shown_first() -> Iterator[Any]:
    """Classes and functions of the library that the README and the first pages import."""
    for page in [ROOT / "README.md", *(ROOT / "docs/pages/start").glob("*.md")]:
        for code in re.findall(r"^```python\n(.*?)^```$", page.read_text("utf-8"), re.M | re.S):
            for node in ast.walk(ast.parse(code)):
                name = node.module or "" if isinstance(node, ast.ImportFrom) else ""
                if isinstance(node, ast.ImportFrom) and re.match(r"reobserve\b", name):
                    module = importlib.import_module(name)
                    found = [getattr(module, alias.name, None) for alias in node.names]
                    yield from (one for one in found if callable(one))  # and no modules


PUBLIC = {getattr(package, name) for package in packages() for name in package.__all__}
PUBLIC |= set(shown_first())
OBSERVERS = {
    found.__name__: found
    for found in PUBLIC
    if all(hasattr(found, method) for method in ("init", "step", "run"))
}


def documentation(found: Any) -> str:
    """The docstring; that of a class with those of the classes that it derives from."""
    bases = inspect.getmro(found) if inspect.isclass(found) else (found,)
    ours = [base for base in bases if base.__module__.startswith("reobserve")]
    return "\n".join(base.__doc__ or "" for base in ours)


def arguments(found: Any) -> Iterator[tuple[str, str, str]]:
    """Functions and public methods of a name: (function, argument, docstrings that describe it)."""
    signature = inspect.signature(found)
    for argument in signature.parameters:
        yield found.__name__, argument, documentation(found)
    if inspect.isclass(found):
        for name, method in inspect.getmembers(found, callable):
            ours = getattr(method, "__module__", None) or ""
            if name.startswith("_") or not ours.startswith("reobserve"):
                continue
            same = [vars(base).get(name) for base in inspect.getmro(found)]
            described = "\n".join(
                [documentation(found), *(getattr(one, "__doc__", None) or "" for one in same)]
            )
            for argument in inspect.signature(method).parameters:
                if argument != "self":
                    yield f"{found.__name__}.{name}", argument, described


def test_all_arguments_are_described() -> None:
    """By their names, in the docstring of the function, the class or one that it derives from."""
    missing = {
        (function, argument)
        for found in PUBLIC
        for function, argument, text in arguments(found)
        if not re.search(rf"\b{argument}\b", text)
    }
    assert missing == set()


def examples() -> dict[str, doctest.DocTest]:
    """The examples of the library, by the names of what they are of."""
    found = {}
    for path in sorted((ROOT / "src/reobserve").rglob("*.py")):
        if ">>>" in path.read_text(encoding="utf-8"):
            parts = path.relative_to(ROOT / "src").with_suffix("").parts
            module = importlib.import_module(".".join(parts).removesuffix(".__init__"))
            tests = doctest.DocTestFinder().find(module, globs={})
            found |= {test.name: test for test in tests if test.examples}
    return found


EXAMPLES = examples()


def test_public_names_have_examples() -> None:
    names = {f"{found.__module__}.{found.__name__}" for found in PUBLIC}
    assert len(OBSERVERS) >= 16
    assert names - EXAMPLES.keys() == set()


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder of their own; that of an observer runs it, and names all that this estimates."""
    monkeypatch.chdir(tmp_path)
    output: list[str] = []
    with np.printoptions(precision=8, suppress=False, linewidth=75, legacy=False):
        done = doctest.DocTestRunner().run(EXAMPLES[name], out=output.append, clear_globs=False)
    assert not done.failed, "".join(output)
    found = OBSERVERS.get(name.rpartition(".")[2])
    if found is not None:
        run = EXAMPLES[name].globs["run"]
        text = inspect.getdoc(found) or ""
        assert [one for one in run if f"``{one}``" not in text] == []

"""The tables of equations agree with docstrings, and every cited equation is listed."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.documents import read_yaml
from reobserve.replication.equations.sources import find_source
from reobserve.replication.equations.table import (
    EquationTable,
    papers_with_equations,
    read_equations,
)
from tests import FIVE

from .citations import cited, places_in

ROOT = Path(__file__).parents[3]
SOURCE = ROOT / "src"


@cache
def table(paper: str) -> EquationTable:
    return read_equations(ROOT, paper)


def places(paper: str) -> set[str]:
    return {one.place for one in table(paper).equations}


@cache
def docstrings() -> dict[str, dict[str, str]]:
    """Docstrings by module and by the dotted name of their objects."""
    found = {}
    for path in sorted((SOURCE / "reobserve").rglob("*.py")):
        module = ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        found[module] = dict(_docstrings(ast.parse(path.read_text()), module))
    return found


def _docstrings(node: ast.AST, name: str) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
        yield name, ast.get_docstring(node) or ""
        for child in node.body:
            if isinstance(child, ast.ClassDef | ast.FunctionDef):
                yield from _docstrings(child, f"{name}.{child.name}")


def test_every_paper_has_a_table() -> None:
    assert sorted(FIVE) == papers_with_equations(ROOT)


@pytest.mark.parametrize("paper", FIVE)
def test_table_entries_agree_with_citations_in_docstrings(paper: str) -> None:
    named = {(name, one.place) for one in table(paper).equations for name in one.implemented}
    citing = {
        (name, place)
        for module, texts in docstrings().items()
        for name, text in texts.items()
        if name != module
        for place in cited(text, table(paper).cited_as)
    }
    assert sorted(named - citing) == [], "named in the table, without a citation"
    assert sorted(citing - named) == [], "cited, without a name in the table"
    for name, _ in named:
        assert find_source(name).docstring == dict(_all_docstrings())[name]


@cache
def _all_docstrings() -> dict[str, str]:
    return {name: text for texts in docstrings().values() for name, text in texts.items()}


def test_all_equations_cited_in_docstrings_are_in_a_table() -> None:
    """A number without the name of a paper belongs to the paper of its module."""
    unknown = []
    for module, texts in docstrings().items():
        of = module.split(".")
        papers = [
            paper
            for paper in FIVE
            if of[1:3] == ["papers", paper]
            or any(cited(text, table(paper).cited_as) for text in texts.values())
        ]
        known = {place for paper in papers for place in places(paper)}
        unknown += [
            (name, place) for name, text in texts.items() for place in places_in(text)
            if place not in known
        ]  # fmt: skip
    assert unknown == []


@pytest.mark.parametrize("paper", FIVE)
def test_named_tests_exist(paper: str) -> None:
    for one in table(paper).equations:
        for test in one.tests:
            file, _, name = test.partition("::")
            assert name in _tests_of(file), (one.place, test)


@cache
def _tests_of(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text())
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def _texts(tree: Any, *keys: str) -> Iterator[str]:
    """All texts under these keys, anywhere in a tree."""
    if isinstance(tree, dict):
        yield from (value for key, value in tree.items() if key in keys and isinstance(value, str))
        tree = list(tree.values())
    if isinstance(tree, list):
        for branch in tree:
            yield from _texts(branch, *keys)


# Texts about the paper itself; corrections also name what it lacks.
TELLING = {
    "claims": ("place", "statement", "why", "not_testable"),
    "errata": ("place",),
    "papers": ("source", "why"),
}


@pytest.mark.parametrize("paper", FIVE)
@pytest.mark.parametrize("folder", TELLING)
def test_equations_cited_in_config_are_in_the_table(folder: str, paper: str) -> None:
    tree = read_yaml(ROOT / f"config/{folder}/{paper}.yaml")
    found = [place for text in _texts(tree, *TELLING[folder]) for place in places_in(text)]
    assert found
    assert sorted({place for place in found if place not in places(paper)}) == []


@pytest.mark.parametrize("paper", FIVE)
def test_notes_name_existing_errata_and_claims(paper: str) -> None:
    errata = read_yaml(ROOT / f"config/errata/{paper}.yaml")["errata"]
    claims = read_yaml(ROOT / f"config/claims/{paper}.yaml")["claims"]
    for one in table(paper).equations:
        named = set(re.findall(r"`(\w+)`", one.note))
        assert named <= {*errata, *claims}, one.place
        for name in re.findall(r"reobserve(?:\.\w+)+", one.note):
            assert name in _all_docstrings(), one.place
        misprints = {key for key, body in errata.items() if one.place in places_in(body["place"])}
        assert misprints <= named, f"{one.place} has errata that its note does not name"


@pytest.mark.parametrize("paper", FIVE)
def test_docstrings_cite_the_paper_in_one_form(paper: str) -> None:
    name = table(paper).cited_as
    first = re.split(r"[ ,]", name)[0]
    for where, text in _all_docstrings().items():
        line = " ".join(text.split())
        assert len(re.findall(rf"\b{first}\b", line)) == line.count(name), where

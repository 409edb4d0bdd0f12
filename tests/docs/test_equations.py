"""No equation is lost: all that the papers number is cited in the code, or has a reason why not."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from docs.generate.equations import KINDS, Citations, citations, places, texts
from reobserve.core.documents import read_yaml
from tests import FIVE

from .conftest import ROOT

PLACES = {
    "delay": """(1) to (39), after (1), after (4), after (8), before (9), after (22), after (33),
        after (36), after (39), Assumptions 1 to 7, Lemma 1, Theorems 1 and 2, Table I, Remarks 2.1,
        3.1, 3.2, 3.3, 3.4, 3.5, 3.6 and 4.1""",
    "eso": """(1) to (37), Lemma 1, Theorem 1, Table VII, Section IV, motor, Section IV, control,
        Section IV, faults, Section IV, Remark""",
    "ilo": """(1) to (19), after (1), after (11), after (16), Assumptions 1 and 2, Lemma 1,
        Theorem 1, Remarks 1 to 6, Section 4, faults, Section 4, adaptive""",
    "imm": "(1) to (26), after (23), Section IV, layers, Appendix, nomenclature",
    "lie": """(1) to (22), after (7), after (8), after (14), Definitions 2.1, 3.4, 3.5 and 3.8,
        Lemmas 2.2 and 4.17, Propositions 3.6, 3.9, 3.10, 4.14, 4.16 and 4.20, Remarks 2.3, 3.7,
        3.11, 3.12, 3.13, 4.15, 4.18, 4.19, 4.21, 4.22 and 4.23, Section 5, system,
        Section 5, T(z)""",
}

# Texts about the paper itself; corrections also name what it lacks.
TELLING = {
    "claims": ("place", "statement", "why", "not_testable"),
    "errata": ("place",),
    "papers": ("source", "why"),
}


def found_in(root: Path, package: str) -> Citations:
    found = citations(root, package)
    assert found is not None
    return found


def known(paper: str) -> set[str]:
    return set(places(" ".join(PLACES[paper].split())))


def mentioned(text: str) -> set[str]:
    """All places in a text, without the name of a paper."""
    text = re.sub(r"(?:after|before) (?=\()", "", " ".join(text.split()))
    begins = re.finditer(rf"(?<![^\s(])(?=\(\d\d?\)|(?:{KINDS})s? )", text)
    return {place for begin in begins for place in places(text[begin.start() :])}


@pytest.mark.parametrize("paper", FIVE)
def test_no_equation_is_lost(paper: str) -> None:
    found = found_in(ROOT, f"reobserve_papers.papers.{paper}")
    assert {*found.code, *found.reasons} == known(paper)
    assert found.code.keys().isdisjoint(found.reasons), "cited, with a reason why no code does"


@pytest.mark.parametrize("paper", FIVE)
def test_reasons_name_what_there_is(paper: str) -> None:
    errata = read_yaml(ROOT / f"config/errata/{paper}.yaml")["errata"]
    claims = read_yaml(ROOT / f"config/claims/{paper}.yaml")["claims"]
    for place, reason in found_in(ROOT, f"reobserve_papers.papers.{paper}").reasons.items():
        assert reason, place
        assert mentioned(reason) <= known(paper), place
        for name in re.findall(r"`([\w.]+)`", reason):
            code = ROOT.joinpath("src", *name.split(".")).with_suffix(".py")
            is_code = code.is_file() or any(owner == name for owner, _ in texts(ROOT))
            assert name in {*errata, *claims} or is_code, place


@pytest.mark.parametrize("paper", FIVE)
def test_code_cites_the_paper_in_one_form(paper: str) -> None:
    name = found_in(ROOT, f"reobserve_papers.papers.{paper}").name
    first = re.split(r"[ ,]", name)[0]
    for file in (ROOT / "src").rglob("*.py"):
        text = " ".join(file.read_text(encoding="utf-8").split())
        assert len(re.findall(rf"\b{first}\b", text)) == text.count(name), file


def test_all_places_in_docstrings_are_known() -> None:
    """Those without the name of a paper are of the papers that the module cites."""
    names = {paper: found_in(ROOT, f"reobserve_papers.papers.{paper}").name for paper in FIVE}
    for file in (ROOT / "src").rglob("*.py"):
        nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        documented = [
            one for one in nodes if isinstance(one, ast.Module | ast.ClassDef | ast.FunctionDef)
        ]
        text = " ".join((ast.get_docstring(one) or "") for one in documented)
        text = " ".join(text.split())
        of_papers = [
            known(paper) for paper, name in names.items()
            if file.parent.name == paper or any(map(places, text.split(f"{name}, ")[1:]))
        ]  # fmt: skip
        assert mentioned(text) <= set().union(*of_papers), file


@pytest.mark.parametrize("paper", FIVE)
@pytest.mark.parametrize("folder", TELLING)
def test_places_in_config_are_known(folder: str, paper: str) -> None:
    tree = read_yaml(ROOT / f"config/{folder}/{paper}.yaml")
    found = {place for text in values(tree, *TELLING[folder]) for place in mentioned(text)}
    assert found
    assert found - known(paper) == set()


def values(tree: Any, *keys: str) -> Iterator[str]:
    """All texts under these keys, anywhere in a tree."""
    if isinstance(tree, dict):
        yield from (value for key, value in tree.items() if key in keys and isinstance(value, str))
        tree = list(tree.values())
    if isinstance(tree, list):
        for branch in tree:
            yield from values(branch, *keys)


TOY = '''"""A & B 2001: a toy.

- (4) and Remark 2: not
  computed: a proof
"""
'''
CITING = '''"""A module (A & B 2001, (9))."""

def f():
    """As A & B
    2001, (1) to (3), after (3), Remarks 1, 3 to 4. (7)."""

class C:
    def _m(self):
        # x = 2 (A & B
        # 2001, (5))
        x = 2

# A & B 2001, Section 5, T(z)
y = 2
'''


def test_citations_of_any_package_are_found(tmp_path: Path) -> None:
    for file, text in {"one/papers/toy/__init__.py": TOY, "other/a/b.py": CITING}.items():
        path = tmp_path / "src" / file
        path.parent.mkdir(parents=True)
        path.write_text(text)
    found = found_in(tmp_path, "one.papers.toy")
    assert found.name == "A & B 2001"
    f = ["other.a.b.f"]
    assert found.code == {
        "(1)": f, "(2)": f, "(3)": f, "after (3)": f, "Remark 1": f, "Remark 3": f, "Remark 4": f,
        "(5)": ["other.a.b.C._m"], "Section 5, T(z)": ["other.a.b"],
    }  # fmt: skip
    assert found.reasons == dict.fromkeys(("(4)", "Remark 2"), "not computed: a proof")
    assert citations(tmp_path, "unknown") is None


@pytest.mark.parametrize(
    ("text", "begins_with"),
    [
        ("(1) and (2), of which (3)", ["(1)", "(2)"]),
        ("Remark 1, 2 of them", ["Remark 1"]),
        ("Tables I and II.", ["Table I", "Table II"]),
        ("Lemmas 4.17 and 4.18, (2)).", ["Lemma 4.17", "Lemma 4.18", "(2)"]),
        ("Appendix, nomenclature, before (9)", ["Appendix, nomenclature", "before (9)"]),
        ("2007, (3)", []),
        ("whose equation (3)", []),
    ],
)
def test_places_are_read(text: str, begins_with: list[str]) -> None:
    assert places(text) == begins_with

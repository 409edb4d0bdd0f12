"""One wrong name at every place of the conventions and of a claims file: `check` refuses it."""

from __future__ import annotations

import copy
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.claims.conventions import SPECIAL, names_in
from reobserve_papers.claims.registry import claims_text
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

Path_ = tuple[Any, ...]
WORDING = ("why", "note", "statement", "place", "history", "limitations", "not_testable", "differs",
           "shows", "what", "text", "unit", "not_reproduced", "setting", "result")  # fmt: skip


def names(tree: Any, path: Path_ = ()) -> Iterator[tuple[Path_, bool]]:
    """The places of all keys (True) and words (False) that are names."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key not in WORDING:
                yield (*path, key), True
                yield from names(value, (*path, key))
    elif isinstance(tree, list):
        for number, value in enumerate(tree):
            yield from names(value, (*path, number))
    elif isinstance(tree, str):
        yield path, False


def wrong(word: str, draw: random.Random) -> str:
    """A name with one letter changed, of a reference the figure's or the observer's."""
    parts = word.split(" ")
    at = draw.randrange(min(len(parts), 2))
    first = next(k for k, letter in enumerate(parts[at]) if letter.isalpha())
    other = "z" if parts[at][first] == "q" else "q"
    parts[at] = f"{parts[at][:first]}{other}{parts[at][first + 1 :]}"
    return " ".join(parts)


def with_wrong(tree: Any, path: Path_, key: bool, draw: random.Random) -> Any:
    """The tree with a wrong name at a place."""
    tree = copy.deepcopy(tree)
    branch = tree
    for step in path[:-1]:
        branch = branch[step]
    if not key:
        branch[path[-1]] = wrong(branch[path[-1]], draw)
        return tree
    items = [(wrong(one, draw) if one == path[-1] else one, value) for one, value in branch.items()]
    branch.clear()
    branch.update(items)
    return tree


def is_label(path: Path_, key: bool) -> bool:
    """True for what names itself, a claim, a figure or an alternative, and for reasons."""
    reasons = {"reasons", "departs", "excluded"}.intersection(path) or path[-1] == "null"
    if not key and reasons:
        return True
    labels = len(path) == 2 and path[0] in ("claims", "figures", "alternatives")
    return key and (labels or path[:-1] == ("conventions", path[1], "alternatives"))


def places(paper: str, file: str, tree: Any) -> list[tuple[Path_, bool]]:
    """The places of names in a file, of conventions and alternatives those of the paper."""
    own = {*names_in(read_yaml(ROOT / f"config/claims/{paper}.yaml")), *SPECIAL}
    found = []
    for path, key in names(tree):
        if len(path) == 1 or is_label(path, key):
            continue
        if file == "conventions" and path[0] == "alternatives":
            if tree["alternatives"][path[1]]["paper"] != paper:
                continue
        elif file == "conventions" and not (path[1] in own and (key or len(path) > 2)):
            continue
        found.append((path, key))
    return found


def refusal(folder: Path, parameters: Parameters) -> str:
    """The key that an error names, nothing if there is none."""
    try:
        check_evidence(folder, parameters)
    except InputError as error:
        return error.parameter
    return ""


def check_places(paper: str, file: str, folder: Path, most: int) -> None:
    """Check wrong names at some places, of all if ``most`` is none."""
    shutil.copytree(ROOT / "config", folder / "config")
    parameters = Parameters.load(folder, paper)
    name = "config/conventions.yaml" if file == "conventions" else f"config/claims/{paper}.yaml"
    tree, draw = read_yaml(folder / name), random.Random(paper)
    all_places = places(paper, file, tree)
    for path, key in draw.sample(all_places, most or len(all_places)):
        changed = yaml.safe_dump(with_wrong(tree, path, key, draw), sort_keys=False)
        (folder / name).write_text(changed, encoding="utf-8")
        claims_text.cache_clear()
        assert "." in refusal(folder, parameters), path


@pytest.mark.parametrize("file", ["claims", "conventions"])
def test_wrong_name_is_refused_with_file_and_key(file: str, tmp_path: Path) -> None:
    check_places("ilo", file, tmp_path, 4)


@pytest.mark.nightly
@pytest.mark.parametrize("file", ["claims", "conventions"])
@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_wrong_name_at_any_place_is_refused(paper: str, file: str, tmp_path: Path) -> None:
    check_places(paper, file, tmp_path, 100)


@pytest.mark.parametrize(
    ("single", "said"),
    [
        ({"claims": {"any_fault": {"quantfier": None}}}, "'quantfier'"),
        ({"ranges": {"theory.fault_spacing": [50.0, 60.0]}}, "has no sample of theory.fault"),
        (
            {"ranges": {"theory.fault_spacing": [0.1, 1.0]}, "only": ["any_fault", "lemma_1"]},
            "only: lemma_1 depends on none of theory.fault_spacing",
        ),
    ],
)
def test_alternative_that_would_do_nothing_is_refused(
    single: dict[str, Any], said: str, tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    path = tmp_path / "config/conventions.yaml"
    tree = read_yaml(path)
    tree["alternatives"] = {"mine": {"paper": "ilo", "why": "So.", **single}}
    path.write_text(yaml.safe_dump(tree), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        check_evidence(tmp_path, Parameters.load(tmp_path, "ilo"))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("config/searches/imm_calibrated.json: the", "config/searches/imm_calibrate.json: the"),
        ("`searches.calibrated`", "`searches.calibratd`"),
        ("`searches.calibrated`", "`serches.calibrated`"),
    ],
)
def test_setting_names_files_and_branches_that_there_are(
    old: str, new: str, tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    path = tmp_path / "config/claims/imm.yaml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=r"^claims\.imm\.\w+\.setting: there is no"):
        check_evidence(tmp_path, Parameters.load(tmp_path, "imm"))

"""Designs and tables as parameters: who may name one, and what a job receives of it."""

from __future__ import annotations

import copy
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT


@pytest.fixture
def project(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    return tmp_path


def number(value: float) -> dict[str, Any]:
    return {"value": value, "unit": "1", "source": "(1)"}


@pytest.fixture
def designed(project: Path) -> dict[str, Any]:
    """The tree of `ilo` with two designs, named by an observer, the study and a table."""
    tree = read_yaml(project / "config/papers/ilo.yaml")
    tree["designs"] = {
        name: {"title": f"the {name} gains", "pole": number(pole)}
        for name, pole in (("high", 9.0), ("low", 2.0))
    }
    tree["tables"] = {
        "table1": {"title": "T", "source": "Table 1", "design": "low", "digits": number(3)}
    }
    tree["observers"]["forgetting"]["design"] = "high"
    tree["studies"]["matching"]["design"] = "low"
    return tree


def load_tree(
    project: Path, tree: dict[str, Any], overrides: dict[str, Any] | None = None
) -> Parameters:
    (project / "config/papers/ilo.yaml").write_text(yaml.safe_dump(tree))
    return Parameters.load(project, "ilo", overrides)


def test_job_receives_the_designs_it_names(project: Path, designed: dict[str, Any]) -> None:
    parameters = load_tree(project, designed)
    high, low = {"pole": 9.0}, {"pole": 2.0}
    plant = parameters.section("plant")
    assert parameters.settings("design", "high") == {"plant": plant, "design": high}
    assert parameters.settings("table", "table1") == {
        "plant": plant, "design": low, "table": {"design": "low", "digits": 3},
    }  # fmt: skip
    assert parameters.settings("observe", "forgetting")["design"] == high
    assert set(parameters.settings("observe", "sampled")) == {"plant", "observer"}
    # Fig. 1 shows the observer; Fig. 4 neither it nor the study; the other both.
    assert parameters.settings("metrics", "fig1")["designs"] == {"high": high}
    assert "designs" not in parameters.settings("metrics", "fig4")
    assert parameters.settings("metrics", "fig4_matched")["designs"] == {"high": high, "low": low}
    assert parameters.settings("study", "matching")["designs"] == {"high": high, "low": low}
    # A figure also receives the designs of observers that only its study runs.
    designed["figures"]["fig4_matched"]["observers"] = ["sampled"]
    seen = load_tree(project, designed).settings("plot", "fig4_matched")["designs"]
    assert {name: body["title"] for name, body in seen.items()} == {
        "low": "the low gains", "high": "the high gains",
    }  # fmt: skip


def test_paper_without_designs_has_no_design_keys() -> None:
    parameters = Parameters.load(ROOT, "ilo")
    for stage, name in (("study", "matching"), ("metrics", "fig4_matched"), ("plot", "fig1")):
        assert "designs" not in parameters.settings(stage, name)
    with pytest.raises(InputError, match="ilo: there is no 'designs'"):
        parameters.settings("design", "high")


@pytest.mark.parametrize(
    ("section", "name", "key"),
    [
        ("observers", "forgetting", "design"),
        ("studies", "matching", "design"),
        ("tables", "table1", "design"),
        ("studies", "matching", "scenario"),
        ("figures", "fig4_matched", "study"),
    ],
)
def test_named_designs_must_exist(
    project: Path, designed: dict[str, Any], section: str, name: str, key: str
) -> None:
    right = designed[section][name][key]
    designed[section][name][key] = f"{right}x"
    with pytest.raises(InputError, match=rf"^ilo\.{section}\.{name}: .*did you mean '{right}'"):
        load_tree(project, designed)


@pytest.mark.parametrize(
    ("section", "wrong"),
    [
        ("designs", "high.old"),
        ("designs", "a/b"),
        ("designs", "title"),
        ("observers", "plant"),
        ("observers", "source"),
        ("tables", "Table1"),
        ("tables", "table1.metrics"),
    ],
)
def test_name_must_be_usable_in_a_file_name(
    project: Path, designed: dict[str, Any], section: str, wrong: str
) -> None:
    designed[section][wrong] = copy.deepcopy(next(iter(designed[section].values())))
    with pytest.raises(InputError, match=rf"^ilo\.{section}\.{wrong}: '{wrong}' "):
        load_tree(project, designed)


def test_designs_and_tables_can_be_added_and_changed(
    project: Path, designed: dict[str, Any]
) -> None:
    parameters = load_tree(
        project,
        designed,
        {
            "designs": {"mine": {"like": "high", "pole": 5}},
            "tables": {"table_mine": {"like": "table1", "design": "mine"}},
            "observers": {"forgetting": {"design": "mine"}},
        },
    )
    assert parameters.settings("observe", "forgetting")["design"] == {"pole": 5}
    assert parameters.settings("table", "table_mine")["design"] == {"pole": 5}
    with pytest.raises(InputError, match="forgetting: there is no 'mien' in designs"):
        load_tree(project, designed, {"observers": {"forgetting": {"design": "mien"}}})

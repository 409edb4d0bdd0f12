"""The parameter file: required keys of an entry, merging of overrides, and the input of a job."""

from __future__ import annotations

import copy
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats
from reobserve.core.seals import digest
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import OVERRIDDEN, Parameters, leaves
from tests import ROOT


def load(overrides: dict[str, Any] | None = None) -> Parameters:
    return Parameters.load(ROOT, "ilo", overrides)


def entry(parameters: Parameters, key: str) -> dict[str, Any]:
    return dict(parameters.entries())[key]


def test_unreadable_folder_of_papers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "glob", fail)
    with pytest.raises(InputError, match=r"config.papers: cannot be read \(Permission denied\)$"):
        known_papers(ROOT)


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_every_entry_has_a_source_and_every_assumption_a_reason(paper: str) -> None:
    entries = dict(Parameters.load(ROOT, paper).entries())
    assert len(entries) > (50 if paper == "ilo" else 0)
    for key, body in entries.items():
        assert body["source"], key
        if body["source"] == "assumed":
            assert len(body["why"].split()) >= 4, key
            assert body["range"], key
        assert body["unit"], key


def test_source_code_has_no_numbers_of_the_paper() -> None:
    """Gains and constants may only be in config."""
    folder = ROOT / "src/reobserve_papers/papers/ilo"
    text = "\n".join(path.read_text() for path in folder.rglob("*.py"))
    for number in ("36.0", "2000", "200000", "4.084", "6.855", "0.4, ", "5.0, "):
        assert number not in text


def test_bare_override_replaces_the_value_and_is_marked() -> None:
    parameters = load({"observers": {"sampled": {"K2": 1500}}})
    body = entry(parameters, "observers.sampled.K2")
    assert (body["value"], body["unit"], body["source"]) == (1500, "N m s/rad", OVERRIDDEN)
    assert "why" not in body, "the reason was that of the other value"
    # YAML shares the entry between observers; an override must not affect the others.
    other = "observers.continuous.K2"
    assert entry(parameters, other)["value"] == entry(load(), other)["value"]
    assert entry(parameters, other)["source"] == "assumed"


def test_override_may_have_its_own_source() -> None:
    over = {"plant": {"horizon": {"value": 12, "source": "our rig"}}}
    assert entry(load(over), "plant.horizon")["source"] == "our rig"
    with pytest.raises(InputError, match=r"ilo\.plant\.horizon\.unit: 'ms' must be 's'"):
        load({"plant": {"horizon": {"value": 5000, "unit": "ms"}}})


def test_numeric_words_are_converted_to_numbers() -> None:
    """Snakemake passes nested --config values as words."""
    parameters = load({"observers": {"sampled": {"K2": "1e3", "label": "7"}}})
    assert parameters.section("observers", "sampled")["K2"] == 1000.0
    assert parameters.section("observers", "sampled")["label"] == "7"


def test_like_copies_a_sibling_and_changes_only_stated_keys() -> None:
    parameters = load({"observers": {"mine": {"like": "forgetting", "K1": 0.8}}})
    mine, model = (
        parameters.section("observers", "mine"),
        parameters.section("observers", "forgetting"),
    )
    assert mine == {**model, "K1": 0.8}
    with pytest.raises(InputError, match="there is no 'forgeting'; did you mean 'forgetting'"):
        load({"observers": {"mine": {"like": "forgeting"}}})


def test_parameters_round_trip_through_a_file(tmp_path: Path) -> None:
    parameters = Parameters.load(ROOT, "ilo", seed=7)
    path = tmp_path / "parameters.json"
    path.write_text(parameters.text())
    assert Parameters.read(path) == parameters
    path.write_text(parameters.text()[:150])
    with pytest.raises(InputError, match=r"parameters.json: is not JSON: Unterminated string"):
        Parameters.read(path)


def test_job_depends_only_on_its_own_entries() -> None:
    """Change every entry in turn: the digest of a job changes if and only if it should."""
    parameters = load()
    jobs = {
        "plant constant": ("plant", "constant"),
        "observe forgetting": ("observe", "forgetting"),
        "metrics fig1": ("metrics", "fig1"),
    }
    seen: dict[str, set[str]] = {job: set() for job in jobs}
    for key, _ in parameters.entries():
        tree = copy.deepcopy(parameters.tree)
        branch: Any = tree
        for word in key.split("."):
            branch = branch[word]
        branch["value"] = "changed"
        changed = Parameters("ilo", tree, 0)
        for job, request in jobs.items():
            if digest(changed.settings(*request)) != digest(parameters.settings(*request)):
                seen[job].add(key.rpartition(".")[0])
    assert seen["plant constant"] == {"plant", "scenarios.constant"}
    assert seen["observe forgetting"] == {"plant", "observers.forgetting"}
    assert seen["metrics fig1"] == {
        "plant", "scenarios.constant", "metrics",
        "observers.sampled", "observers.continuous", "observers.forgetting",
    }  # fmt: skip


def test_refinement_halves_only_steps() -> None:
    before, after = dict(load().entries()), dict(load().refined().entries())
    halved = {key for key in before if before[key]["value"] != after[key]["value"]}
    assert halved == {
        "plant.step",
        *(f"observers.{name}.sampling_period" for name in load().tree["observers"]),
    }
    assert all(after[key]["value"] == before[key]["value"] / 2 for key in halved)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    return tmp_path


BREAKS = {
    "no why": (lambda body: body.pop("why"), "K2.why: is missing; what is assumed needs it"),
    "no range": (lambda body: body.pop("range"), "K2.range: is missing; what is assumed needs it"),
    "no unit": (lambda body: body.pop("unit"), "K2.unit: is missing; the entry needs it"),
    "no source": (lambda body: body.pop("source"), "K2.source: is missing; the entry needs it"),
    "unknown key": (lambda body: body.update(whi="x"), "whi: unknown key; did you mean 'why'"),
    "outside its range": (lambda body: body.update(value=9e9), "is outside its range [500, 5000]"),
}


@pytest.mark.parametrize("case", BREAKS)
def test_schema_rejects_invalid_entries(project: Path, case: str) -> None:
    change, said = BREAKS[case]
    path = project / "config/papers/ilo.yaml"
    tree = read_yaml(path)
    change(tree["observers"]["sampled"]["K2"])
    path.write_text(yaml.safe_dump(tree))
    with pytest.raises(InputError) as caught:
        Parameters.load(project, "ilo")
    assert "ilo.observers.sampled" in str(caught.value)
    assert said in str(caught.value)


def test_range_must_contain_the_value(project: Path) -> None:
    path = project / "config/papers/ilo.yaml"
    tree = read_yaml(path)
    tree["plant"]["control"]["range"]["*.amplitud"] = [0, 1]
    path.write_text(yaml.safe_dump(tree))
    with pytest.raises(InputError, match=r"control\.range: '\*\.amplitud' matches nothing"):
        Parameters.load(project, "ilo")


def test_value_must_be_one_of_its_choices(project: Path) -> None:
    path = project / "config/papers/ilo.yaml"
    tree = read_yaml(path)
    tree["plant"]["step"]["value"] = 2e-4
    path.write_text(yaml.safe_dump(tree))
    with pytest.raises(InputError) as error:
        Parameters.load(project, "ilo")
    assert str(error.value) == (
        "ilo.plant.step: 0.0002 must be one of [6.25e-05, 0.000125, 0.00025], its range"
    )


def test_invalid_yaml_file_is_named(project: Path) -> None:
    path = project / "config/papers/ilo.yaml"
    path.write_text("plant: [1, 2")
    with pytest.raises(InputError, match=r"ilo\.yaml: is not YAML"):
        Parameters.load(project, "ilo")
    path.write_text("- 1\n")
    with pytest.raises(InputError, match="must be a mapping"):
        Parameters.load(project, "ilo")


def test_leaves_include_lists_and_mappings() -> None:
    assert list(leaves([{"a": 1, "b": [2, 3]}])) == [
        ((0, "a"), 1), ((0, "b", 0), 2), ((0, "b", 1), 3),
    ]  # fmt: skip
    assert list(leaves(5)) == [((), 5)]


@pytest.mark.parametrize("value", ["3", None, [[1, 2], [3]], [1, "x"], {"a": 1}, float("nan")])
def test_non_number_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match=r"K1: .*(is not a number|not finite)"):
        as_floats("K1", value)


@pytest.mark.parametrize(
    "overrides",
    [
        {"studies": {"designs": {"nonsense": 1}}},
        {"scenarios": {"noisy": {"designs": {"new": {"like": "old"}}}}},
    ],
)
def test_nested_unknown_keys_are_refused(overrides: dict[str, Any]) -> None:
    """A study of `eso` has the name of the section for user-defined designs."""
    with pytest.raises(InputError, match="unknown key"):
        Parameters.load(ROOT, "eso", overrides)


def test_values_named_in_the_paper_lie_in_the_range() -> None:
    tree = copy.deepcopy(Parameters.load(ROOT, "ilo").tree)
    tree["observers"]["sampled"]["K2"]["named"] = [1e6]
    with pytest.raises(
        InputError, match=r"ilo\.observers\.sampled\.K2\.named: 1000000.0 is outside"
    ):
        Parameters("ilo", tree, 1)._check_ranges()

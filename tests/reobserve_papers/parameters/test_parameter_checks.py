"""Parameter files are checked completely before anything runs, with one sentence per error.

Each case is an override as a user would write it, or a changed parameter file.
"""

from __future__ import annotations

import copy
import datetime
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pytest
import yaml

from reobserve.core.documents import check_plain, read_yaml
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve_papers.parameters.config import check_config, known_papers, take_truths
from reobserve_papers.parameters.job import declared_keys, named, read_job, signal
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.parameter_checks import check_parameters
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

CONFIG = read_yaml(ROOT / "config/config.yaml")
Tree = dict[str, Any]


def refused(paper: str, overrides: Tree) -> str:
    with pytest.raises(InputError) as caught:
        check_parameters(Parameters.load(ROOT, paper, overrides))
    said = str(caught.value)
    assert "\n" not in said
    assert len(said) < 1000
    return said


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_parameter_files_of_the_papers_are_valid(paper: str) -> None:
    check_parameters(Parameters.load(ROOT, paper))


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_every_job_uses_only_declared_keys(paper: str) -> None:
    parameters = Parameters.load(ROOT, paper)
    keys = declared_keys(parameters)
    jobs = [("theory", "")]
    for stage, section in (
        ("plant", "scenarios"), ("observe", "observers"), ("design", "designs"),
        ("study", "studies"), ("search", "searches"), ("table", "tables"),
        ("metrics", "figures"), ("plot", "figures"),
    ):  # fmt: skip
        jobs += [(stage, name) for name in parameters.tree.get(section, {})]
    for stage, name in jobs:
        job = read_job(keys, parameters.settings(stage, name))
        assert isinstance(job.plant, sys.modules[paper_part(parameters.package, "keys")].Plant)


PRINTED = {"component": 1, "powers": [3, 0]}

# The message for an override, by paper.
OVERRIDES: dict[str, tuple[str, Tree, str]] = {
    "a step of zero": ("ilo", {"plant": {"step": 0}}, "ilo.plant.step: 0 must be greater"),
    "a step that makes too many samples": (
        "ilo", {"plant": {"step": 1e-9}},
        "ilo.plant.horizon: 10 s is 1e+10 steps, must be 2e+07 at most",
    ),
    "an interval that no memory holds": (
        "ilo", {"observers": {"forgetting": {"update_interval": 1_000_000}}},
        "ilo.observers.forgetting.update_interval: 1e+06 s must be 10 s at most, the horizon",
    ),
    "a gain beyond computing": (
        "ilo", {"observers": {"continuous": {"K1": 1e300}}}, "ilo.observers.continuous.",
    ),
    "no observers in a figure": (
        "ilo", {"figures": {"fig1": {"observers": []}}},
        "ilo.figures.fig1.observers: has 0 items, must have 1",
    ),
    "a layout without its study": (
        "ilo", {"figures": {"fig1": {"layout": "matching"}}},
        "ilo.figures.fig1.study: is missing; the layout matching needs it",
    ),
    "a study without what it is about": (
        "ilo", {"studies": {"matching": {"observers": ["sampled"]}}},
        "ilo.studies.matching.observers: must have 'continuous'",
    ),
    "an injection that is no polynomial": (
        "lie", {"designs": {"linear": {"injection": 5}}},
        "lie.designs.linear.injection: 5 must be a list of terms",
    ),
    "a series without end": (
        "lie", {"designs": {"linear": {"degree": 5000}}},
        "lie.designs.linear.degree: 5000 must be 61 or less",
    ),
    "a missing key of a user-defined observer": (
        "delay", {"observers": {"new": {"algorithm": "relay", "label": "x"}}},
        "delay.observers.new.relay_gain: is missing; the algorithm relay needs it",
    ),
    "a missing key of a user-defined filter": (
        "imm", {"observers": {"new": {"algorithm": "kalman", "label": "x"}}},
        "imm.observers.new.realisation: is missing; the algorithm kalman needs it",
    ),
    "a missing key of a user-defined extended state observer": (
        "eso", {"observers": {"new": {"algorithm": "extended_state", "label": "x"}}},
        "eso.observers.new.design: is missing; the observer needs it",
    ),
    "a misspelt key of an observer": (
        "eso", {"observers": {"new": {"like": "pi", "desing": "pd_pi"}}},
        "eso.observers.new.desing: unknown key; did you mean 'design'?",
    ),
    "derivatives without a differentiator": (
        "delay", {"observers": {"order2": {"derivatives": "levant"}}},
        "delay.observers.order2.L: is missing; derivatives by levant need it",
    ),
    "an observer of another plant": (
        "delay", {"figures": {"fig1": {"observers": ["extended_lag"]}}},
        "delay.figures.fig1.observers: 'extended_lag' is for the model lag",
    ),
    "a figure of states of another plant": (
        "delay", {"figures": {"fig1": {"scenario": "lag", "observers": ["extended_lag"]}}},
        "delay.figures.fig1.scenario: must be of the pendulum, whose states are plotted",
    ),
    "a comparison with what estimates no delay": (
        "delay",
        {
            "observers": {"slow": {
                "algorithm": "standard", "label": "slow",
                "model": {"value": "lag", "unit": "word", "source": "(1)"},
                "rho": {"value": 5.0, "unit": "1/s", "source": "(1)"},
                "mean_delay": {"value": 0.8, "unit": "s", "source": "(1)"},
                "initial_estimate": {"value": [0.0], "unit": "1", "source": "(1)"},
                "sampling_period": {"value": 0.01, "unit": "s", "source": "(1)"},
            }},
            "figures": {"fig3": {"observers": ["extended_lag", "slow"]}},
        },
        "delay.figures.fig3.observers: 'slow' does not estimate the delay",
    ),
    "a delay beyond the horizon": (
        "delay", {"plant": {"delay_bounds": [0.0, 120.0025]}},
        "delay.plant.delay_bounds.1: 120.002 s must be 120 s at most, the horizon",
    ),
    "a word for a matrix": (
        "delay", {"observers": {"order2": {"initial_matrix": "algebra"}}},
        "delay.observers.order2.initial_matrix: 'algebra' must be algebraic, a number or a matrix",
    ),
    "a number too small to compute with": (
        "delay", {"observers": {"order2": {"rho": 1e-320}}},
        "delay.observers.order2.rho: 9.99989e-321 1/s must keep S and the gains inside the float",
    ),
    "a number too large to compute with": (
        "delay", {"plant": {"length": 1e300}},
        "delay.scenarios.ramp: its numbers are too large or too small to compute with (",
    ),
    "variances in a block": (
        "imm", {"observers": {"kalman": {"process_noise": [[[1.0]]]}}},
        "imm.observers.kalman.process_noise: has shape (1, 1, 1), must be a number, a list or a m",
    ),
    "variances of too many": (
        "imm", {"observers": {"kalman": {"process_noise": [1.0] * 101}}},
        "imm.observers.kalman.process_noise: has shape (101,), must be a number, a list or a matr",
    ),
    "a printed number in words": (
        "lie", {"tables": {"table_coefficients": {"printed": [PRINTED | {"text": "1e5"}]}}},
        "lie.tables.table_coefficients.printed.0.text: '1e5' must be the digits of a number",
    ),
    "a printed number of too many digits": (
        "lie", {"tables": {"table_coefficients": {"printed": [PRINTED | {"text": "1" * 41}]}}},
        f"lie.tables.table_coefficients.printed.0.text: '{'1' * 41}' must be the digits of a num",
    ),
    "a figure of another method": (
        "imm", {"figures": {"fig8_causes": {"study": "changes"}}},
        "imm.figures.fig8_causes.study: 'changes' has the method changes, must have causes",
    ),
    "a theory of a bank that there is not": (
        "imm", {"theory": {"observers": ["svfs"]}},
        "imm.theory.observers: there is no 'svfs'; did you mean 'svsf'?",
    ),
    "a solver that is a list": (
        "eso", {"designs": {"pd_pi": {"solver": []}}},
        "eso.designs.pd_pi.solver: [] must be one of CLARABEL, SCS",
    ),
    "a bare value in a new branch": (
        "ilo", {"observers": {"new": {"algorithm": "adaptive", "label": "x", "observer_gain": 3}}},
        "ilo.observers.new.observer_gain: 3 must be a mapping of keys to values",
    ),
    "a paper that is a number": ("ilo", 3, "ilo: 3 must be a mapping"),  # type: ignore[dict-item]
    "a word of 20 000 letters": (
        "ilo", {"observers": {"sampled": {"algorithm": "x" * 20_000}}},
        "ilo.observers.sampled.algorithm: 'xxx",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", OVERRIDES)
def test_invalid_override_is_refused_with_the_reason(case: str) -> None:
    paper, overrides, said = OVERRIDES[case]
    message = refused(paper, overrides)
    assert message.startswith(said)
    assert len(message) < 400


TAKEN: list[tuple[str, Tree]] = [
    ("delay", {"plant": {"delay_bounds": [0.0, 120.0]}}),
    ("lie", {"tables": {"table_coefficients": {"printed": [PRINTED | {"text": "+" + "1" * 40}]}}}),
]


@pytest.mark.parametrize(("paper", "overrides"), TAKEN)
def test_limiting_values_are_accepted(paper: str, overrides: Tree) -> None:
    check_parameters(Parameters.load(ROOT, paper, overrides))


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_scenario_with_only_a_title_is_refused(paper: str) -> None:
    said = refused(paper, {"scenarios": {"new": {"title": "mine"}}})
    assert said.startswith(f"{paper}.scenarios.new.")
    assert said.endswith("is missing; the scenario needs it")


def test_interval_of_2_to_the_63_is_refused() -> None:
    said = refused("ilo", {"observers": {"forgetting": {"update_interval": 2**63}}})
    assert said == (
        "ilo.observers.forgetting.update_interval: is an integer beyond 2^53, must be one that "
        "a float holds"
    )


NAMES = ("`touch x`", "a b", "../../../../escaped", "$x", "x$", "a|b", "a\n", "", "ä", "1a", "-a",
         "a.b", "x" * 61)  # fmt: skip
MODELS = {
    "scenarios": ("ilo", "constant"), "observers": ("ilo", "sampled"),
    "studies": ("ilo", "matching"), "figures": ("ilo", "fig1"), "designs": ("eso", "pd_pi"),
    "searches": ("imm", "calibrated"), "tables": ("lie", "table_coefficients"),
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("section", MODELS)
def test_unsafe_name_is_refused(section: str, name: str) -> None:
    """Backticks ran a command, dots left the project, a space broke it, $ never matched."""
    paper, model = MODELS[section]
    said = refused(paper, {section: {name: {"like": model}}})
    assert said.startswith(f"{paper}.{section}")
    assert "is no name" in said


def test_valid_names_are_accepted() -> None:
    for name in ("a", "A1_b", "x" * 60):
        check_parameters(Parameters.load(ROOT, "ilo", {"scenarios": {name: {"like": "constant"}}}))


@pytest.fixture
def project(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    return tmp_path


def test_paper_with_an_invalid_name_is_refused(project: Path) -> None:
    shutil.copy(project / "config/papers/ilo.yaml", project / "config/papers/a b.yaml")
    with pytest.raises(InputError, match=r"^config\.papers: 'a b' is no name"):
        known_papers(project)


@pytest.mark.parametrize(
    ("paper", "path", "said"),
    [
        ("ilo", ("plant", "horizon"), "ilo.plant.horizon: is missing; the plant needs it"),
        (
            "ilo",
            ("scenarios", "periodic", "fault"),
            "periodic.fault: is missing; the scenario needs",
        ),
        (
            "imm",
            ("observers", "svsf_retuned", "boundary_layer"),
            "is missing; the algorithm smooth",
        ),
        ("eso", ("observers", "pi", "design"), "eso.observers.pi.design: is missing; the observer"),
        ("delay", ("studies", "tuning", "rhos"), "delay.studies.tuning.rhos: is missing; the meth"),
        ("imm", ("searches", "calibrated", "leave"), "leave: is missing; the search needs it"),
        ("lie", ("tables", "table_coefficients", "design"), "design: is missing; the table"),
        (
            "eso",
            ("designs", "pi_optimal", "factor"),
            "is missing; the kind pi_optimised",
        ),
        ("delay", ("theory", "rhos"), "delay.theory.rhos: is missing; the theory needs it"),
        ("eso", ("metrics", "longest_lag"), "eso.metrics.longest_lag: is missing; the metrics"),
        ("lie", ("theory",), "lie.theory: is missing"),
    ],
)
def test_key_missing_in_the_file_is_reported(
    project: Path, paper: str, path: tuple[str, ...], said: str
) -> None:
    """Also without overrides: such an error was found only by a job, minutes later."""
    file = project / "config" / "papers" / f"{paper}.yaml"
    tree = read_yaml(file)
    branch: Any = tree
    for key in path[:-1]:
        branch = branch[key]
    misspelt = copy.deepcopy(tree)
    kept = branch.pop(path[-1])
    file.write_text(yaml.safe_dump(tree))
    with pytest.raises(InputError) as caught:
        check_parameters(Parameters.load(project, paper))
    assert said in str(caught.value)
    if len(path) == 1:
        return
    branch = misspelt
    for key in path[:-1]:
        branch = branch[key]
    branch[f"{path[-1]}x"] = kept
    file.write_text(yaml.safe_dump(misspelt))
    with pytest.raises(InputError, match=r"unknown key|is not|must be a mapping") as caught:
        check_parameters(Parameters.load(project, paper))
    assert f"{path[-1]}x" in str(caught.value)


CALLS: dict[str, tuple[Tree, str]] = {
    "papers that are no list": ({"papers": 5}, "config.papers: 5 must be a list of words"),
    "formats in a word": ({"formats": "gif"}, "config.formats: 'gif' must be a list of words"),
    "a negative seed": ({"seed": -1}, "config.seed: -1 must not be negative"),
    "half a seed": ({"seed": 5.0}, "config.seed: 5 must be a whole number"),
    "no samples": ({"samples": 0}, "config.samples: 0 must be 1 or more"),
    "a key that is neither of the schema nor a paper": (
        {"sample": {}},
        "config.sample: unknown key; did you mean 'samples'?",
    ),
    "a paper in a number": ({"ilo": 3}, "config.ilo: 3 must be a mapping of keys to values"),
    "a key in a number": ({3: 3}, "config: has the key 3, must be text"),
    "a date": ({"ilo": {"a": datetime.date(2007, 5, 1)}}, "config.ilo.a: is a date"),
}


@pytest.mark.parametrize("case", CALLS)
def test_invalid_call_configuration_is_refused(case: str) -> None:
    changes, said = CALLS[case]
    with pytest.raises(InputError) as caught:
        check_config(ROOT, {**CONFIG, **changes}, known_papers(ROOT))
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize(("word", "taken"), [("true", True), ("false", False)])
def test_boolean_words_of_the_command_line_are_converted(word: str, taken: bool) -> None:
    config = {**CONFIG, "cached": word}
    take_truths(config)
    assert config["cached"] is taken
    check_config(ROOT, config, known_papers(ROOT))


def test_terms_of_a_signal_are_checked() -> None:
    kind = Annotated[list[Any], signal(1)]
    assert parse(kind, [], "x") == []
    with pytest.raises(InputError, match=r"^x\[0\]\.kind: 'x' must be one"):
        parse(kind, [{"kind": "x"}], "x")


def test_observer_named_by_a_study_must_exist_with_the_right_form() -> None:
    observers = {"here": Observed("relay")}
    assert named(observers, "here", Observed) is observers["here"]
    with pytest.raises(InputError, match=r"^observers: must have 'her'; did you mean 'here'\?$"):
        named(observers, "her", Observed)
    with pytest.raises(InputError, match=r"^observers\.here\.algorithm: must not be relay here$"):
        named(observers, "here", int)


def test_parameter_without_declared_keys_is_reported() -> None:
    parameters = Parameters.load(ROOT, "ilo")
    parameters.tree["about"]["package"] = "papers.nobody"
    problem = r"^ilo\.about\.package: 'papers\.nobody': there is no module papers$"
    with pytest.raises(InputError, match=problem):
        declared_keys(parameters)


@dataclass(frozen=True)
class Observed:
    algorithm: str


def test_other_words_are_not_converted_to_booleans() -> None:
    config = {**CONFIG, "cached": "no"}
    take_truths(config)
    with pytest.raises(InputError, match=r"^config.cached: 'no' must be one of true and false"):
        check_config(ROOT, config, known_papers(ROOT))


def test_too_deeply_nested_tree_is_refused() -> None:
    deep: Any = []
    for _ in range(20_000):
        deep = [deep]
    with pytest.raises(InputError, match="nested"):
        check_plain({"ilo": deep}, "config")
    with pytest.raises(InputError, match="nested"):
        Parameters.load(ROOT, "ilo", {"plant": deep})

"""Designs: one-key changes of examples are refused by a key, or run and pass their test in C."""

from __future__ import annotations

import copy
import re
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reobserve.codegen import c_test
from reobserve.core.documents import Tree, parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.export_command import exported
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.examples import model_text
from reobserve.estimation.families.file import load_design, save_design

from . import times

STARTS = ("sampling_period", "initial_state", "initial_covariance")
QUICK = ("extended-kalman", "normal-form", "luenberger")
Path_ = tuple[str | int, ...]
Change = Any  # a kind, the path and new value of a number, and options
# Keys that examples leave out or that have another word.
OPTIONS: Tree = {
    "gate": 3.0, "outliers": "inflate", "noise_memory": 0.5, "time": "discrete", "substeps": 3,
    "periods": {"angle": "2*pi"}, "D": [[0.1], [0.0]], "output_fault_matrix": [[1.0], [0.0]],
    "parameter_states": {"friction": {"initial_variance": 0.1, "random_walk": 1e-7, "unit": "1"}},
    "dynamics": {"angle": "rate", "rate": "-sin(angle)*exp(-rate**2) - rate/(2 + cos(angle))"},
    "injection": {"rate": "sin(y1) - y1"}, "lipschitz": {"rate": {"angle": 9.81, "rate": 0.5}},
    "structure": "pi", "poles": ["-5+2j", "-5-2j"], "initial_probabilities": [0.25, 0.75],
    "C": [[0.0, 1.0]], "R": 1e-3, "order": 3, "variant": "continuous", "unknown_input": [0.1],
    "initial_unknown_input_covariance": 0.1, "initial_fault_covariance": 0.1, "inputs": {},
}  # fmt: skip


@cache
def model(kind: str) -> Tree:
    tree = parse_yaml(model_text(kind), kind)
    return {"initial_state": [0.3] * len(tree["states"]), **tree} if "states" in tree else tree


def chosen(kind: str, options: Sequence[str]) -> Tree:
    """The model with options."""
    return {**model(kind), **{key: OPTIONS[key] for key in options}}


def numbers(part: Any, path: Path_ = ()) -> Iterator[tuple[Path_, float]]:
    """All numbers of a model and where they stand."""
    if isinstance(part, dict | list):
        for key, inner in part.items() if isinstance(part, dict) else enumerate(part):
            yield from numbers(inner, (*path, key))
    elif isinstance(part, int | float) and not isinstance(part, bool):
        yield path, part


def changed(tree: Tree, path: Path_, value: Any) -> Tree:
    """The tree with another number at a place; or with one entry more there, of a list, or less."""
    tree = copy.deepcopy(tree)
    part: Any = tree
    for key in path[:-1]:
        part = part[key]
    if value == "more" and isinstance(part, list):
        part.append(part[-1])
    elif value == "less":
        del part[path[-1]]
    else:
        part[path[-1]] = value
    return tree


@st.composite
def changes(draw: st.DrawFn, kinds: tuple[str, ...]) -> Change:
    kind = draw(st.sampled_from(kinds))
    options = draw(st.lists(st.sampled_from([*OPTIONS]), max_size=2))
    found = list(numbers(chosen(kind, options)))
    starts = [one for one in found if one[0][0] in (*STARTS, *options)]
    path, value = draw(st.sampled_from(starts) | st.sampled_from(found))
    new = (
        st.sampled_from([0, 1, 3, -value, 1e150, -1e150, 1e-300, 1e308, 5e-324, "more", "less"])
        | st.integers(-9, 9).map(lambda power: value * 10.0**power)
        | st.floats(1e-3, 1e3).map(lambda factor: value * factor)
        | st.integers(-3, 300)
    )
    return kind, path, draw(new), *options


def check(kind: str, path: Path_, value: Any, *options: str) -> bool:
    """Design, load, export and test it: True if it is certified, False if a key is refused."""
    tree = changed(chosen(kind, options), path, value)
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # numpy's
        folder = Path(scratch)
        try:
            save_design(folder / "d.json", family(kind).designed(tree))
        except InputError as said:
            assert "\n" not in str(said)  # noqa: PT017
            assert len(str(said)) < 600  # noqa: PT017
            named = {re.sub(r"^gains\.|[.\[].*", "", key) for key in said.parameter.split(", ")}
            known = {*chosen(kind, options), *model(kind).get("gains", {}), *OWN}
            assert named <= known, said  # noqa: PT017
            return False
        for name, text in exported(load_design(folder / "d.json"), "d").items():
            (folder / name).write_text(text, encoding="utf-8")
        if shutil.which("cc"):
            command = [*c_test.COMPILE.format(name="d").split(), "-ffp-contract=off"]
            subprocess.run(command, check=True, cwd=folder)
            done = subprocess.run("./a.out", check=False, cwd=folder, capture_output=True)
            off = re.findall(r": off by (\S+) of at most", done.stdout.decode())
            assert off, done.stdout
            assert all(float(one) == 0.0 for one in off), done.stdout
    return True


# Of the model as a whole, of gains, of what a certificate or a solver found.
OWN = ("model", "gains", "certificate", "solver", "degree", "lambdas")


@given(changes(QUICK))
@example(("normal-form", ("sampling_period",), 3))
@example(("extended-kalman", ("sampling_period",), 100))
@example(("normal-form", ("initial_state", 0), 1e150))
@example(("extended-high-gain", ("initial_state", 0), 101))
@example(("extended-high-gain", ("sampling_period",), 0.019))
@example(("extended-high-gain", ("gains", "rho"), 78))
@example(("augmented-kalman", ("A", 0, 0), 1, "unknown_input"))
@times(1 / 12)
def test_changed_example_is_refused_or_exported(change: Change) -> None:
    check(*change)


@pytest.mark.nightly
@pytest.mark.parametrize("kind", FAMILIES)
def test_starts_and_periods_of_all_examples_are_refused_or_exported(kind: str) -> None:
    assert check(kind, *next(numbers(model(kind))))
    for path, value in numbers(model(kind)):
        if path[0] in STARTS:
            for new in (1e150, -1e150, 3, 100, 1e-300, 10 * value, 0.1 * value, 0):
                check(kind, path, new)


@pytest.mark.nightly
@given(changes(tuple(FAMILIES)))
def test_changed_examples_of_all_kinds_are_refused_or_exported(change: Change) -> None:
    check(*change)

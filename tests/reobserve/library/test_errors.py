"""Errors of the library: a user meets none whose class is private."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from reobserve import InputError, KalmanFilter, LevantDifferentiator, LinearModel, fit
from tests import ROOT

MODULES = sorted((ROOT / "src/reobserve").rglob("*.py"))
LEVANT = LevantDifferentiator(L=1.0, order=1, sampling_period=1.0)
MODEL = LinearModel([[1]], C=[[1]], Q=1, R=1)


def named(node: ast.AST | None) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)} if node else set()


def private_raised(tree: ast.AST) -> Iterator[str]:
    """Classes that a module raises, by a name of its own that begins with an underscore."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and node.exc is not None:
            yield from (name for name in named(node.exc) if name[0] == "_" and "Error" in name)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_private_errors_end_in_the_module_that_raises_them(path: Path) -> None:
    tree = ast.parse(path.read_text("utf-8"))
    caught: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ExceptHandler):
            private = {name for name in named(node.type) if name[0] == "_"}
            again = [each for each in ast.walk(node) if isinstance(each, ast.Raise)]
            assert not private or all(each.exc is not None for each in again), node.lineno
            caught |= private
        elif isinstance(node, ast.Call) and named(node.func) == {"suppress"}:
            caught |= named(node)
    assert set(private_raised(tree)) <= caught


@pytest.mark.parametrize(
    ("made", "records"),
    [
        (None, [[1.0]]),
        ((KalmanFilter(MODEL, gate=3.0), None), [[1.0]]),
        ((LEVANT, LEVANT.init([0.0, 0.0])), [[1.0]]),
        ((KalmanFilter(MODEL), KalmanFilter(MODEL).init([0], 1)), [[np.nan]]),
    ],
)
def test_misuse_of_fit_raises_a_public_error(made: object, records: object) -> None:
    with pytest.raises(InputError) as error:
        fit(lambda p: made, {"q": (0.1, 1.0)}, records)  # type: ignore[arg-type]
    assert type(error.value) is InputError

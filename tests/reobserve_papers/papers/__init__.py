"""Tests of the papers, with fixed parameters: a changed default breaks none of them."""

from pathlib import Path
from typing import Any

from reobserve.core.documents import read_yaml
from reobserve_papers.parameters.job import declared_keys, read_job
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT


def fixed_parameters(
    paper: str, overrides: dict[str, Any] | None = None, seed: int = 0
) -> Parameters:
    """The parameters of a paper, with the `fixed` ones at the values that its tests state."""
    return Parameters.load(ROOT, paper, fixed(paper, overrides or {}), seed)


def job_of(parameters: Parameters, step: str, name: str = "") -> Any:
    """What a step of a paper gets: the settings that it reads, as the paper's types."""
    return read_job(declared_keys(parameters), parameters.settings(step, name))


def fixed(paper: str, overrides: dict[str, Any]) -> dict[str, Any]:
    """Overrides, and values of all other parameters that the paper leaves open."""
    return merged(read_yaml(Path(__file__).parent / paper / "parameters.yaml"), overrides)


def merged(tree: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """A tree with values replaced by those of another one."""
    both = {key: merged(tree[key], over[key]) for key in tree.keys() & over.keys()
            if isinstance(tree[key], dict) and isinstance(over[key], dict)}  # fmt: skip
    return {**tree, **over, **both}

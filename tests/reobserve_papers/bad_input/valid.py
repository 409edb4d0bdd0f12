"""Valid files of the papers, from the project and from its commands."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.core.files import write_table
from reobserve_papers.claims.checks import Numbers
from reobserve_papers.claims.outcomes import taken
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.sample_table import Samples, as_text, write_samples
from reobserve_papers.claims.title import row_as_stated, write_alternatives
from reobserve_papers.golden.number_files import read_metrics
from reobserve_papers.metrics.metrics import HEADER, lookup
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import result

from .outcome import ROOT, command

_FOLDER = tempfile.TemporaryDirectory(prefix="bad-input-")

# A scenario, an observer and, if needed, a design of each paper.
OBSERVERS = {
    "ilo": ("constant", "sampled", ""),
    "lie": ("figure", "order4", "linear"),
    "delay": ("ramp", "order2", ""),
    "imm": ("plain", "kalman", ""),
    "eso": ("disturbed", "pd_pi", "pd_pi"),
}
PAPERS = tuple(OBSERVERS)


@cache
def tree(path: str) -> Any:
    """A YAML file of the project."""
    return read_yaml(ROOT / path)


def paper(name: str) -> Any:
    """The parameter file of a paper."""
    return tree(f"config/papers/{name}.yaml")


@cache
def parameters(paper: str) -> Path:
    """The parameters of a paper as stored by a build."""
    name = f"results/{paper}/parameters.json"
    return _made("stage", "parameters", paper, "--project", ROOT, name=name)


def step(step: str, paper: str, *names: str) -> Path:
    """The result of a step of a paper."""
    path = Path(_FOLDER.name, result(paper, step, *names))
    if not path.exists():
        command("stage", step, parameters(paper), *names)
    return path


def record(paper: str) -> Path:
    """The record of the plant for the scenario in `OBSERVERS`."""
    return step("plant", paper, OBSERVERS[paper][0])


def design(paper: str, name: str) -> Path:
    """A design of a paper."""
    return step("design", paper, name)


def beside(*paths: Path) -> dict[str, bytes]:
    """Files by their paths in a project."""
    return {path.relative_to(_FOLDER.name).as_posix(): path.read_bytes() for path in paths}


@cache
def results() -> dict[str, bytes]:
    """The results from which the verdicts on the claims of `eso` are computed."""
    found = {"parameters.json": parameters("eso").read_bytes()}
    numbers = {}
    for figure in (*paper("eso")["figures"], "theory"):
        file = Path(_FOLDER.name) / f"{figure}.metrics.csv"
        accepted = read_metrics(ROOT, "eso", figure)
        write_table(file, map(asdict, accepted), HEADER)
        numbers[figure] = lookup(accepted)
        found[file.name] = file.read_bytes()
    write_samples(Path(_FOLDER.name) / "robustness.json", *_samples(numbers))
    found["robustness.json"] = Path(_FOLDER.name, "robustness.json").read_bytes()
    write_alternatives(Path(_FOLDER.name) / "alternatives.csv", [row_as_stated("[Re?]")])
    found["alternatives.csv"] = Path(_FOLDER.name, "alternatives.csv").read_bytes()
    return {f"results/eso/{name}": content for name, content in found.items()}


def _samples(numbers: Numbers) -> tuple[Parameters, dict[str, Samples]]:
    """Two samples of each claim, which are the accepted numbers."""
    read, claims = Parameters.load(ROOT, "eso"), {}
    for claim in read_registry(ROOT, read).claims:
        if claim.choices and claim.checks:
            with suppress(InputError):  # of a number that has yet to be accepted
                found = taken(claim.wanted, numbers)
                text = as_text(claim.wanted, found)
                claims[claim.name] = Samples("", tuple(map(str, claim.wanted)), (text, text))
    return read, claims


@cache
def claims_table() -> bytes:
    """The verdicts on the claims of `eso`."""
    folder = Path(_FOLDER.name)
    for name, content in results().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    (folder / "config").symlink_to(ROOT / "config")
    command("stage", "claims", folder / "results/eso/parameters.json")
    return (folder / result("eso", "claims")).read_bytes()


@cache
def study() -> tuple[Path, list[Path]]:
    """The study of orders of `lie`, and the record and the estimates shown in its figure."""
    found = [record("lie")]
    for name in paper("lie")["figures"]["fig1_orders"]["observers"]:
        design("lie", paper("lie")["observers"][name]["design"])
        found.append(step("observe", "lie", OBSERVERS["lie"][0], name))
    design("lie", "linear")
    return step("study", "lie", "orders"), found


def _made(*words: object, name: str) -> Path:
    path = Path(_FOLDER.name, name)
    command(*words, "--output", path)
    return path

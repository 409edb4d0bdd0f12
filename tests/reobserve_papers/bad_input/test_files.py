"""Files of the papers, and of the steps of a build, with a few changes."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.core.documents import read_yaml
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.prepare import load_parameters
from reobserve_papers.signals.inputs import Signal
from tests.reobserve.bad_input import readers
from tests.reobserve.bad_input.readers import (
    ONCE_OTHER_ERRORS,
    check_changed_files,
    check_token,
    made,
)

from . import valid
from .outcome import command, is_accepted

Reader = partial(readers.Reader, is_accepted=is_accepted)


def words(*line: object) -> Callable[[], object]:
    return lambda: command(*line)


def _unsealed(content: bytes) -> dict[str, Any]:
    """Without the digest, by which whatever else is damaged would be refused."""
    tree: dict[str, Any] = json.loads(content)
    return {name: part for name, part in tree.items() if name != "sha256"}


def parameter_file(paper: str) -> readers.Reader:
    line = words("stage", "parameters", paper, "--project", ".", "--output", "out.json")
    return Reader(f"config/papers/{paper}.yaml", line, valid.paper(paper))


def checked_file(paper: str) -> readers.Reader:
    line = words("check", paper, "--project", ".")
    return Reader(f"config/papers/{paper}.yaml", line, valid.paper(paper))


def settings() -> readers.Reader:
    def load() -> None:
        load_parameters(Path(), read_yaml(Path("config/config.yaml")))

    return Reader("config/config.yaml", load, valid.tree("config/config.yaml"))


def claims() -> readers.Reader:
    line = words("stage", "claims", "results/eso/parameters.json")
    path = "config/claims/eso.yaml"
    return Reader(path, line, valid.tree(path), others=valid.results())


def errata() -> readers.Reader:
    line = words("report", "--papers", "lie", "--project", ".", "--output", "report.html")
    return Reader("config/errata/lie.yaml", line, valid.tree("config/errata/lie.yaml"))


def stored_parameters(paper: str) -> readers.Reader:
    path = f"results/{paper}/parameters.json"
    line = words("stage", "plant", path, valid.OBSERVERS[paper][0])
    return Reader(path, line, json.loads(valid.parameters(paper).read_bytes()))


def paper_design(paper: str) -> readers.Reader:
    scenario, observer, design = valid.OBSERVERS[paper]
    line = words("stage", "observe", f"results/{paper}/parameters.json", scenario, observer)
    others = valid.beside(valid.parameters(paper), valid.record(paper))
    ((path, content),) = valid.beside(valid.design(paper, design)).items()
    return Reader(path, line, _unsealed(content), others=others)


def observed_record(paper: str) -> readers.Reader:
    scenario, observer, design = valid.OBSERVERS[paper]
    line = words("stage", "observe", f"results/{paper}/parameters.json", scenario, observer)
    designs = [valid.design(paper, design)] if design else []
    ((path, content),) = valid.beside(valid.record(paper)).items()
    others = valid.beside(valid.parameters(paper), *designs)
    return Reader(path, line, content=content, others=others)


def samples() -> readers.Reader:
    def read() -> None:
        term = {"kind": "samples", "axis": 1, "file": "in.csv", "column": "torque"}
        values = Signal.parse("fault", [term], 1)(np.linspace(0.0, 3.0, 50))
        assert np.isfinite(values).all()

    return Reader("in.csv", read, content=b"time,torque\n0,0\n0.5,0.1\n1.0,-0.2\n2.5,1e-3\n")


def metrics() -> readers.Reader:
    line = words("stage", "claims", "results/eso/parameters.json")
    path = "results/eso/fig2.metrics.csv"
    return Reader(path, line, content=valid.results()[path], others=valid.results())


def robustness() -> readers.Reader:
    line = words("stage", "claims", "results/eso/parameters.json")
    path = "results/eso/robustness.json"
    return Reader(path, line, _unsealed(valid.results()[path]), others=valid.results())


def conventions() -> readers.Reader:
    def check() -> None:
        check_evidence(Path(), Parameters.load(Path(), "eso"))

    path = "config/conventions.yaml"
    return Reader(path, check, valid.tree(path))


def alternatives_table() -> readers.Reader:
    line = words("stage", "claims", "results/eso/parameters.json")
    path = "results/eso/alternatives.csv"
    return Reader(path, line, content=valid.results()[path], others=valid.results())


def study_table() -> readers.Reader:
    study, others = valid.study()
    line = words("stage", "metrics", "results/lie/parameters.json", "fig1_orders")
    ((path, content),) = valid.beside(study).items()
    return Reader(
        path, line, content=content, others=valid.beside(valid.parameters("lie"), *others)
    )


def claims_table() -> readers.Reader:
    names = ("results/eso/parameters.json", "results/eso/alternatives.csv")
    line = words("stage", "verdicts", "results/eso/parameters.json")
    others = {name: valid.results()[name] for name in names}
    return Reader("results/claims.csv", line, content=valid.claims_table(), others=others)


READERS: dict[Callable[..., readers.Reader], list[Any]] = {
    parameter_file: [*valid.PAPERS],
    checked_file: ["eso"],
    settings: [],
    claims: [],
    conventions: [],
    alternatives_table: [],
    errata: [],
    stored_parameters: [*valid.PAPERS],
    paper_design: ["lie", "eso"],
    observed_record: [*valid.PAPERS],
    samples: [],
    metrics: [],
    robustness: [],
    study_table: [],
    claims_table: [],
}


@pytest.mark.nightly_after(4)
@pytest.mark.parametrize("reader", READERS)
def test_changed_files_are_accepted_or_refused(reader: Callable[..., readers.Reader]) -> None:
    check_changed_files(made(reader, READERS[reader]))


@pytest.mark.nightly_after(42)
@pytest.mark.parametrize("token", ONCE_OTHER_ERRORS)
def test_yaml_that_once_raised_other_errors_is_refused(token: bytes) -> None:
    check_token(token, [parameter_file("ilo")])

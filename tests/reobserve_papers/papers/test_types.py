"""mypy sees what a paper's steps take from its parameter file."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import pytest
from mypy import api

from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.step_kinds import KINDS
from tests import ROOT

PAPERS = known_papers(ROOT)

# In files of each paper, fields of its parameter file, whose last letter is doubled: mypy takes a
# file of the same size for the one that it knows.
FIELDS = {
    "ilo": {"plant": "plant.inertia", "observe": "mine.initial_rate", "metrics": "rules.axis"},
    "eso": {
        "plant": "job.plant.initial_state", "observe": "observer.initial_estimate",
        "metrics": "job.observers[name].compared_with",
    },
    "lie": {
        "plant": "job.scenario.initial_state", "observe": "mine.initial_estimate",
        "metrics": "rules.settling_band",
    },
    "delay": {
        "plant": "scenario.noise_share", "observe": "observer.mean_delay", "metrics": "rules.late",
    },
    "imm": {
        "plant": "scenario.input_unit", "observe": "observer.realisation",
        "metrics": "scenario.fault",
    },
}  # fmt: skip


def source(paper: str, part: str) -> Path:
    return ROOT / "src" / "reobserve_papers" / "papers" / paper / f"{part}.py"


def test_misspelled_field_is_an_error_of_types(tmp_path: Path) -> None:
    """One run for all papers, which reads copies in place of their files."""
    shadows, files, wanted = [], [], set()
    for paper, parts in FIELDS.items():
        for part, field in parts.items():
            right = field.rpartition(".")[2]
            wrong = f"{right}{right[-1]}"
            text = source(paper, part).read_text(encoding="utf-8")
            assert f"{field}" in text
            copy = tmp_path / f"{paper}_{part}.py"
            copy.write_text(text.replace(field, f"{field.rpartition('.')[0]}.{wrong}", 1))
            files.append(str(source(paper, part)))
            shadows += ["--shadow-file", files[-1], str(copy)]
            wanted.add((paper, part, wrong))
    config = ["--config-file", str(ROOT / "pyproject.toml")]
    said, problem, _ = api.run([*config, *shadows, *files])
    assert not problem
    found = re.findall(r'papers/(\w+)/(\w+)\.py:\d+: error: .* has no attribute "(\w+)"', said)
    assert set(found) == wanted


@pytest.mark.parametrize("paper", PAPERS)
def test_steps_take_the_types_of_their_paper(paper: str) -> None:
    """And none of these types is `Any`."""
    package = f"reobserve_papers.papers.{paper}"
    job = importlib.import_module(f"{package}.keys").Job
    assert Any not in get_args(job)
    for name, taken in steps(package):
        assert taken in (job, FigureData[job]), name
        assert get_origin(taken) is not None


def steps(package: str) -> Iterator[tuple[str, Any]]:
    """The functions of a paper that jobs call, and the type of what each takes first."""
    for part, kind in KINDS.items():
        try:
            module = importlib.import_module(f"{package}.{part}")
        except ModuleNotFoundError:
            continue
        if not kind.function:
            continue
        step = getattr(module, kind.function)
        hints = get_type_hints(step)
        yield f"{part}.{kind.function}", hints[step.__code__.co_varnames[0]]
    for layout, draw in importlib.import_module(f"{package}.plot").LAYOUTS.items():
        yield layout, get_type_hints(draw)["data"]

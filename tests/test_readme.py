"""The README: its code runs and is typed, and its numbers come from the build."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib import rc_context, rcdefaults

from reobserve.core.documents import read_yaml
from reobserve_papers.claims.registry import read_claims
from reobserve_papers.figure_diff.pixels import read_pixels
from reobserve_papers.parameters.parameter_file import Configuration
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.prepare import _DEFAULTS
from tests import ROOT

from . import FIVE
from .published_numbers import numbers_left, squeezed

README = (ROOT / "README.md").read_text(encoding="utf-8")
LIBRARY, CALLS = (
    (ROOT / f"docs/pages/{name}.md").read_text(encoding="utf-8")
    for name in ("start/library", "reference/calls")
)


def test_python_examples_of_readme_and_library_pages_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    figure, short = python_of(README)
    with rc_context():
        rcdefaults()
        exec(compile(short, "README.md", "exec"), {})
    (shown,) = re.findall(r"```text\n(.*?)```", README, re.DOTALL)
    assert capsys.readouterr().out == shown
    assert read_pixels(tmp_path / "tank.png").std() > 10  # not blank
    replicated: dict[str, object] = {}
    exec(compile(figure, "README.md", "exec"), replicated)
    assert replicated["result"].metrics.shape[1] == 4  # type: ignore[attr-defined]
    assert (tmp_path / "fig1.pdf").read_bytes().startswith(b"%PDF")
    first, names = run_all(LIBRARY, "library.md"), run_all(CALLS, "calls.md")
    # It oscillates like the healthy model.
    assert names["diagnosis"]["probability"][1000:, 0].mean() > 0.9  # type: ignore[index]
    # Lost samples are filled, and no torque is found where there was none.
    filtered, torques = first["filtered"], names["torques"]
    assert filtered.missing == 10  # type: ignore[attr-defined]
    assert np.max(np.abs(filtered["state"][:, 0] - names["angle"])) < 1e-3  # type: ignore[index, operator]
    assert np.max(np.abs(torques["unknown_input"][1000:])) < 1e-2  # type: ignore[index]


def run_all(page: str, title: str) -> dict[str, object]:
    """The names of a page after its code."""
    names: dict[str, object] = {}
    for block in python_of(page):
        exec(compile(block, title, "exec"), names)
    return names


def python_of(text: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def test_python_examples_pass_mypy(tmp_path: Path) -> None:
    """With the strictness of the library: a type checker of the reader knows the results of
    calls."""
    for name, page in {"library": LIBRARY, "calls": CALLS}.items():
        (tmp_path / f"{name}.py").write_text("".join(python_of(page)), encoding="utf-8")
    strict = ("--strict", "--config-file", str(ROOT / "pyproject.toml"))
    cache = ("--cache-dir", str(ROOT / ".mypy_cache"))  # the cache of `make check` for the library
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *strict, *cache, "library.py", "calls.py"],
        cwd=tmp_path, env={**os.environ, "MYPYPATH": str(ROOT / "src")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def of_verdicts() -> Iterator[str]:
    """The rows of the table: main claims by their accepted verdicts, and the sentence for them."""
    with (ROOT / "tests/golden/claims.csv").open() as stream:
        found = {(row["paper"], row["claim"]): row["verdict"] for row in csv.DictReader(stream)}
    for paper in FIVE:
        stated = read_claims(ROOT, paper)
        mains = [name for name, claim in stated.claims.items() if claim.promised]
        verdicts = [found[paper, name] for name in mains if found[paper, name] != "not testable"]
        assert stated.result
        reproduced, refuted = map(verdicts.count, ("reproduced", "contradicted"))
        yield f"| {reproduced} of {len(verdicts)} | {refuted} | {stated.result.sentence} |"


def of_the_project() -> Iterator[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["requires-python"] == ">=3.11"
    assert "3.15" in (ROOT / "Makefile").read_text().replace("(3, 15)", "3.15")
    yield "Python 3.11 or newer (up to 3.14, as long as cvxpy has no wheels for 3.15)"
    for paper in FIVE:
        year = Parameters.load(ROOT, paper).tree["about"].get("year")
        if year:
            yield f"({year}),"


NUMBERS = [
    pytest.param(text, id=f"{reported.__name__}-{k}")
    for reported in (of_verdicts, of_the_project)
    for k, text in enumerate(reported())
]


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_in_the_readme_agree_with_the_build(text: str) -> None:
    assert text in squeezed(README)


def test_readme_has_no_other_numbers() -> None:
    """Outside code, names and the compared numbers there are no digits."""
    before, _, rest = README.partition("<!-- verdicts -->")
    verdicts, _, after = rest.partition("<!-- end -->")
    reported = [str(parameter.values[0]) for parameter in NUMBERS]
    assert numbers_left(before + verdicts + after, reported) == []


def test_build_options_are_listed_in_the_config_table() -> None:
    text = (ROOT / "config/README.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| .* \| (?:`(.*)`)? ?\|$", text, re.MULTILINE))
    defaults = read_yaml(ROOT / "config/config.yaml")
    assert {name: yaml.safe_load(value) for name, value in rows.items() if value} == defaults
    folders = {path.name for path in (ROOT / "config").iterdir() if path.is_dir()}
    assert folders <= set(re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE))
    assert set(rows) == set(Configuration.model_fields)
    for name, value in _DEFAULTS.items():
        assert Configuration.model_fields[name].default == value == defaults[name]

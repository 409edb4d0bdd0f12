"""The README: its code runs, its example is accepted, and it has no number of its own."""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from reobserve.evidence.claims.verdicts import VERDICTS
from reobserve.ledger.ledger import Ledger

from . import FIVE
from .found import numbers_left, of_delay, of_eso, of_ilo, of_imm, of_lie, squeezed

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


@pytest.mark.parametrize("name", ["README.md", "docs/pages/start/library.md"])
def test_the_python_of_the_readme_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    text = (ROOT / name).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) >= 2
    for block in blocks[:2]:
        exec(compile(block, name, "exec"), names)
    # J w' of the record is all "fault" here: the first axis moves, and 1.5 of it couples over.
    time, fault = names["time"], names["run"]["fault"]  # type: ignore[index]
    expected = 0.01 * np.cos(time)[:, None] * [36, 1.5, 0]  # type: ignore[index]
    assert np.max(np.abs(fault[1000:] - expected[1000:])) < 0.02
    for block in blocks[2:]:
        exec(compile(block, name, "exec"), names)
    # The record is no exact motion of the pendulum, but near one.
    rate = names["motion"]["state"][1000:, 1]  # type: ignore[index]
    assert np.max(np.abs(rate - np.gradient(names["angle"], time)[1000:])) < 0.01  # type: ignore[arg-type]
    # A motor at rest under half a volt has lost half a volt.
    assert abs(names["found"]["actuator_fault"][-1, 0] + 0.5) < 1e-6  # type: ignore[index]
    # It swings as the sound model does.
    assert names["diagnosis"]["probability"][1000:, 0].mean() > 0.9  # type: ignore[index]
    # What was lost is filled in, and no torque is found where there was none.
    filtered, torques = names["filtered"], names["torques"]
    assert filtered.missing == 10  # type: ignore[attr-defined]
    assert np.max(np.abs(filtered["state"][:, 0] - names["angle"])) < 1e-3  # type: ignore[index, operator]
    assert np.max(np.abs(torques["unknown_input"][1000:])) < 1e-2  # type: ignore[index]


def test_the_example_of_the_readme_is_accepted(tmp_path: Path) -> None:
    block = re.search(r"```yaml\n(.*?)```", README, re.DOTALL)
    assert block
    overrides = yaml.safe_load(block[1])["ilo"]
    ledger = Ledger.load(ROOT, "ilo", overrides)
    assert ledger.section("observers", "eager")["K2"] == 4000
    assert ledger.section("observers", "eager")["damping"] == 20000
    assert ledger.section("observers", "sampled")["K2"] == 1500
    assert ledger.section("figures", "fig9")["observers"] == ["sampled", "eager"]


def of_verdicts() -> Iterator[str]:
    """The rows of the table; the pictures' words are compared with the build, in the pipeline."""
    with (ROOT / "tests/golden/claims.csv").open() as stream:
        found = [(row["paper"], row["verdict"]) for row in csv.DictReader(stream)]
    for paper in dict.fromkeys(name for name, _ in found):
        verdicts = [verdict for name, verdict in found if name == paper]
        counts = " | ".join(str(verdicts.count(word)) for word in VERDICTS)
        yield f"| {len(verdicts)} | {counts} |"


def of_the_project() -> Iterator[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["requires-python"] == ">=3.11"
    assert "3.15" in (ROOT / "Makefile").read_text().replace("(3, 15)", "3.15")
    yield "Python 3.11 or newer (up to 3.14, as long as cvxpy has no wheels for 3.15)"
    for paper in FIVE:
        year = Ledger.load(ROOT, paper).tree["about"].get("year")
        if year:
            yield f"({year}):"


NUMBERS = [
    pytest.param(text, id=f"{told.__name__}-{k}")
    for told in (of_ilo, of_lie, of_delay, of_imm, of_eso, of_verdicts, of_the_project)
    for k, text in enumerate(told())
]


@pytest.mark.parametrize("text", NUMBERS)
def test_the_numbers_of_the_readme_are_those_of_the_build(text: str) -> None:
    assert text in squeezed(README)


def test_the_readme_has_no_other_numbers() -> None:
    """Without code, names and what is compared above, no digit is left."""
    before, _, rest = README.partition("<!-- verdicts -->")
    verdicts, _, after = rest.partition("<!-- end -->")
    pictures = re.sub(r"\d+ (reproduced|depends|contradicted|undecided|not testable)", "", verdicts)
    told = [str(parameter.values[0]) for parameter in NUMBERS]
    assert numbers_left(before + pictures + after, told) == []

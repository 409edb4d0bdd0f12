"""An installation with an extra runs what the extra is for, and one without names the extra."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from reobserve.core.extras import EXTRAS
from reobserve_papers.parameters.prepare import PLATFORMS
from tests import ROOT

DECLARED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = DECLARED["optional-dependencies"]
README, LIBRARY, CALLS, PAGE = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in (
        "README.md",
        "docs/pages/start/library.md",
        "docs/pages/reference/calls.md",
        "docs/pages/start/installation.md",
    )
)

# Import names that differ from the package name.
IMPORTED = {
    "python-flint": "flint", "pyyaml": "yaml", "pillow": "PIL",
    "typing-extensions": "typing_extensions",
}  # fmt: skip

ONLY = """
import runpy, sys

hidden, program = sys.argv[1].split(), sys.argv[2]

class Hidden:  # as if these packages were not installed
    def find_spec(name, path=None, target=None):
        top = name.partition(".")[0]
        if top in hidden:
            raise ModuleNotFoundError(f"No module named {top!r}", name=top)

sys.meta_path.insert(0, Hidden)
runpy.run_path(program)
"""


def requirements(one: Requirement) -> list[Requirement]:
    """What a package requires, with its extras."""
    if one.name == "reobserve":
        named = [line for extra in one.extras for line in OPTIONAL[extra]]
        return [*map(Requirement, [*DECLARED["dependencies"], *named])]
    lines = map(Requirement, metadata.requires(one.name) or [])
    extras = one.extras or {""}
    return [
        line
        for line in lines
        if line.marker is None or any(line.marker.evaluate({"extra": extra}) for extra in extras)
    ]


def run_with(extras: str, program: Path, folder: Path) -> str:
    """Run a program as after an installation with these extras and nothing else."""
    waiting, found = [Requirement(f"reobserve[{extras}]")], set()
    while waiting:
        one = waiting.pop()
        if str(one) not in found:
            found.add(str(one))
            waiting += requirements(one)
    brought = {canonicalize_name(Requirement(one).name) for one in found}
    hidden = [
        module
        for module, packages in metadata.packages_distributions().items()
        if brought.isdisjoint(map(canonicalize_name, packages))
    ]
    done = subprocess.run(
        [sys.executable, "-c", ONLY, " ".join(hidden), str(program)],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("extra", ["core", *sorted({*OPTIONAL} - {"all"})])
def test_extra_brings_what_its_program_takes(extra: str, tmp_path: Path) -> None:
    program = ROOT / f"tests/package/extras/{extra}.py"
    run_with("" if extra == "core" else extra, program, tmp_path)


@pytest.mark.nightly_cases("library", "calls")
@pytest.mark.parametrize(
    ("text", "blocks"),
    [(README, slice(1, 2)), (LIBRARY, slice(None)), (CALLS, slice(None))],
    ids=["README", "library", "calls"],
)
def test_page_names_the_extras_that_its_code_takes(
    text: str, blocks: slice, tmp_path: Path
) -> None:
    before, *_ = text.partition("```python")
    extras = re.findall(r'pip install "\.\[([\w,]+)\]"', before)[-1]
    program = tmp_path / "page.py"
    found = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[blocks]
    program.write_text("\n".join(found), encoding="utf-8")
    run_with(extras, program, tmp_path)


def declared(extra: str) -> set[str]:
    """The names by which the packages that an extra lists are imported."""
    found = set()
    for one in map(Requirement, OPTIONAL[extra]):
        parts = map(declared, one.extras) if one.name == "reobserve" else ()
        found |= set().union(*parts) or {IMPORTED.get(one.name, one.name)}
    return found


def test_extras_of_packages_are_those_that_are_declared() -> None:
    brought = {extra: declared(extra) for extra in OPTIONAL if extra != "all"}
    # Snakemake and the syntax highlighter of its report are never imported by the package.
    assert set().union(*brought.values()) == {*EXTRAS, "snakemake", "pygments"}
    for package, extras in EXTRAS.items():
        assert {*extras} == {extra for extra, names in brought.items() if package in names}
    assert declared("all") == brought["papers"]
    core = {Requirement(line).name for line in DECLARED["dependencies"]}
    assert core == {"numpy", "scipy", "numba", "llvmlite"}


def test_table_of_extras_is_that_of_the_declaration() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \|", PAGE, re.MULTILINE)
    assert {name: re.findall(r"[\w-]+", packages) for name, packages in rows} == {
        name: [
            word
            for one in map(Requirement, lines)
            for word in (sorted(one.extras) if one.name == "reobserve" else [one.name])
        ]
        for name, lines in OPTIONAL.items()
    }


@pytest.mark.parametrize("page", ["README.md", "docs/pages/start/installation.md"])
def test_pages_name_the_platforms_that_the_workflow_names(page: str) -> None:
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert f"The workflow {PLATFORMS}" in text

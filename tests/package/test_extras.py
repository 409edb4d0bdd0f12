"""Each extra in an environment that has only it."""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from reobserve.extras import EXTRAS as BROUGHT_BY

from .environments import EXTRAS, ROOT, closure, link, python

USES = Path(__file__).parent / "uses"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DECLARED = {
    extra: [Requirement(line) for line in lines]
    for extra, lines in PROJECT["optional-dependencies"].items()
}

# What a package is imported as, where that is not its name.
IMPORTED = {"python-flint": "flint", "pyyaml": "yaml", "pillow": "PIL", "scikit-image": "skimage"}


@pytest.mark.parametrize("extra", [name for name in EXTRAS if name != "all"])
def test_an_extra_serves_its_users(extra: str, unpacked: Path, tmp_path: Path) -> None:
    site = link(closure(unpacked, extra), tmp_path / "site")
    (about,) = unpacked.glob("*.dist-info")
    (site / about.name).symlink_to(about)
    # The package itself from here, whose loops are compiled already; the wheel holds the same.
    words, environment = python(ROOT / "src", site)
    empty = tmp_path / "empty"
    empty.mkdir()
    script = [str(USES / f"{extra}.py"), str(ROOT)]
    done = subprocess.run(
        [*words, *script], cwd=empty, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_core_is_three_packages_and_all_is_all(unpacked: Path) -> None:
    assert set(closure(unpacked, "core")) == {"numpy", "scipy", "numba", "llvmlite"}
    everything = closure(unpacked, "all")
    for extra in EXTRAS:
        assert set(closure(unpacked, extra)) <= set(everything)


def test_a_sentence_names_an_extra_that_brings_the_package() -> None:
    names = {
        extra: {IMPORTED.get(one.name, one.name) for one in needed}
        for extra, needed in DECLARED.items()
    }
    for package, extra in BROUGHT_BY.items():
        assert package in names[extra], package
    # Snakemake and what colours its report are called by name, never imported by the package.
    of_snakemake = {"reobserve", "snakemake", "pygments"}
    assert set().union(*names.values()) == {*BROUGHT_BY, *of_snakemake}


def test_a_package_has_one_bound_wherever_it_is_named() -> None:
    bounds: dict[str, set[str]] = {}
    for needed in DECLARED.values():
        for one in needed:
            bounds.setdefault(one.name, set()).add(str(one.specifier))
    assert {name for name, found in bounds.items() if len(found) > 1} == set()

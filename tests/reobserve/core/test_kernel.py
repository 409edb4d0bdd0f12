"""Compilation by numba: the disk cache, and what importing the package leaves unchanged."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SUMS = """
from reobserve.core.kernel import kernel
from reobserve.core.{other} import half

@kernel
def twice(x):
    return half(4 * x)
"""
HALF = """
from reobserve.core.kernel import kernel

@kernel
def half(x):
    return x / {divisor}
"""
RUN = "from reobserve.core.sums import twice; print(twice(1.0), len(twice.stats.cache_hits))"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with a minimal package and a kernel that calls one of another module."""
    import reobserve

    root = Path(reobserve.__file__).parent
    for name in ("__init__.py", "core/__init__.py", "core/kernel.py"):
        copy = tmp_path / "reobserve" / name
        copy.parent.mkdir(exist_ok=True, parents=True)
        copy.write_bytes((root / name).read_bytes())
    (tmp_path / "reobserve/core/sums.py").write_text(SUMS.format(other="halves"))
    (tmp_path / "reobserve/core/halves.py").write_text(HALF.format(divisor=2))
    return tmp_path


def run(folder: Path, program: str = RUN, **environment: str) -> str:
    """The output of a program that must print nothing on stderr."""
    variables = {"NUMBA_CACHE_DIR": "", "HOME": str(folder), "XDG_CACHE_HOME": ""}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(folder), **variables, **environment},
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_second_process_loads_cached_machine_code(package: Path) -> None:
    assert run(package) == "2.0 0\n"
    assert run(package) == "2.0 1\n"


def test_edited_kernel_is_recompiled_in_its_callers(package: Path) -> None:
    assert run(package) == "2.0 0\n"
    (package / "reobserve/core/halves.py").write_text(HALF.format(divisor=4))
    assert run(package) == "1.0 0\n"


@pytest.mark.parametrize("called", ["papers", "others"])
def test_edited_kernel_of_another_package_is_recompiled_in_its_callers(
    package: Path, called: str
) -> None:
    for name in {"papers", called}:
        (package / name).mkdir()
        (package / name / "__init__.py").touch()
    sums = SUMS.format(other="").replace("reobserve.core. ", f"{called}.halves ")
    (package / "papers/sums.py").write_text(sums)
    program = RUN.replace("reobserve.core.sums", "papers.sums")
    for divisor, answer in ((2, "2.0 0\n"), (2, "2.0 1\n"), (4, "1.0 0\n")):
        (package / called / "halves.py").write_text(HALF.format(divisor=divisor))
        assert run(package, program) == answer


def test_unwritable_cache_folder_only_costs_time(package: Path) -> None:
    for name in ("", "core/"):
        # A file in place of a folder also stops root.
        (package / f"reobserve/{name}__pycache__").write_text("")
    assert run(package) == "2.0 0\n"
    assert run(package) == "2.0 1\n", "from the cache folder of the user"
    (package / "blocked").write_text("")
    blocked = str(package / "blocked")
    for _ in range(2):
        assert run(package, NUMBA_CACHE_DIR=f"{blocked}/cache", HOME=blocked) == "2.0 0\n"


def test_compilation_works_without_a_home_folder(package: Path) -> None:
    program = f"import os.path; os.path.expanduser = lambda path: path; {RUN}"
    assert run(package, program) == "2.0 0\n"


def test_importing_the_library_does_not_change_warnings_or_other_caches() -> None:
    program = (
        "import warnings, numba, scipy.linalg, scipy.integrate\n"
        "before = list(warnings.filters), numba.config.CACHE_DIR\n"
        "import reobserve.observers.imm, reobserve.observers.extended_high_gain\n"
        "assert before == (list(warnings.filters), numba.config.CACHE_DIR)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def test_modules_import_only_public_numba_names() -> None:
    """Names documented in its manual are at the top level or in ``numba.extending``."""
    import reobserve

    root = Path(reobserve.__file__).parent
    internal = [path for path in root.rglob("*.py") if "numba.core" in path.read_text()]
    assert internal == []


INLINED = HALF.replace("import kernel", "import inlined_kernel as kernel")
CALLED = "from reobserve.core.halves import half; print(half(3.0), half(5.0)); " + RUN


def test_inlined_functions_can_be_called_from_python(package: Path) -> None:
    (package / "reobserve/core/halves.py").write_text(INLINED.format(divisor=2))
    assert run(package, CALLED) == "1.5 2.5\n2.0 0\n"
    assert run(package, CALLED) == "1.5 2.5\n2.0 1\n", "both from the cache"


MAKES = """
from reobserve.core.kernel import allocating_kernel, inlined_kernel, kernel
import numpy as np

@kernel
def twice(x, out):
    for i in range(len(x)):
        out[i] = 2 * x[i]

@inlined_kernel
def shifted(x, out):
    for i in range(1, len(x)):
        out[i] = x[i - 1]

@allocating_kernel
def total(x):
    out, moved = np.empty(len(x)), np.zeros(len(x))
    twice(x, out)
    shifted(out, moved)
    return moved.sum()
"""
MADE = "import numpy as np; from reobserve.core.made import total; print(total(np.arange(4.0)))"
FORGET = """
import numba
for one in numba.njit(lambda: 0).targetdescr.options.__mro__:
    if "_nrt" in vars(one):
        del one._nrt
"""


def test_kernels_allocate_only_where_it_is_said(package: Path) -> None:
    (package / "reobserve/core/made.py").write_text(MAKES)
    assert run(package, MADE) == "6.0\n"
    hidden = MAKES.replace("@allocating_kernel", "@kernel")
    (package / "reobserve/core/made.py").write_text(hidden)
    refused = f"""
import numba
try:
    {MADE}
except numba.NumbaError:
    print("refused")
"""
    assert run(package, refused) == "refused\n"


def test_numba_that_always_counts_references_only_costs_time(package: Path) -> None:
    (package / "reobserve/core/made.py").write_text(MAKES)
    assert run(package, FORGET + MADE) == "6.0\n"
    refused = """
try:
    numba.njit(_nrt=False)(lambda x: x)(1)
except KeyError:
    print("unknown")
"""
    assert run(package, FORGET + refused) == "unknown\n"

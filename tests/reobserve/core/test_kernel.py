"""Compilation by numba: the disk cache, and what importing the package leaves unchanged."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.forks import Forks, forking

Run = Callable[..., str]

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
    names = "__init__.py", "__init__.pyi", "core/__init__.py", "core/kernel.py"
    for name in (
        *names,
        "core/kernel_cache.py",
        "core/import_closure.py",
        "core/compile_notice.py",
    ):
        copy = tmp_path / "reobserve" / name
        copy.parent.mkdir(exist_ok=True, parents=True)
        copy.write_bytes((root / name).read_bytes())
    (tmp_path / "reobserve/core/sums.py").write_text(SUMS.format(other="halves"))
    (tmp_path / "reobserve/core/halves.py").write_text(HALF.format(divisor=2))
    return tmp_path


VARIABLES = {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": "", "PYTHONDONTWRITEBYTECODE": "1"}
RELOAD = "import numba; numba.config.reload_config(); "
# Imports and compiles nothing of the package.
BEGIN = "import hashlib, numba, numpy; numba.njit(lambda x: 2 * x)(1.0)"


@pytest.fixture(scope="module")
def forks() -> Forks:
    """Processes that have imported numba, which takes longer than what is tested."""
    return forking(BEGIN, {**os.environ, **VARIABLES})


@pytest.fixture
def run(forks: Forks, package: Path) -> Run:
    """The output of a program that must print nothing on stderr.

    Without bytecode: Python takes that of a file edited within the same second, if its size is the
    same.
    """

    def output(program: str = RUN, **environment: str) -> str:
        done = forks.run(package, program, **{"HOME": str(package), **environment})
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""
        return done.stdout

    return output


def block_package(package: Path) -> None:
    """Leave no place to write in the package; a file in place of a folder also stops root."""
    for name in ("", "core/"):
        (package / f"reobserve/{name}__pycache__").write_text("")


@pytest.mark.parametrize("called", ["reobserve.core", "papers", "others"])
def test_second_process_loads_machine_code_until_a_called_kernel_is_edited(
    run: Run, package: Path, called: str
) -> None:
    """A kernel of the library, of its caller's package, or of another one."""
    caller = "reobserve.core" if called == "reobserve.core" else "papers"
    for name in {caller, called} - {"reobserve.core"}:
        (package / name).mkdir()
        (package / name / "__init__.py").touch()
    halves, sums = (package / f"{one.replace('.', '/')}" for one in (called, caller))
    written = SUMS.format(other="").replace("reobserve.core. ", f"{called}.halves ")
    (sums / "sums.py").write_text(written)
    program = RUN.replace("reobserve.core.sums", f"{caller}.sums")
    for divisor, answer in ((2, "2.0 0\n"), (2, "2.0 1\n"), (4, "1.0 0\n")):
        (halves / "halves.py").write_text(HALF.format(divisor=divisor))
        assert run(program) == answer


CONSTANT = """
from reobserve.core.kernel import kernel
from reobserve.core.constants import FACTOR

@kernel
def twice(x):
    return FACTOR * x
"""


@pytest.mark.parametrize("place", ["reobserve.core.", ""])
def test_edited_constant_of_another_module_is_compiled_in(
    run: Run, package: Path, place: str
) -> None:
    """In the package of the kernel, or in a file beside the one of the kernel."""
    folder = package / place.replace(".", "/")
    (folder / "sums.py").write_text(CONSTANT.replace("reobserve.core.const", f"{place}const"))
    program = RUN.replace("reobserve.core.", place)
    for factor, answer in ((2, "2.0 0\n"), (2, "2.0 1\n"), (3, "3.0 0\n"), (2, "2.0 1\n")):
        (folder / "constants.py").write_text(f"FACTOR = {factor}.0")
        assert run(program) == answer


def test_files_alike_of_modules_that_import_each_other_keep_code_of_their_own(
    run: Run, package: Path
) -> None:
    modules = {"papers.one": 2, "papers.two": 3}
    for module, factor in modules.items():
        folder = package / module.replace(".", "/")
        folder.mkdir(parents=True)
        (folder / "constants.py").write_text(f"FACTOR = {factor}.0")
        (folder / "sums.py").write_text(CONSTANT.replace("reobserve.core.const", ".const"))
    (package / "papers/__init__.py").write_text("import papers.one.sums, papers.two.sums")
    program = "".join(RUN.replace("reobserve.core", module) + "\n" for module in modules)
    assert run(program) == "2.0 0\n3.0 0\n"
    assert run(program) == "2.0 1\n3.0 1\n"


FILTER = """
import sys, numpy as np
from numba.core import event
with event.install_recorder("numba:compile") as compiled:
    from reobserve.observers import kalman
    from reobserve.observers.kalman import KalmanFilter
    from reobserve.systems.linear import LinearModel
    one = np.eye(1)
    observer = KalmanFilter(LinearModel(one, one, one, Q=1.0, R=1.0, sampling_period=1.0))
    observer.run(np.ones((3, 1)), np.ones((3, 1)), start=observer.init([0.0], 1.0))
print(kalman.__file__)
print(sum(kalman.run_linear.stats.cache_hits.values()), len(compiled.buffer))
"""


def test_filter_is_loaded_in_a_copy_with_edits_that_it_does_not_import(
    forks: Forks, tmp_path: Path
) -> None:
    """Another folder, and other times of its files, as a fresh checkout has."""
    import reobserve

    root, copy = Path(reobserve.__file__).parent, tmp_path / "reobserve"
    cache = {"NUMBA_CACHE_DIR": str(root / "__pycache__")}  # where the tests before this compiled
    hidden = shutil.ignore_patterns("__pycache__")
    shutil.copytree(root, copy, ignore=hidden, copy_function=shutil.copyfile)
    assert forks.run(root.parent, RELOAD + FILTER, **cache).returncode == 0
    for name in ("detection/restarted_cusum.py", "observers/ilo.py"):
        with (copy / name).open("a", encoding="utf-8") as stream:
            stream.write("# edited\n")
    done = forks.run(tmp_path, RELOAD + FILTER, **cache)
    assert done.stderr == ""
    assert done.stdout == f"{copy / 'observers/kalman.py'}\n1 0\n"


def test_unwritable_cache_folder_only_costs_time(run: Run, package: Path) -> None:
    block_package(package)
    assert run() == "2.0 0\n"
    assert run() == "2.0 1\n", "from the cache folder of the user"
    (package / "blocked").write_text("")
    blocked = str(package / "blocked")
    for _ in range(2):
        found = run(RELOAD + RUN, NUMBA_CACHE_DIR=f"{blocked}/cache", HOME=blocked)
        assert found == "2.0 0\n"


def test_compilation_works_without_a_home_folder(run: Run, package: Path) -> None:
    program = f"import os.path; os.path.expanduser = lambda path: path; {RUN}"
    block_package(package)
    for caches in ("", "caches"):  # a relative folder is another one in each current folder
        assert run(program, XDG_CACHE_HOME=caches) == "2.0 0\n"
    assert [path.name for path in package.iterdir()] == ["reobserve"]


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
    """Names documented in its manual: at the top level, in ``numba.extending``, and of events."""
    import reobserve

    root = Path(reobserve.__file__).parent
    internal = [
        path
        for path in root.rglob("*.py")
        if "numba.core" in path.read_text().replace("numba.core import event", "")
    ]
    assert internal == []


INLINED = HALF.replace("import kernel", "import inlined_kernel as kernel")
CALLED = "from reobserve.core.halves import half; print(half(3.0), half(5.0)); " + RUN


def test_inlined_functions_can_be_called_from_python(run: Run, package: Path) -> None:
    (package / "reobserve/core/halves.py").write_text(INLINED.format(divisor=2))
    assert run(CALLED) == "1.5 2.5\n2.0 0\n"
    assert run(CALLED) == "1.5 2.5\n2.0 1\n", "both from the cache"


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


def test_kernels_allocate_only_where_it_is_said(run: Run, package: Path) -> None:
    (package / "reobserve/core/made.py").write_text(MAKES)
    assert run(MADE) == "6.0\n"
    hidden = MAKES.replace("@allocating_kernel", "@kernel")
    (package / "reobserve/core/made.py").write_text(hidden)
    refused = f"""
import numba
try:
    {MADE}
except numba.NumbaError:
    print("refused")
"""
    assert run(refused) == "refused\n"


def test_numba_that_always_counts_references_only_costs_time(run: Run, package: Path) -> None:
    (package / "reobserve/core/made.py").write_text(MAKES)
    assert run(FORGET + MADE) == "6.0\n"
    refused = """
try:
    numba.njit(_nrt=False)(lambda x: x)(1)
except KeyError:
    print("unknown")
"""
    assert run(FORGET + refused) == "unknown\n"


FUNCTION = """
from reobserve.core.kernel import FunctionPointer, kernel
from reobserve.core.sums import twice

@kernel
def eightfold(x):
    return 4 * twice(x)

def called(x):
    return eightfold(x) + 1

POINTER = FunctionPointer("float64(float64)", called)
"""
BOTH = (
    "from reobserve.core.function import POINTER, eightfold; compiled = POINTER.compiled; "
    "print(compiled.ctypes(1.0), eightfold(1.0), compiled.cache_hits, "
    "len(eightfold.stats.cache_hits))"
)


NAMES = "reobserve.core.function.function"  # the module, and its file as numba names it


def cached_files(folder: Path, ending: str) -> list[Path]:
    return sorted(folder.rglob(f"reobserve-kernels-*/**/*.{ending}"))


@pytest.fixture
def cached(run: Run, package: Path) -> Path:
    """The package with a function and a kernel, both compiled and in the cache."""
    (package / "reobserve/core/function.py").write_text(FUNCTION)
    assert run(BOTH) == "9.0 8.0 0 0\n"
    assert run(BOTH) == "9.0 8.0 1 1\n"
    return package


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_damaged_file_is_compiled_again(run: Run, cached: Path, ending: str) -> None:
    for damage in (lambda content: b"", lambda content: content[:99], lambda _: b"x" * 999):
        files = cached_files(cached, ending)
        assert len(files) >= 2
        for path in files:
            path.write_bytes(damage(path.read_bytes()))
        assert run(BOTH) == "9.0 8.0 0 0\n"
        assert run(BOTH) == "9.0 8.0 1 1\n", "written again"


def test_machine_code_that_cannot_be_kept_is_compiled_each_time(run: Run, cached: Path) -> None:
    for ending in ("nbi", "nbc"):
        for path in cached_files(cached, ending):
            path.unlink()
            path.mkdir()
    for _ in range(2):
        assert run(BOTH) == "9.0 8.0 0 0\n"


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only root can give it away")
def test_machine_code_in_a_folder_of_another_user_is_not_loaded(run: Run, cached: Path) -> None:
    for folder in cached.rglob("reobserve-kernels-*"):
        os.chown(folder, 2000, 2000)
    assert run(BOTH) == "9.0 8.0 0 0\n"
    assert run(BOTH) == "9.0 8.0 1 1\n", "from the cache folder of the user"
    folders = [path.parent.name for path in cached.rglob("reobserve-kernels-*")]
    assert sorted(set(folders)) == [".cache", "__pycache__"]

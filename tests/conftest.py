"""Settings of all tests: pinned code paths, hypothesis profiles and the nightly marker.

Code paths are pinned before numpy is imported, as in the command line, so that sums round
identically and two test processes on two cores do not compete for threads over small matrices.
"""

from __future__ import annotations

import gc
import os
from typing import Any

import hypothesis
import pytest

from reobserve.core.code_paths import pin_code_paths

pin_code_paths()

# Compilers and imports make millions of small objects that stay; to look through them again and
# again takes a tenth of the time.
gc.set_threshold(100_000, 20, 50)

# The same examples each time: few, or more with `--hypothesis-profile=nightly`. New examples each
# with `--hypothesis-profile=thorough`.
hypothesis.settings.register_profile(
    "few", max_examples=12, derandomize=True, deadline=None, database=None
)
hypothesis.settings.register_profile(
    "nightly", max_examples=100, derandomize=True, deadline=60_000, database=None
)
hypothesis.settings.register_profile("thorough", max_examples=1000, deadline=60_000)
hypothesis.settings.load_profile("few")


pytest_plugins = ["tests.cpu_budget"]

# Fixtures that start a browser, Slurm or the build of the documentation or of the bench.
NIGHTLY = {"browser", "slurm", "site", "built_bench"}

# Fixtures that wait for a build and only read it.
READS_BUILD = {"as_built", "built_bench", "compared"}

# With several processes, the tests of one file run in one process. So do these files, which edit
# and restore the built project, or read the same documentation.
SHARED = {
    f"tests/{folder}/test_{name}.py": folder
    for folder, names in {
        "reobserve_papers/pipeline": ("bad_input", "pipeline", "staleness"),
        "docs": ("browser", "site"),
    }.items()
    for name in names
}
# Files whose tests start first: they edit the built project, or build it again.
FIRST = {
    *(file for file, folder in SHARED.items() if folder == "reobserve_papers/pipeline"),
    "tests/reobserve_papers/pipeline/test_determinism.py",
}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option by which golden numbers are compared with a build in a copy."""
    parser.addoption(
        "--build-apart", action="store_true",
        help="compare golden numbers with a build in a copy, not with results of this checkout",
    )  # fmt: skip


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hand out whole groups in the order of collection.

    `--dist loadgroup` does not: pytest-xdist 3.8 notes the group in an attribute of a test that
    pytest 9.2 no longer has.
    """
    from xdist.scheduler import LoadScopeScheduling

    config.option.loadscopereorder = False

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return SHARED.get(file, file)

    return Scheduling(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark nightly tests by their fixtures; with several processes, start the build first.

    Files with nightly tests, which are long, come next. Tests that only read the build come last,
    so that no process waits for it.
    """
    for item in items:
        if NIGHTLY & set(getattr(item, "fixturenames", ())):
            item.add_marker("nightly")
    if "PYTEST_XDIST_WORKER" in os.environ:
        slow = {_file(item) for item in items if item.get_closest_marker("nightly")}
        items.sort(key=lambda item: _turn(item, slow))


def _file(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


def _turn(item: pytest.Item, slow: set[str]) -> int:
    if _file(item) in FIRST:
        return 0
    if READS_BUILD & set(getattr(item, "fixturenames", ())):
        return 3
    return 1 if _file(item) in slow else 2

"""Before numpy is imported: as in the command line, so that sums round alike, and two test
processes on two cores do not fight over threads for matrices of five rows.

And which tests share a process where several run them: those that share what is expensive to make.
"""

from __future__ import annotations

import os
from typing import Any

import hypothesis
import pytest

from reobserve.numerics.code_paths import pin_code_paths

pin_code_paths()

# The same few examples each time; at night, `--hypothesis-profile=nightly`, many new ones.
hypothesis.settings.register_profile(
    "few", max_examples=12, derandomize=True, deadline=None, database=None
)
hypothesis.settings.register_profile("nightly", max_examples=1000, deadline=60_000)
hypothesis.settings.load_profile("few")


def group(test: str) -> str:
    """The tests of a file, of a paper's numbers, of the built project or of the built site, kept
    together.
    """
    file, _, name = test.partition("::")
    # Those that evaluate all of a paper.
    if file in {
        "tests/evidence/golden/test_golden.py",
        "tests/pipeline/test_golden_build.py",
        "tests/pipeline/test_same_values.py",
    }:
        return f"golden {name.partition('[')[2].partition('-')[0]}"
    # Those that edit the built project, and put it back; others only read its results.
    if file in {
        f"tests/pipeline/test_{name}.py"
        for name in ("pipeline", "staleness", "bad_input", "imports")
    }:
        return "tests/pipeline"
    if file in {"tests/docs/test_site.py", "tests/docs/test_browser.py"}:  # build it once
        return "tests/docs"
    return file


# Where nothing asks for several processes, nobody asks for this, nor is pytest-xdist needed.
@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hand out whole groups, in the order of `pytest_collection_modifyitems`.

    Not by the marks of `--dist loadgroup`, which pytest 9.2 and pytest-xdist 3.8 ignore together.
    """
    from xdist.scheduler import LoadScopeScheduling

    config.option.loadscopereorder = False

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group(nodeid)

    return Scheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Where several processes test, begin with what takes longest, so that none ends alone."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        first = ("tests/pipeline/test_determinism.py", "tests/pipeline")
        items.sort(key=lambda item: [group(item.nodeid) != name for name in first])

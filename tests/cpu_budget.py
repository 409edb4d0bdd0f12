"""A pytest plug-in that measures the CPU seconds of tests and holds them to a budget.

A case may take `CASE` seconds and the cases of one function `FUNCTION` in all, where the first case
stays whatever it takes. Tests beyond that are for `make nightly`: shorten them, or mark them with
`nightly`, or the function with `nightly_cases(names)`, or with `nightly_after(n)`, which keeps its
first n cases. Those in `tests/drawn`, which make many calls each, may take `DRAWN`. Measured are
this process and its children that have ended, without fixtures that tests share and without what
this process compiles, which falls to whichever test comes first.
"""

from __future__ import annotations

import resource
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from numba.core import event

from tests.forks import Forks

CASE, FUNCTION = 3.0, 2.0
DRAWN = 20.0
COLD = 30.0  # of a case whose programs compile all that they need, as on a clean checkout
_DRAWN = "tests/drawn/"
SMALL = 0.2  # what further cases of a function may take after an expensive first one

_USED = pytest.StashKey[float]()


def cpu_seconds() -> float:
    """CPU seconds of this process, of its children that have ended, and of programs in forks."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime + Forks.seconds


class Compilation(event.Listener):
    """The CPU seconds in which this process compiled kernels, those within others once."""

    def __init__(self) -> None:
        self.seconds, self._depth = 0.0, 0

    def on_start(self, event: event.Event) -> None:
        """Begin with the outermost kernel."""
        if not self._depth:
            self.seconds -= time.process_time()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        """End with the outermost kernel."""
        self._depth -= 1
        if not self._depth:
            self.seconds += time.process_time()


def beyond(cases: Mapping[str, float], factor: float = 1.0) -> list[str]:
    """A line for each case and each function beyond ``factor`` times the budget.

    ``cases`` are the CPU seconds by test, in the order of collection.
    """
    found = [
        f"{name}: {used:.1f} CPU s, a case may take {allowed:g}"
        for name, used in cases.items()
        if used > factor * (allowed := DRAWN if name.startswith(_DRAWN) else CASE)
    ]
    functions: dict[str, list[float]] = defaultdict(list)
    for name, used in cases.items():
        if name.startswith(_DRAWN):
            continue
        functions[name.partition("[")[0]].append(used)
    for name, (first, *further) in functions.items():
        if further and sum(further) > max(factor * FUNCTION - first, SMALL):
            found.append(
                f"{name}: {first + sum(further):.1f} CPU s in {1 + len(further)} cases, a function "
                f"may take {FUNCTION:g}"
            )
    return found


class CpuBudget:
    """Measurement of each test, and the report at the end of a run."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.cases: dict[str, float] = {}
        self._shared, self._depth = 0.0, 0
        self._compilation = Compilation()
        event.register("numba:compile", self._compilation)

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Mark the cases that functions leave to the night."""
        cases = Counter[str]()
        for item in items:
            function, _, case = item.nodeid.partition("[")
            cases[function] += 1
            kept = item.get_closest_marker("nightly_after")
            named = item.get_closest_marker("nightly_cases")
            is_late = kept is not None and cases[function] > kept.args[0]
            if is_late or (named is not None and case[:-1] in named.args):
                item.add_marker("nightly")

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        """Take the time of shared fixtures apart."""
        shared = fixturedef.scope != "function"
        self._depth += shared
        start = self._seconds()
        try:
            return (yield)
        finally:
            self._depth -= shared
            if shared and not self._depth:
                self._shared += self._seconds() - start

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Begin to measure a test."""
        self._shared = 0.0
        item.stash[_USED] = self._seconds()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: Any) -> Iterator[Any]:
        """Note in the last report of a test what it took."""
        report = yield
        if call.when == "teardown" and item.get_closest_marker("nightly") is None:
            used = self._seconds() - item.stash[_USED] - self._shared
            report.user_properties.append(("cpu_seconds", used))
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect what tests took, those of other processes included."""
        if report.when == "teardown":
            for name, used in report.user_properties:
                if name == "cpu_seconds":
                    self.cases[report.nodeid] = used

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Fail beyond the limit asked for."""
        is_worker = hasattr(self.config, "workerinput")
        if not is_worker and self._failures() and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Print the sum, and what is beyond the budget."""
        lines, failures = beyond(self.cases), self._failures()
        used = sum(self.cases.values())
        terminalreporter.write_line(
            f"{cpu_seconds():.0f} CPU s, {used:.0f} of them in {len(self.cases)} cases "
            f"that are not nightly; {len(lines)} beyond the budget"
        )
        for line in failures or lines:
            terminalreporter.write_line(f"{'FAILED ' if failures else ''}{line}")

    def _seconds(self) -> float:
        """CPU seconds so far, without those of compilation."""
        return cpu_seconds() - self._compilation.seconds

    def _failures(self) -> list[str]:
        limit = self.config.getoption("cpu_limit")
        if limit == "twice":
            return beyond(self.cases, 2.0)
        if limit == "cold":
            return [
                f"{name}: {used:.1f} CPU s, a case that is not nightly may take {COLD:g}"
                for name, used in self.cases.items()
                if used > COLD + DRAWN * name.startswith(_DRAWN)
            ]
        return []


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that makes a run fail."""
    parser.addoption(
        "--cpu-limit", choices=("none", "cold", "twice"), default="none",
        help="fail where tests that are not nightly take over twice their CPU seconds (twice), "
        f"or a case over {COLD:g} (cold: programs compile kernels)",
    )  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Measure, in each process."""
    config.pluginmanager.register(CpuBudget(config), "cpu-budget")

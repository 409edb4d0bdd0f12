"""No compiled loop reads or writes beyond its arrays, which compiled code would not report."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT
from tests.reobserve.observers import cases_delay, cases_filters, cases_rigid_body

pytestmark = pytest.mark.nightly  # compiles all kernels once more


# In a separate process, since numba decides on bounds checks when it compiles. A state with and
# without a past, and all gain variants, which share one compiled loop.
RUN = """
import sys, warnings
from dataclasses import replace
from numba.core.errors import NumbaWarning
warnings.simplefilter("ignore", NumbaWarning)
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.synthesis.normal_form.gain import GAINS
from tests.reobserve.observers.cases import CASES

def part(values, first, last):
    return None if values is None else values[first:last]

for name in sys.argv[1:]:
    case = CASES[name]()
    observers = [case.observer]
    if isinstance(case.observer, IdentityObserver):
        observers = [replace(case.observer, gain=gain) for gain in GAINS]
    for observer in observers:
        state = case.state
        for first, last in ((0, 1), (1, 7), (7, 12)):
            y, u = part(case.y, first, last), part(case.u, first, last)
            try:
                run = observer.run(y, u, state=state)
            except IndexError as error:
                sys.exit(f"{name}: {error}")
            state = run.state
print("all within bounds")
"""

LOOPS = {
    "rigid bodies": cases_rigid_body.CASES,
    "filters": cases_filters.CASES,
    "delays": cases_delay.CASES,
}


@pytest.mark.parametrize("family", LOOPS)
def test_compiled_loops_stay_within_array_bounds(family: str, tmp_path: Path) -> None:
    """Code with checks is cached separately and not optimised, as it runs only briefly."""
    settings = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_OPT": "0", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", RUN, *LOOPS[family]],
        cwd=ROOT, env={**os.environ, **settings}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "all within bounds\n", done.stderr
    # A function called from a kernel cannot raise; it prints.
    assert "IndexError" not in done.stderr

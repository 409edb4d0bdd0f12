"""No loop reads or writes beyond its arrays, which compiled code would not report."""

from __future__ import annotations

import os
import subprocess
import sys

from tests import ROOT

# In a separate process, since numba decides when it is imported whether it compiles: here nothing
# is, and numpy refuses what lies beyond an array. A state with and without a past, and all gain
# variants, which share one loop.
RUN = """
import sys
from dataclasses import replace
from reobserve.core import direct_call
direct_call.call = lambda function, arguments: getattr(function, "compiled", function)(*arguments)

from reobserve import rts_smoother
from reobserve.observers.normal_form import IdentityObserver
from reobserve.synthesis.normal_form.identity_gain import GAINS
from tests.reobserve.observers.by_row import GIVEN, part, record
from tests.reobserve.observers.cases import CASES

for name, make in CASES.items():
    case = make()
    observers = [case.observer]
    if isinstance(case.observer, IdentityObserver):
        observers = [replace(case.observer, gain=gain) for gain in GAINS]
    for observer in observers:
        state = case.state
        for first, last in ((0, 1), (1, 7), (7, 12)):
            y, u = (None if each is None else each[first:last] for each in (case.y, case.u))
            state = observer.run(y, u, start=state).end
y, u = record()
for name, make in GIVEN.items():
    one = make()
    run = one.observer.run(y, u, start=one.state, **one.given)
    if name in ("Kalman", "EKF", "UKF"):
        rts_smoother(run)
        rts_smoother(run, lag=2)
print("all within bounds")
"""


def test_loops_stay_within_array_bounds() -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN], cwd=ROOT, env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "all within bounds\n", done.stderr

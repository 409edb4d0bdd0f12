"""What numba made of all kernels of the library: each compiles, and nearly none counts references.

To count references takes a short loop longer than its work, so a kernel that makes no arrays is
compiled without; numba refuses hidden arrays unreadably, and at the first call. Every kernel is
therefore compiled here, or loaded from the cache.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.detection.restarted_cusum import restarted_cusum
from reobserve.estimation.families import linear_system
from reobserve.estimation.sampling_grid import least_jitter
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.observers.smoother import rts_smoother
from tests.reobserve.core import kernels
from tests.reobserve.library.calls import calls
from tests.reobserve.observers.cases_filters import MODEL, SOFT, bank


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """All kernels by name, after all public functions and what these do not reach."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("calls"))
        for one in calls().values():
            one.function(*one.arguments)
    y, u = np.zeros((5, 2)), np.zeros((5, 1))
    case = bank()
    case.observer.run(y, u, start=case.state)
    kalman, other = KalmanFilter(MODEL), KalmanFilter(SOFT)
    start, S = kalman.init([0.0, 0.0], 1.0), np.full((2, 2), 1e-9)
    kalman.run(y, u, start=start, S=S, keep="gain")
    rts_smoother(kalman.run(y, u, start=start), lag=2)
    restarted_cusum(kalman, other, y, u, kalman.init([0.0, 0.0], 1.0))
    weighted = SmoothVariableStructureFilter(
        MODEL, boundary_layer=10.0, convergence_rate=0.1, inverse="weighted"
    )
    weighted.run(y, u, start=weighted.init([0.0, 0.0], 1.0))
    linear_system.weighed(np.ones((5, 2)), np.ones((5, 2, 1)))
    least_jitter([np.arange(5.0)], 1.0)
    return kernels.kernels("reobserve")


def test_all_kernels_compile(compiled: dict[str, Any]) -> None:
    inlined = kernels.inlined(compiled)
    missing = [
        name
        for name, one in compiled.items()
        if not kernels.machine_code(one) and id(one) not in inlined
    ]
    assert missing == [], "let the fixture call them"


def test_only_kernels_that_make_arrays_count_references(compiled: dict[str, Any]) -> None:
    assert kernels.marked_wrongly(compiled) == []


def test_kernels_that_count_no_references_are_handed_no_new_arrays(
    compiled: dict[str, Any],
) -> None:
    assert kernels.leaking(compiled) == []

"""The first normal form in a fresh process, along all methods: its time, printed in seconds.

Imports are not counted. Whether the machine code is compiled or read depends on the cache, which
the caller chooses by ``NUMBA_CACHE_DIR``.
"""

from __future__ import annotations

import time

from benchmarks.normal_form_problems import van_der_pol
from reobserve.synthesis.normal_form import homological  # noqa: F401 (its import is not counted)
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.papers.lie.lie_transform import lie_transform


def main() -> None:
    """Run S, T and the Lie recursion once and print how long that took."""
    problem = van_der_pol(3)
    start = time.perf_counter()
    solver = solver_for(problem)
    for method in (solve_s, solve_t, lie_transform):
        method(problem, solver)
    print(time.perf_counter() - start)


if __name__ == "__main__":
    main()

"""Refusals of a design, in one sentence each."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve.synthesis.extended_state import feasible_point, pd_pi, pi
from tests.reobserve.synthesis.plants import dc_motor, random_plant


@pytest.mark.parametrize("design", [pd_pi.design, pi.design])
def test_gamma_below_its_lower_bound_is_refused_stating_the_bound(design: Any) -> None:
    with pytest.raises(InputError, match=r"gamma: 1 must be above 1\.00503781018428, which no"):
        design(dc_motor(), gamma=1.0)
    with pytest.raises(InputError, match=r"factor: 0.99 of the lower bound .* must be above one"):
        design(dc_motor(), 0.99)
    with pytest.raises(InputError, match="gamma: -1 must be greater than zero"):
        design(dc_motor(), gamma=-1.0)


def test_multiple_of_a_zero_lower_bound_is_refused() -> None:
    with pytest.raises(InputError, match=r"factor: has no lower bound .* only zero: give gamma"):
        pd_pi.design(random_plant(0, 4, 4))


def test_unknown_solver_is_refused() -> None:
    with pytest.raises(InputError, match="solver: 'MOSEK' must be one of CLARABEL, SCS"):
        pd_pi.design(dc_motor(), solver="MOSEK")


def test_missing_proof_package_is_reported_before_solving(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "flint", None)
    monkeypatch.setattr("reobserve.synthesis.extended_state.design.strictly_feasible", pytest.fail)
    with pytest.raises(InputError, match="flint"):
        pi.design_feasible(dc_motor(), 0.5)


def test_inconsistent_pole_region_is_refused() -> None:
    with pytest.raises(InputError, match="decay: 5 must be at least zero and below the bound 5"):
        pd_pi.design_minimum_gamma(dc_motor(), 5.0, 5.0)
    with pytest.raises(InputError, match="decay: -1 must be at least zero"):
        pi.design_feasible(dc_motor(), -1.0)
    with pytest.raises(
        InputError, match=r"^solution: 'any' must be one of minimum_norm, positive, "
    ):
        pi.design_feasible(dc_motor(), 1.0, solution="any")
    with pytest.raises(InputError, match=r"radius: 0.5 must be above \d.*: no matrices fit"):
        pd_pi.design_minimum_gamma(dc_motor(), radius=0.5)
    with pytest.raises(InputError, match="radius: 0 must be greater than zero"):
        pd_pi.design_minimum_gamma(dc_motor(), radius=0.0)


def test_unreachable_gap_is_refused_and_a_larger_one_is_proved() -> None:
    system = random_plant(0, 2)
    with pytest.raises(InputError, match=r"gap: 1e-10 is not reached .*: raise it"):
        pd_pi.design_minimum_gamma(system, 0.0, 30.0, gap=1e-10)
    found = pd_pi.design_minimum_gamma(system, 0.0, 30.0, gap=1e-3)
    assert found.lower == pytest.approx(found.objective - 1e-3, abs=1e-9)


def test_infeasible_decay_is_refused_with_solver_and_status() -> None:
    """The mode at -3 is unobservable, so no gain moves it."""
    system = dc_motor(A=[[-3.0, 0.0], [0.0, -2.0]], C=[[0.0, 1.0], [0.0, 2.0]])
    assert pi.design_feasible(system, 1.0).certificate.holds
    with pytest.raises(InputError, match="solver: CLARABEL ended with status 'infeasible', not"):
        pi.design_feasible(system, 4.0)


def test_inaccurate_solution_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(feasible_point.SOLVERS, "SCS", {"max_iters": 30})
    with pytest.raises(InputError, match="SCS ended with status 'optimal_inaccurate', not"):
        pd_pi.design(dc_motor(), solver="SCS")


def test_solver_failure_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(feasible_point.SOLVERS, "CLARABEL", {"max_iter": 2})
    with pytest.raises(InputError, match=r"solver: CLARABEL (failed|ended with status)"):
        pd_pi.design(dc_motor())

"""Without a package that only some users have, what needs it says so in one sentence."""

from __future__ import annotations

import sys
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from reobserve.errors import InputError
from reobserve.models.polynomial import PolynomialSystem
from reobserve.power_series.maps import PolynomialMap
from reobserve.power_series.monomials import monomials
from reobserve.synthesis.definiteness import ball_matrix, prove_negative_definite
from reobserve.synthesis.extended_state import pd_pi, pi, structured
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve.synthesis.normal_form.homological_exact import RationalSolver

MOTOR = AugmentedSystem(
    A=np.array([[-10.0, 1.0], [-0.02, -2.0]]), B=np.array([[0.0], [2.0]]), C=np.eye(2),
    Dd=np.diag([1.0, 2.0]), Dw=np.array([[1.0], [0.0]]), Fa=np.array([[0.0], [2.0]]),
    Fs=np.array([[1.0], [0.0]]),
)  # fmt: skip
GAINS = Gains(np.ones((MOTOR.size, 2)), np.zeros((MOTOR.size, 2)))


def expand() -> object:
    """A system that no test before has expanded."""
    return PolynomialSystem.from_expressions(["sin(w)", "-a"], ["a"], ["a", "w"], 3)


def solve() -> object:
    """2 x b - 3 b = 1 for a linear b, in fractions."""
    one = np.array([[Fraction(1)]], dtype=object)
    return RationalSolver(2 * one, 3 * one)(monomials(1, 2), one, 1)


NEEDS: dict[str, list[Callable[[], object]]] = {
    "cvxpy": [
        lambda: pd_pi.design(MOTOR),
        lambda: pd_pi.design_least_gamma(MOTOR),
        lambda: pi.design(MOTOR),
        lambda: pi.design_feasible(MOTOR, 1.0),
    ],
    "flint": [
        lambda: pd_pi.design(MOTOR),
        lambda: pi.design_feasible(MOTOR, 1.0),
        lambda: structured.design(MOTOR),
        lambda: certify(MOTOR, GAINS),
        lambda: h_infinity_norm([[-1.0]], [[1.0]], [[1.0]]),
        lambda: prove_negative_definite([[-1.0]]),
        lambda: ball_matrix([[-1.0]]),
    ],
    "sympy": [expand, solve],
    "mpmath": [expand],
}


@pytest.mark.parametrize(
    ("name", "call"), [(name, call) for name, calls in NEEDS.items() for call in calls]
)
def test_a_missing_package_is_named(
    name: str, call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    shop = {"flint": "python-flint"}.get(name, name)
    with pytest.raises(InputError, match=rf"^{name}: this package .* `pip install {shop}`$"):
        call()


def test_a_map_needs_none_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NEEDS:
        monkeypatch.setitem(sys.modules, name, None)
    field = PolynomialMap.linear(np.array([[0.0, 1.0], [-2.0, -3.0]]))
    assert field(np.array([1.0, 1.0])).tolist() == [1.0, -5.0]

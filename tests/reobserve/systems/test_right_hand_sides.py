"""Models of right-hand sides, compiled or polynomial: parameters as a list, and errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.codegen.sources import rows_of
from reobserve.core.errors import InputError
from reobserve.observers.high_gain import HighGainObserver
from reobserve.polynomials.maps import PolynomialMap
from reobserve.systems.polynomial import PolynomialSystem
from reobserve.systems.triangular import TriangularModel
from reobserve.systems.triangular_text import triangular_model
from tests.reobserve.observers.small_plants import first_order_lag


def test_parameters_of_a_model_may_be_a_list() -> None:
    lag = first_order_lag(1.5, 2.0)
    listed = TriangularModel(lag.states, lag.drift, lag.input_gain, lag.parameters.tolist())
    y, u = np.linspace(0.0, 1.0, 9), np.ones(9)
    first, second = (
        HighGainObserver(model, rho=2.0, sampling_period=0.01) for model in (lag, listed)
    )
    found, wanted = (one.run(y, u, start=one.init([0.0]))["state"] for one in (second, first))
    assert np.array_equal(found, wanted)


def test_invalid_model_arguments_are_refused() -> None:
    lag = first_order_lag()
    one, two = (PolynomialMap.linear(np.eye(n)) for n in (1, 2))
    calls: list[tuple[Any, str]] = [
        (lambda: TriangularModel(1, lag.drift, lag.input_gain, [[1.0, 1.0]]), "parameters"),
        (lambda: TriangularModel(1, lag.drift, np.sin, [1.0, 1.0]), "input_gain"),
        (lambda: TriangularModel(1, lambda x, p, f: None, lambda y, p, g: None, [1.0]), "drift"),
        (lambda: PolynomialSystem(two, one), "output"),
    ]
    for call, name in calls:
        with pytest.raises(InputError, match=rf"^{name}: "):
            call()


CODE = "__import__('os').system('touch {}')"


@pytest.mark.parametrize(
    ("variables", "drift", "input_gain"),
    [
        (["a", "b"], ["0", CODE], "1"),
        (["a", "b"], ["0", "0"], CODE),
        (["a", CODE], ["0", "0"], "1"),
        (["a", "b"], ["0", "0\n    " + CODE], "1"),
        (["a", "b"], ["0", "().__class__.__bases__[0]"], "1"),
        (["a", "b"], ["0", "open('{}', 'w')"], "1"),
    ],
)
def test_code_in_a_triangular_model_does_not_run(
    variables: list[str], drift: list[str], input_gain: str, tmp_path: Path
) -> None:
    target = tmp_path / "ran"
    texts = [[one.format(target) for one in each] for each in (variables, drift, [input_gain])]
    with pytest.raises(InputError, match=r"^(variables|drift\[1\]|input_gain): "):
        triangular_model(texts[0], texts[1], texts[2][0])
    assert not target.exists()


NUMBERLESS = "is no finite real number anywhere"


@pytest.mark.parametrize(
    ("drift", "input_gain", "said"),
    [
        (["0"], "1", "drift: has 1 texts, must have 2, one a variable"),
        (["0", "a/0"], "1", f"drift[1]: 'a/0' {NUMBERLESS}"),
        (["0", "0"], "sin(1/0)", f"input_gain: 'sin(1/0)' {NUMBERLESS}"),
        (["0", "0"], "sqrt(-1)*a", f"input_gain: 'sqrt(-1)*a' {NUMBERLESS}"),
        (["0", "(-8)**(1/3)*b"], "1", f"drift[1]: '(-8)**(1/3)*b' {NUMBERLESS}"),
        (["asin(2)", "0"], "1", f"drift[0]: 'asin(2)' {NUMBERLESS}"),
        (["0", "0"], "atan(1/0)", f"input_gain: 'atan(1/0)' {NUMBERLESS}"),
    ],
)
def test_invalid_right_hand_side_text_is_refused(
    drift: list[str], input_gain: str, said: str
) -> None:
    with pytest.raises(InputError) as error:
        triangular_model(["a", "b"], drift, input_gain)
    assert str(error.value) == said


def test_integers_of_more_than_64_bits_are_compiled() -> None:
    model = triangular_model(["a"], ["0"], "10**30 + (10**25 + 1)/7*a - a/10**23")
    observer = HighGainObserver(model, rho=2.0, sampling_period=0.01)
    y, u = np.full(3, 0.25), np.full(3, 1e-30)
    same = triangular_model(["a"], ["0"], "1e30 + 1.4285714285714285714e24*a - 1e-23*a")
    other = HighGainObserver(same, rho=2.0, sampling_period=0.01)
    found, wanted = (one.run(y, u, start=one.init([0.0]))["state"] for one in (observer, other))
    assert found[-1, 0] > 0.02
    assert found == pytest.approx(wanted, rel=1e-15)


def test_variable_names_do_not_collide_with_function_names() -> None:
    """Compiled code uses only numbers and math functions, whatever names the user chose."""
    model = triangular_model(["math", "out"], ["-sin(math)", "math*out"], "exp(math)")
    assert rows_of(model.drift) == ("-math.sin(x[0])", "x[0]*x[1]")
    assert rows_of(model.input_gain) == ("math.exp(x[0])",)

"""Invalid use of these observers: each error is one sentence that states what to change."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.observers.normal_form import NormalFormObserver, normal_form_observer
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.cli.main import main
from tests import ROOT
from tests.reobserve.observers.test_normal_form_observers import form
from tests.reobserve_papers.papers import fixed

VAN_DER_POL: dict[str, Any] = {
    "dynamics": ["x2", "(1 - x1**2)*x2 - x1"], "output": ["x1"], "variables": ["x1", "x2"],
    "order": 4, "sampling_period": 0.01, "poles": [-1, -2.2],
}  # fmt: skip
HIDDEN = {"dynamics": ["x1", "-x2"], "output": ["x2"]}
SIX = [f"x{k}" for k in range(6)]

# Differences from Van der Pol's oscillator, and the message.
BAD_CALLS: dict[str, tuple[dict[str, Any], str]] = {
    "hidden, injection": (
        {**HIDDEN, "poles": None, "injection": [[0], [-1]]},
        r"output: does not show the mode 1\+0j .* is not detectable, and no injection makes the",
    ),
    "hidden, poles": (HIDDEN, r"output: does not show the mode 1\+0j .* is not detectable"),
    "blind": ({"output": ["x1**2"]}, r"output: does not show the mode 0.5.* is not detectable"),
    "unstable injection": (
        {"poles": None, "injection": [[2], [1]]},
        r"injection: makes A = F \+ L0 H with the eigenvalues 2, 1; all real parts must be neg",
    ),
    "shape of the injection": (
        {"poles": None, "injection": [-2, -4]},
        r"injection: has shape \(2,\), must be \(2, 1\)",
    ),
    "an injection that is none": (
        {"poles": None, "injection": [["a"], ["b"]]}, r"injection: .* is not a number",
    ),
    "both": ({"injection": [[-2], [-4]]}, r"injection, poles: one of them must be given"),
    "neither": ({"poles": None}, r"injection, poles: one of them must be given"),
    "too few poles": ({"poles": [-1]}, r"poles: -1\+0j: 1 given, must be 2"),
    "not conjugate": ({"poles": [-1 + 1j, -2]}, r"poles: .* must come in conjugate pairs"),
    "unstable poles": ({"poles": [1, -2]}, r"poles: .* must all have negative real parts"),
    "a pole on the axis": ({"poles": [0, -2]}, r"poles: .* must all have negative real parts"),
    "repeated poles": ({"poles": [-1, -1]}, r"poles: -1\+0j, -1\+0j cannot be placed: .*repeated"),
    "text for poles": ({"poles": ["fast", "slow"]}, r"poles: .* numbers?"),
    "an equilibrium elsewhere": (
        {"dynamics": ["x2 + 1", "-x1"]},
        r"dynamics\.1: has the constant term 1.0, must be zero at the origin; shift the",
    ),
    "an output with an offset": (
        {"output": ["cos(x1)"]}, r"output\.1: has the constant term 1.0, must be zero",
    ),
    "no plane": ({"dynamics": ["x2"]}, r"dynamics: has 1 components in 2 variables"),
    "no output": ({"output": []}, r"output: "),
    "a name twice": ({"variables": ["x1", "x1"]}, r"variables: .*x1"),
    "a number for a name": ({"variables": [1, 2]}, r"variables: .*1"),
    "degree too high": (
        {"order": 2000}, r"degree: 2001 must be a whole number, from 1 to 100",
    ),
    "degree too high in six variables": (
        {"dynamics": SIX, "output": SIX, "variables": SIX, "poles": range(-6, 0), "order": 30},
        r"degree: 31 is too high for series in 6 variables",
    ),
    "negative order": ({"order": -1}, r"order: -1 must be a whole number, 0 or more"),
    "order no number": ({"order": "4"}, r"order: '4' must be a whole number"),
    "order no whole number": ({"order": 2.5}, r"order: 2.5 must be a whole number"),
    "form": ({"form": "identical"}, r"form: 'identical' must be one of identity, transformed"),
    "gain": ({"gain": "jac"}, r"gain: 'jac' must be one of series, jacobian, composed"),
    "step": ({"sampling_period": 0}, r"sampling_period: 0 must be greater than zero"),
    "expression": ({"dynamics": ["x2", "-sqrt(x1)"]}, r"dynamics\[1\]: sqrt\(x1\) has no Taylor"),
    "unknown symbol": ({"output": ["c*x1"]}, r"output\[0\]: holds c, which has no value"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_CALLS)
def test_invalid_design_call_is_refused_in_one_sentence(case: str) -> None:
    changes, sentence = BAD_CALLS[case]
    with pytest.raises(InputError, match=f"^{sentence}") as caught:
        normal_form_observer(**{**VAN_DER_POL, **changes})
    said = str(caught.value)
    assert "\n" not in said
    assert ". " not in said, "more than one sentence"


@pytest.mark.parametrize("order", [-1, 13])
@pytest.mark.parametrize("kind", NormalFormObserver.__subclasses__())
def test_order_beyond_the_series_is_refused(kind: Any, order: int) -> None:
    with pytest.raises(InputError, match=rf"^order: {order} must be from 0 to 12, one less"):
        kind(form(), order=order, sampling_period=0.01)


def test_invalid_injection_is_refused() -> None:
    system = form().problem.system
    exact = PolynomialMap.from_terms("l", [], 2, 1, exact=True)
    with pytest.raises(InputError, match=r"^injection: must be exact if the system is, and only"):
        normal_form(system, 3, injection=exact)
    offset = PolynomialMap.from_terms(
        "l", [{"component": 1, "powers": [0], "coefficient": 1}], 2, 1
    )
    with pytest.raises(InputError, match=r"^injection: must be zero for the output zero"):
        normal_form(system, 3, injection=offset)
    with pytest.raises(InputError, match=r"^injection: takes 2 outputs to 1 states, must take 1"):
        normal_form(system, 3, injection=PolynomialMap.linear([[1.0, 2.0]]))
    with pytest.raises(InputError, match=r"^poles: give no exact injection"):
        normal_form(form(exact=True).problem.system, 3, poles=[-1, -2.2])
    with pytest.raises(InputError, match=r"^output: must be exact if the dynamics are"):
        PolynomialSystem(system.dynamics, form(exact=True).problem.system.output)


@pytest.mark.parametrize("kind", NormalFormObserver.__subclasses__())
def test_invalid_initial_estimates_and_states_are_refused(kind: Any) -> None:
    observer = kind(form(), order=4, sampling_period=0.01)
    with pytest.raises(InputError, match=r"^state: has shape \(3,\), must be a list of"):
        observer.init([0, 0, 0])
    with pytest.raises(InputError, match=r"^state: .* not finite"):
        observer.init([0, np.inf])
    scalar = normal_form_observer(["-x"], ["x"], ["x"], order=1, sampling_period=0.1, poles=[-3.3])
    with pytest.raises(InputError, match=r"^start: must be of an observer of 2 states"):
        observer.run(np.zeros((3, 1)), start=scalar.init([0.0]))


LINEAR = [{"component": 1, "powers": [1], "coefficient": -2},
          {"component": 2, "powers": [1], "coefficient": -4}]  # fmt: skip
# The plant run backwards in time: a stable origin, with eigenvalues whose sum is -1.
BACKWARDS = [
    {"component": 1, "powers": [0, 1], "coefficient": -1},
    {"component": 2, "powers": [1, 0], "coefficient": 1},
    {"component": 2, "powers": [0, 1], "coefficient": -1},
    {"component": 2, "powers": [2, 1], "coefficient": 1},
]


def injection(*values: Any) -> dict[str, Any]:
    return {"designs": {"linear": {"injection": [
        {**term, "coefficient": value} for term, value in zip(LINEAR, values, strict=True)
    ]}}}  # fmt: skip


BAD_CONFIG: dict[str, tuple[dict[str, Any], str, str]] = {
    "order above the degree": (
        {"observers": {"order4": {"order": 13}}}, "lie.observers.order4.order:",
        "13 must be from 0 to 12, one less than the degree of the series",
    ),
    "order no whole number": (
        {"observers": {"order4": {"order": 2.5}}}, "lie.observers.order4.order:", "2.5",
    ),
    "unknown gain": (
        {"observers": {"order4": {"gain": "serie"}}}, "lie.observers.order4.gain:",
        "'serie' must be one of series, jacobian, composed",
    ),
    "gain of a transformed observer": (
        {"observers": {"transformed4": {"gain": "series"}}}, "lie.observers.transformed4.gain:",
        "unknown key",
    ),
    "resonant injection": (  # poles -2 and -3.5
        {"plant": {"dynamics": BACKWARDS}, **injection(-4.5, 1.5)},
        "lie.designs.linear.injection:", "with m = (2, 2)",
    ),
    "unstable injection": (
        injection(-2, 4), "lie.designs.linear.injection:", "all real parts must be negative",
    ),
    "injection of no number": (
        injection("two", -4), "lie.designs.linear.injection[0].coefficient:", "finite number or",
    ),
    "powers of wrong length": (
        {"plant": {"output": [{"component": 1, "powers": [1], "coefficient": 1}]}},
        "lie.plant.output[0].powers:", "[1] must be 2 whole numbers, none negative",
    ),
    "a plant with an offset": (
        {"plant": {"output": [{"component": 1, "powers": [0, 0], "coefficient": 1}]}},
        "lie.plant.output.1:", "has the constant term 1.0",
    ),
    "a blind output": (
        {"plant": {"output": [{"component": 1, "powers": [2, 0], "coefficient": 1}]}},
        "output:", "is not detectable",
    ),
    "degree too high": (
        {"designs": {"linear": {"degree": 5000}}}, "lie.designs.linear.degree:",
        "5000 must be 61 or less",
    ),
    "step of an observer": (
        {"observers": {"order4": {"sampling_period": 3e-3}}},
        "lie.observers.order4.sampling_period:",
        "must be a whole multiple of plant.step",
    ),
    "horizon no multiple": (
        {"plant": {"horizon": 20.0005}}, "lie.plant.horizon:", "must be a whole multiple of the",
    ),
    "an order of a study above the degree": (
        {"studies": {"orders": {"orders": [0, 13]}}}, "lie.studies.orders.orders", "from 0 to 12",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_CONFIG)
def test_invalid_parameters_are_refused(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes, where, what = BAD_CONFIG[case]
    target = tmp_path / "parameters.json"
    arguments = [
        "stage",
        "parameters",
        "lie",
        "--project",
        str(ROOT),
        "--overrides",
        json.dumps(fixed("lie", changes)),
    ]
    assert main([*arguments, "--output", str(target)]) == 1
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1, captured.err
    said = captured.err.removeprefix("reobserve-papers: ")
    assert where in said
    assert what in said
    assert not target.exists()

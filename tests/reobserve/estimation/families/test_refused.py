"""Models and design files with missing, extra or wrong keys, each refused naming the key."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.file import load_design, save_design
from tests.reobserve.estimation.families.test_kinds import design

SAME = {"transition": [[0.5, 0.5], [0.5, 0.5]]}
SQUARE = {"angle": "rad", "rate": "rad/s"}
MODELS: list[tuple[str, dict[str, Any], str]] = [
    ("kalman", {"B": None}, "B: is missing, must have shape (2, 1), as there are inputs"),
    ("kalman", {"states": {"1st": "rad", "rate": "rad/s"}}, "states: '1st' must be letters,"),
    ("kalman", {"states": {f"x{k}": "1" for k in range(101)}}, "states: names 101 signals, must"),
    ("luenberger", {"poles": None}, "poles: are missing, and so are gains; one of them must"),
    ("normal-form", {"poles": None}, "poles: are missing, and so are gains; one of them"),
    ("normal-form", {"inputs": {"angle": "rad"}}, "inputs.angle: is the name of a state, too"),
    ("normal-form", {"dynamics": {"angle": "rate"}}, "dynamics.rate: is missing; each signal"),
    ("normal-form", {"injection": {"spin": "y1"}}, "injection.spin: is of no state; there are:"),
    ("levant", {"measurements": SQUARE}, "measurements: name 2 signals, must be the one to differ"),
    ("imm", {"modes": {}}, "modes: has 0 modes, must have 1 to 50"),
    ("imm", {"gains": {"convergence_rate": 0.1, **SAME}}, "gains.convergence_rate: must be left"),
    (
        "imm", {"gains": {"filter": "svsf", "convergence_rate": 0.1, **SAME}},
        "gains.boundary_layer: is",
    ),
    ("high-gain", {"inputs": {"a": "V", "b": "V"}}, "inputs: name 2 signals, must name one"),
    ("high-gain", {"states": {}}, "states: are none, must be one or more"),
    ("high-gain", {"measurements": SQUARE}, "measurements: name 2 signals, must name one, which"),
    ("high-gain", {"drift": {"angle": 0}}, "drift.rate: is missing; each signal needs one"),
    ("high-gain", {"drift": {"angle": 0, "rate": 0, "spin": 0}}, "drift.spin: is of no signal"),
    ("high-gain", {"lipschitz": {"angle": {"rate": 1}}}, "lipschitz.angle.rate: must not be"),
    ("high-gain", {"lipschitz": {"rate": {"spin": 1}}}, "lipschitz.rate.spin: is of no state"),
    ("extended-kalman", {"states": {}}, "states: are none, must be one or more"),
    ("extended-kalman", {"measurements": {}}, "measurements: are none, must be one or more"),
    ("extended-kalman", {"dynamics": {"angle": "rate"}}, "dynamics.rate: is missing; each signal"),
    ("extended-kalman", {"output": {"angel": "angle"}}, "output.angel: is of no signal; did you m"),
    ("extended-kalman", {"inputs": {"angle": "rad"}}, "inputs.angle: is the name of a state, too"),
    ("extended-kalman", {"parameters": {"rate": 1}}, "parameters.rate: is the name of a state, to"),
    ("extended-kalman", {"parameters": {"torque": 1}}, "parameters.torque: is the name of an inpu"),
    ("extended-kalman", {"parameters": {"k": 1}}, "parameters.k: is in no text of dynamics or out"),
    ("extended-kalman", {"parameters": {"stifness": 1}}, "parameters.stifness: is in no text of dy"
     "namics or output, which name stiffness"),
    ("extended-kalman", {"time": "discrete"}, "substeps: must be left out where time is discrete"),
    ("extended-kalman", {"time": "sampled"}, "time: 'sampled' must be one of continuous, discrete"),
    ("extended-kalman", {"initial_state": [1]}, "initial_state: has shape (1,), must be"),
    ("extended-kalman", {"gains": {"alpha": 1}}, "gains: must be left out; nothing is chosen in"),
    ("unscented-kalman", {"alpha": 1}, "alpha: must stand under gains"),
    ("unscented-kalman", {"gains": {"alfa": 1}}, "gains.alfa: unknown key; did you mean 'alpha'?"),
    ("ilo", {"states": {"x": "deg/s", "y": "rad/s", "z": "rad/s"}}, "states.x: 'deg/s' must be"),
    ("adaptive", {"inputs": {"u": "kN m", "v": "N m", "w": "N m"}}, "inputs.u: 'kN m' must be 'N"),
    ("eso", {"Fa": None}, "Fa: is missing, must have shape (2, 1), as the signals say"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "changed", "said"), MODELS)
def test_invalid_model_is_refused_naming_the_key(
    kind: str, changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as error:
        design(kind, **changed)
    assert str(error.value).startswith(said)


SYSTEMS = {kind: get_type_hints(family(kind))["system"] for kind in FAMILIES}


@pytest.mark.parametrize(("kind", "changed", "said"), MODELS)
def test_what_a_system_refuses_every_system_derived_from_it_refuses(
    kind: str, changed: dict[str, Any], said: str
) -> None:
    """But for what a kind must state, and for what is about gains."""
    system, derived = SYSTEMS[kind], []
    for other, one in SYSTEMS.items():
        named = all(key in {each.name for each in fields(one)} for key in changed)
        if other != kind and issubclass(one, system) and named:
            derived.append(other)
            with pytest.raises(InputError) as error:
                design(other, **changed)
            assert str(error.value).startswith(said.partition(":")[0].partition(".")[0]), other
    if kind == "high-gain" and "inputs" not in changed:
        assert derived == ["extended-high-gain"]


@pytest.mark.parametrize("kind", FAMILIES)
def test_non_positive_period_is_refused_naming_the_key(kind: str) -> None:
    with pytest.raises(InputError, match=r"^sampling_period: 0 must be greater than zero$"):
        design(kind, sampling_period=0.0)


def test_decay_and_bound_cannot_be_combined() -> None:
    with pytest.raises(InputError, match="decay: is a criterion of its own, for the"):
        design("eso", structure="pi", decay=1.0, bound=2.0)


FILES: list[tuple[str, Any, str]] = [
    ("certificate", None, "certificate.poles: is missing"),
    ("poles", None, "certificate.poles: is missing"),
    ("poles", [[0.9, 0.0]], "certificate.poles: must be 2 pairs of real and imaginary part"),
    ("beauty", 1.0, "certificate.beauty: is nothing that this kind of design certifies"),
]


@pytest.mark.parametrize(("name", "value", "said"), FILES)
def test_certificate_with_unknown_entries_is_refused(
    name: str, value: Any, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "d.json"
    save_design(path, design("luenberger"))
    tree = json.loads(path.read_text(encoding="utf-8"))
    branch = tree if name == "certificate" else tree["certificate"]
    if value is None:
        del branch[name]
    else:
        branch[name] = value
    path.write_text(json.dumps(tree), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_design(path)
    assert str(error.value).startswith(f"{path}: {said}")

"""Design files restore the design bitwise and are certified again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.examples import model_text
from reobserve.estimation.families.file import load_design, save_design
from reobserve.estimation.observer_design import Design
from reobserve.synthesis.extended_state import pd_pi

MOTOR = expm(0.01 * np.array([[-10, 40], [-0.4, -20]]))


@pytest.fixture(scope="module")
def designs() -> dict[str, Design]:
    chosen: dict[str, tuple[str, dict[str, Any]]] = {
        "steady": ("kalman", {"gain": "steady"}), "varying": ("kalman", {}),
        **{name: (name, {}) for name in FAMILIES if name != "kalman"},
    }  # fmt: skip
    found = {}
    for name, (kind, options) in chosen.items():
        made: Any = family(kind)
        found[name] = made.designed({**parse_yaml(model_text(kind), "model.yaml"), **options})
    return found


@pytest.fixture
def stored(designs: dict[str, Design], tmp_path: Path) -> dict[str, Path]:
    for name, design in designs.items():
        save_design(tmp_path / f"{name}.json", design)
    return {name: tmp_path / f"{name}.json" for name in designs}


def test_loaded_design_is_bitwise_identical_to_the_saved_one(
    designs: dict[str, Design], stored: dict[str, Path]
) -> None:
    for name, design in designs.items():
        loaded = load_design(stored[name])
        sine = 0.1 * np.sin(np.arange(30.0))[:, None]
        y, u = (sine * np.ones(len(part)) for part in (design.measurements, design.inputs))
        runs = [each.observer.run(y, u, start=each.start()) for each in (design, loaded)]
        left = set(runs[0].estimates) - set(loaded.estimates)
        assert all(name.endswith("covariance") for name in left)
        for estimate, signals in loaded.estimates.items():
            assert np.array_equal(runs[0][estimate], runs[1][estimate])
            assert np.prod(runs[0][estimate].shape[1:]) == len(signals)


def test_kalman_gain_agrees_with_scipy_riccati_solver(stored: dict[str, Path]) -> None:
    R = np.diag([1e-3, 1e-4])
    P = solve_discrete_are(MOTOR.T, np.eye(2), 1e-4 * np.eye(2), R)
    expected = P @ np.linalg.inv(P + R)
    assert load_design(stored["steady"]).gains.gain == pytest.approx(expected, rel=1e-9)


def test_luenberger_poles_are_placed_as_specified(stored: dict[str, Path]) -> None:
    design = load_design(stored["luenberger"])
    # e(k+1) = (I - L) A e(k): both states are measured, and corrected by the innovation
    found = np.sort(np.linalg.eigvals(MOTOR - design.gains.gain @ MOTOR))
    assert np.log(found) / 0.01 == pytest.approx([-70, -50], rel=1e-9)
    poles = np.array(design.certificate["poles"])
    assert np.log(poles[:, 0]) / 0.01 == pytest.approx([-50, -70], rel=1e-9)


def test_eso_design_agrees_with_the_synthesis(stored: dict[str, Path]) -> None:
    design = load_design(stored["eso"])
    expected = pd_pi.design(design.system.augmented, 1.05)
    assert np.array_equal(design.gains.L, expected.gains.L)
    assert design.certificate["norm_upper"] == expected.certificate.norm_upper
    assert design.certificate["norm_upper"] < design.gains.gamma


def test_eso_with_pole_bound_has_minimum_gamma() -> None:
    eso: Any = family("eso")
    design = eso.designed({**parse_yaml(model_text("eso"), "model.yaml"), "bound": 50.0})
    expected = pd_pi.design_minimum_gamma(design.system.augmented, decay=0.0, bound=50.0)
    assert np.array_equal(design.gains.L, expected.gains.L)
    assert design.gains.gamma == expected.gamma
    # A strip away from the imaginary axis has a cost, which would be noticed.
    away = pd_pi.design_minimum_gamma(design.system.augmented, decay=0.01, bound=50.0)
    assert away.lower > expected.gamma


def tampered(path: Path, *keys: Any, value: Any) -> Path:
    tree = json.loads(path.read_text(encoding="utf-8"))
    branch = tree
    for key in keys[:-1]:
        branch = branch[key]
    branch[keys[-1]] = value(branch[keys[-1]]) if callable(value) else value
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


@pytest.mark.nightly_after(9)
@pytest.mark.parametrize(
    ("name", "keys", "value", "said"),
    [
        ("steady", ("gains", "gain", 0, 0), lambda g: 1.001 * g, "Riccati equation gives 0.2283"),
        ("steady", ("gains", "gain", 0, 0), -1.0, "must be below 1, it is 1.805"),
        ("luenberger", ("gains", "gain", 1, 0), lambda g: 1.01 * g, "but the gains give 0.60654"),
        ("luenberger", ("gains", "gain", 1, 0), -9.0, "must be below 1, it is 3.70457"),
        ("luenberger", ("system", "sampling_period"), 0.02, "certificate.poles: says 0.6065"),
        ("luenberger", ("certificate", "spectral_radius"), 0.5, "the gains give 0.6065"),
        ("eso", ("gains", "L", 0, 0), lambda g: 1.001 * g, "certificate.poles: says -7.91"),
        ("eso", ("gains", "L", 0, 0), 100.0, "norm, 0.225663101 to 0.225663101, is not proved"),
        ("eso", ("gains", "gamma"), 0.1, "below 0.1856.*, which no gains get below"),
        ("eso", ("system", "Fs"), [[0.0], [0.0]], "has rank 0, must have 1"),
        ("steady", ("schema",), 2, "schema: 2 must be 1, which this version reads"),
        ("steady", ("kind",), "kallman", "kind: 'kallman' must be one of kalman, luenberger"),
        ("steady", ("format",), "x", "format: 'x' must be 'reobserve design'"),
        ("steady", ("system", "states", "speed"), "radd", "'radd' is no unit"),
        ("steady", ("system", "A"), [[1.0]], r"system.A: has shape \(1, 1\), must be \(2, 2\)"),
    ],
)  # fmt: skip
def test_tampered_design_is_refused_with_the_failing_number(
    stored: dict[str, Path], name: str, keys: tuple[Any, ...], value: Any, said: str
) -> None:
    path = tampered(stored[name], *keys, value=value)
    with pytest.raises(InputError, match=said) as refused:
        load_design(path)
    assert str(refused.value).startswith(str(path))


def test_failed_write_keeps_the_previous_design(
    designs: dict[str, Design], stored: dict[str, Path]
) -> None:
    path = stored["steady"]
    before = path.read_bytes()
    path.chmod(0o444)
    with pytest.raises(InputError, match="is read-only"):
        save_design(path, designs["steady"])
    assert path.read_bytes() == before


def numbers(tree: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of numbers in a design file: of each list of numbers the last."""
    if isinstance(tree, dict):
        for name, part in tree.items():
            yield from numbers(part, (*place, name))
    elif isinstance(tree, list) and tree:
        yield from numbers(tree[-1], (*place, len(tree) - 1))
    elif isinstance(tree, int | float) and not isinstance(tree, bool):
        yield place


# Numbers that text may state, and those that may be left out.
ALSO_TEXT = {
    "luenberger": ("poles",), "normal-form": ("poles",), "high-gain": ("drift", "input_gain"),
    "extended-high-gain": ("drift", "input_gain"),
}  # fmt: skip
MAY_BE_LEFT_OUT = ("gamma", "update_interval", "substeps")


@pytest.mark.nightly_after(6)
@pytest.mark.parametrize("kind", FAMILIES)
def test_number_of_another_type_is_refused_and_named(kind: str, stored: dict[str, Path]) -> None:
    path = stored["steady" if kind == "kalman" else kind]
    whole = path.read_text(encoding="utf-8")
    for place in numbers(json.loads(whole)):
        for value in (str, True, None, [[[[0.5]]]]):
            text = value is str and place[1:2] and place[1] in ALSO_TEXT.get(kind, ())
            if text or (value is None and place[-1] in MAY_BE_LEFT_OUT):
                continue
            path.write_text(whole, encoding="utf-8")
            tampered(path, *place, value=value)
            with pytest.raises(InputError) as refused:
                load_design(path)
            assert str(refused.value).startswith(f"{path}: "), place

"""Extended and unscented Kalman filters from text, against other families and closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.cli.main import main
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families import family
from reobserve.estimation.families.examples import simulated, specification_text
from reobserve.estimation.families.file import load_design, save_design
from reobserve.estimation.specification import Specification
from reobserve.tuning.tuned_specification import TunedSpecification
from tests.reobserve.estimation.records import read_results, specification, write_record

Array = NDArray[np.float64]

# And what rounding may change; weights of sigma points, and so rounding, grow as 1 / alpha^2.
ROUNDING = {"extended-kalman": 1e-12, "unscented-kalman": 1e-10}
KINDS = tuple(ROUNDING)
A, B = zero_order_hold([[-10.0, 40.0], [-0.4, -20.0]], [[0.0], [20.0]], 0.01)
AS_TEXT = {
    name: f"{a!r}*speed + {b!r}*current + factor*{c!r}*voltage"
    for name, (a, b), (c,) in zip(("speed", "current"), A.tolist(), B.tolist(), strict=True)
}


def observed(
    chosen: Specification, columns: dict[str, Array], folder: Path
) -> tuple[dict[str, Array], list[str]]:
    """The results of a record."""
    estimate_file(chosen, write_record(folder / "r.csv", columns), folder / "e.csv")
    return read_results(folder / "e.csv")


def motor(kind: str) -> Specification:
    """The example of the Kalman filter, or the same linear model as text."""
    tree = parse_yaml(specification_text("kalman"), "kalman.yaml")
    observer = tree["observer"]
    if kind != "kalman":
        for key in "ABC":
            del observer[key]
        observer |= {
            "kind": kind, "time": "discrete", "parameters": {"factor": 1.0}, "dynamics": AS_TEXT,
            "output": {"speed": "speed", "current": "current"},
        }  # fmt: skip
    return parse(Specification, tree)


@pytest.mark.parametrize("kind", KINDS)
def test_linear_model_as_text_agrees_with_the_kalman_family(kind: str, tmp_path: Path) -> None:
    """With a dead sensor, lost rows, and a gap that is coasted over."""
    columns = {name: values[:500].copy() for name, values in simulated("kalman").record().items()}
    columns["speed"][40:60] = np.nan
    columns = {name: np.delete(values, slice(200, 240)) for name, values in columns.items()}
    (expected, status), (found, other) = (
        observed(motor(one), columns, tmp_path) for one in ("kalman", kind)
    )
    assert other == status
    assert {"predicted", "partial", "measured"} == {*status}
    assert list(found) == list(expected)
    for name, values in expected.items():
        if not name.startswith("alarm"):
            off = ROUNDING[kind] * np.nanmax(np.abs(values))
            assert found[name] == pytest.approx(values, abs=off, rel=0, nan_ok=True), name


@pytest.mark.parametrize("kind", KINDS)
def test_design_file_gives_the_numbers_of_the_keys_that_it_was_made_of(
    kind: str, tmp_path: Path
) -> None:
    """Bitwise; the other tests compare those with calls of the library."""
    columns = {name: values[:300] for name, values in simulated(kind).record().items()}
    tree = parse_yaml(specification_text(kind), "s.yaml")
    model = {**tree["observer"], "sampling_period": tree["sampling"]["period"]}
    del model["kind"]
    save_design(tmp_path / "d.json", family(kind).designed(model))
    from_file = {"kind": "design", "file": str(tmp_path / "d.json")}
    chosen = [
        parse(Specification, {**tree, "observer": one}) for one in (tree["observer"], from_file)
    ]
    stated, designed = (observed(one, columns, tmp_path)[0] for one in chosen)
    for name, values in stated.items():
        assert np.array_equal(designed[name], values), name


@pytest.mark.parametrize("kind", KINDS)
def test_estimates_do_not_depend_on_units(kind: str, tmp_path: Path) -> None:
    """A record in degrees and mN m, the same in turns and N m, and results in degrees."""
    columns = {name: values[:300] for name, values in simulated(kind).record().items()}
    expected, _ = observed(specification(kind), columns, tmp_path)
    other = {**columns, "angle": columns["angle"] / 360, "torque": columns["torque"] / 1000}
    changed: dict[str, Any] = {
        "measurements": [{"column": "angle", "unit": "turn"}],
        "inputs": [{"column": "torque", "unit": "N m"}],
    }
    named = {"state": {"angle": "deg", "rate": "deg/s"}}
    found, _ = observed(specification(kind, columns=changed, estimates=named), other, tmp_path)
    for name, values in expected.items():
        factor = 1.0 if name.startswith(("time", "residual")) else np.rad2deg(1.0)
        off = ROUNDING[kind] * np.abs(values).max()
        assert found[name] / factor == pytest.approx(values, abs=off, rel=0), name


def constant(kind: str, **changed: Any) -> Any:
    """A constant of variance 1 at first, measured with noise of variance 1."""
    made: Any = family(kind)
    return made.designed({
        "time": "discrete", "sampling_period": 1.0, "states": {"x": "m"},
        "measurements": {"y": "m"}, "dynamics": {"x": "x"}, "output": {"y": "x"},
        "Q": 0.0, "R": 1.0, "initial_covariance": 1.0, **changed,
    })  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_certificate_has_the_deviations_at_the_start(kind: str, tmp_path: Path) -> None:
    """The first row is expected with the variance 1 + 1, the next state with 2^2 + 5."""
    made = constant(kind, dynamics={"x": "2*x"}, Q=5.0)
    saved = save_design(tmp_path / "d.json", made)
    expected = {"innovation_sigma_y": np.sqrt(2.0), "sigma_x": 3.0}
    assert saved.certificate == pytest.approx(expected, rel=1e-12)
    assert saved.summary()[2] == "standard deviations predicted a sample after the start: x 3 m"
    assert load_design(tmp_path / "d.json").certificate == saved.certificate
    text = (tmp_path / "d.json").read_text(encoding="utf-8")
    for changed, said in (
        ('"R": 2.0', r"certificate.innovation_sigma_y: says 1.414.*, but the gains give 1.73"),
        ('"R": -1.0', r"d.json: R: must be positive semidefinite, its eigenvalues are -1"),
    ):
        (tmp_path / "d.json").write_text(text.replace('"R": 1.0', changed), encoding="utf-8")
        with pytest.raises(InputError, match=said):
            load_design(tmp_path / "d.json")


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"R": -1.0}, "R: "),
    ({"Q": [[-1.0]]}, "Q: "),
    ({"initial_covariance": -1.0}, "initial_covariance: "),
    ({"initial_covariance": [1.0, 1.0]}, "initial_covariance: "),
    ({"dynamics": {"x": "y"}}, "dynamics.x: 'y' names y, must name nothing but x"),
    ({"dynamics": {"x": "x +"}}, "dynamics.x: 'x +' is no expression, at its end"),
    ({"output": {"y": "floor(x)"}}, "output.y: 'floor' is not expanded; what can be are sums, pro"),
    ({"parameters": {"1x": 1.0}, "dynamics": {"x": "1x"}}, "parameters: "),
    ({"time": "continuous", "substeps": 0}, "substeps: 0 must be a whole number, from 1 to 10000"),
    (
        {"dynamics": {"x": "1/(x - 1)"}, "initial_state": [1.0]},
        "initial_state: takes no step from there with inputs of zero: f, or the covariance after",
    ),
    ({"output": {"y": "log(x)"}}, "initial_state: takes no step from there with inputs of zero: h"),
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("changed", "said"), REFUSED)
def test_model_without_a_first_step_is_refused_naming_the_key(
    changed: dict[str, Any], said: str, kind: str
) -> None:
    with pytest.raises(InputError) as error:
        constant(kind, **changed).certify()
    assert str(error.value).startswith(said)


def test_sigma_points_that_cannot_be_are_refused_naming_the_key() -> None:
    for gains, said in (
        ({"alpha": 2.0}, r"^gains.alpha: 2 must be from 1e-6 to 1$"),
        ({"kappa": -1.0}, r"^gains.kappa: -1 must be above -1, minus n$"),
    ):
        with pytest.raises(InputError, match=said):
            constant("unscented-kalman", gains=gains).certify()


@pytest.mark.parametrize("kind", KINDS)
def test_model_without_a_value_at_zero_inputs_runs_on_a_record(kind: str, tmp_path: Path) -> None:
    """The torque is the one that drives the pendulum."""
    columns = {name: values[1:200] for name, values in simulated(kind).record().items()}
    inverted = {**columns, "torque": 1e6 / columns["torque"]}
    rate = "-stiffness*sin(angle) - friction*rate + gain/torque"
    changed = {"dynamics": {"angle": "rate", "rate": rate}}
    expected, _ = observed(specification(kind), columns, tmp_path)
    found, _ = observed(specification(kind, observer=changed), inverted, tmp_path)
    for name in ("angle", "rate", "rate sigma"):
        assert found[name] == pytest.approx(expected[name], rel=1e-9, abs=1e-12), name


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_of_the_model_can_be_tuned(kind: str, tmp_path: Path) -> None:
    """Parameters and covariances; the friction that was simulated is found, and what is not tuned
    stays.
    """
    text = specification_text(kind).replace("friction: 0.5", "friction: 2.0")
    columns = simulated(kind).record()
    write_record(tmp_path / "r.csv", {n: v[:400] for n, v in columns.items()})
    (tmp_path / "s.yaml").write_text(text)
    keys = ["observer.parameters.friction", "observer.Q.1"]
    keys += ["observer.gains.alpha"] if kind == "unscented-kalman" else []
    made = TunedSpecification(tmp_path / "s.yaml")
    assert [made.number(key) for key in keys][:2] == [2.0, 1e-7]
    (tmp_path / "t.yaml").write_text(
        "title: Swing\nbudget: 30\ntraining: [{file: r.csv, since: 0.5, until: 2.0}]\n"
        "held_out: [{file: r.csv, since: 2.0, segments: 4}]\n"
        "candidates:\n  one:\n    specification: s.yaml\n    ranges:\n"
        "      observer.parameters.friction: {range: [0.1, 4.0]}\n"
    )
    assert main(["tune", str(tmp_path / "t.yaml"), "--output", str(tmp_path / "out")]) == 0
    found = TunedSpecification(tmp_path / "out/one.yaml")
    assert found.number("observer.parameters.friction") == pytest.approx(0.5, rel=0.2)
    assert found.number("observer.Q.1") == 1e-7

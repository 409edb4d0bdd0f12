"""Properties that designs of each kind state, against independent computations."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import optimize
from scipy.linalg import expm

from reobserve.codegen import record
from reobserve.core.documents import Tree, parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.examples import model_text
from reobserve.estimation.families.poles import as_pole_list
from reobserve.estimation.families.signals import product
from reobserve.estimation.observer_design import Design
from reobserve.synthesis.high_gain_design import high_gain, lyapunov_matrix


def model(kind: str, **changed: Any) -> Tree:
    """The example of a kind, with other values."""
    tree: Tree = parse_yaml(model_text(kind), "model.yaml")
    return {**tree, **changed}


# A pendulum with a torque, and the terms with which its normal form is exact.
DRIVEN = {
    "inputs": {"torque": "N m"}, "injection": {"rate": "sin(y1) - y1"}, "order": 3,
    "dynamics": {"angle": "rate", "rate": "-sin(angle) - rate/10 + torque"},
}  # fmt: skip


def design(kind: str, **changed: Any) -> Any:
    made: Any = family(kind)
    found: Design = made.designed(model(kind, **changed))
    return found


UNSAID = {"step_growth", "square", "innovation_sigma_angle"}


@pytest.mark.parametrize("kind", FAMILIES)
def test_summary_says_the_numbers_of_the_certificate(kind: str) -> None:
    built = design(kind)
    certificate = built.certify()
    text = " ".join(replace(built, certificate=certificate).summary())
    said = [float(number) for number in re.findall(r"\d+\.?\d*(?:e[+-]\d+)?", text)]
    for name in certificate.keys() - UNSAID:
        period = built.system.sampling_period if name.startswith(("samples", "rows")) else 1.0
        values = [] if isinstance(certificate[name], str) else np.abs(np.ravel(certificate[name]))
        for value in values:
            assert value < 1e-12 or np.isclose(said, value * period, rtol=5e-4, atol=0).any(), name


@pytest.mark.parametrize("kind", FAMILIES)
def test_observer_reads_all_numbers_of_columns_that_are_stated(kind: str) -> None:
    unnamed = [design(kind, inputs={})] if kind == "extended-high-gain" else []
    for built in (design(kind), *unnamed):
        for widths in itertools.product(*built.widths):
            record.test_run(built.observer, built.start(), widths)


def poles(design: Design) -> Any:
    return np.sort_complex([complex(*pole) for pole in design.certify()["poles"]])


def test_continuous_time_complex_poles_are_placed_after_sampling() -> None:
    placed = design("luenberger", poles=["-3+1j", "-3-1j"])
    expected = np.sort_complex(np.exp(0.01 * np.array([-3 + 1j, -3 - 1j])))
    assert poles(placed) == pytest.approx(expected, rel=1e-9)


def test_discrete_model_is_used_unchanged() -> None:
    A, B, seen = [[1.0, 0.1], [0.0, 1.0]], [[0.005], [0.1]], {"angle": "rad"}
    placed = design("luenberger", poles=[0.5, 0.6], time="discrete", A=A, B=B, C=[[1, 0]],
                    measurements=seen)  # fmt: skip
    # (z - 0.5)(z - 0.6) = det(z I - A + L C A), with C A = [1, 0.1].
    L = placed.gains.gain
    error = np.array(A) - L @ np.array([[1.0, 0.1]])
    assert np.sort(np.linalg.eigvals(error).real) == pytest.approx([0.5, 0.6])
    assert np.array_equal(placed.observer.model.A, A)


def test_discrete_model_that_looks_continuous_needs_check_false() -> None:
    given = {"time": "discrete", "A": [[-0.5, 0.1], [0.0, -0.2]], "poles": [0.05, 0.06]}
    with pytest.raises(InputError, match=r"^A: has the eigenvalue -0.5, as A of continuous time"):
        design("luenberger", **given)
    assert np.array_equal(design("luenberger", **given, check=False).observer.model.A, given["A"])


def test_normal_form_poles_govern_the_error() -> None:
    """With the injection S(x) = x, so errors follow exp(A t) for any u."""
    built = design("normal-form", **DRIVEN)
    slowest_first = [[-1.5, 0.0], [-2.0, 0.0]]
    np.testing.assert_allclose(built.certify()["poles"], slowest_first, rtol=1e-9, atol=1e-12)
    assert built.certify()["nonlinearity"] < 1e-12
    A = np.array([[0, 1], [-1, -0.1]]) + built.gains.injection @ np.array([[1, 0]])
    assert np.sort(np.linalg.eigvals(A)) == pytest.approx([-2.0, -1.5], rel=1e-9)
    said = replace(built, certificate=built.certify()).summary()
    assert said[2] == "S(x) = x: the error is linear in x itself"


def test_normal_form_nonlinearity_is_the_largest_higher_coefficient() -> None:
    """Of x' = -x + x^2 and z' = -1.5 z - l(y), S has s_k = (k - 1) / (k - 1.5) s_(k - 1)."""
    changed = {"states": {"x": "m"}, "inputs": {}, "measurements": {"y": "m"}, "injection": None}
    right_hand_sides = {"dynamics": {"x": "-x + x**2"}, "output": {"y": "x"}}
    started = {"poles": [-1.5], "initial_state": [0.1], "order": 4}
    built = design("normal-form", **changed, **right_hand_sides, **started)
    series = np.cumprod([(k - 1) / (k - 1.5) for k in range(2, 12)])
    degree = built.observer.normal_form.S.coefficients.shape[1] - 1
    assert degree > 3
    assert built.certify()["nonlinearity"] == pytest.approx(series[degree - 2], rel=1e-12)
    said = replace(built, certificate=built.certify()).summary()
    assert said[2].startswith(f"largest coefficient of S beyond x: {series[degree - 2]:.4g}; ")


def test_differentiator_error_falls_with_powers_of_the_period() -> None:
    built = design("levant", sampling_period=0.01)
    bound, order = built.observer.L, built.gains.order
    expected = {f"scale_{i}": bound * 0.01 ** (order + 1 - i) for i in range(order + 1)}
    assert built.certify() == pytest.approx(expected, rel=1e-12)


def test_normal_form_with_unobservable_input_is_refused_naming_the_term() -> None:
    with pytest.raises(InputError, match=r"inputs: .* a term in .*torque that is none"):
        design("normal-form", **{**DRIVEN, "injection": None})
    with pytest.raises(InputError, match=r"dynamics.rate: holds speed, which has no value"):
        design("normal-form", dynamics={"angle": "rate", "rate": "-speed"})
    with pytest.raises(InputError, match=r"dynamics.rat: is of no signal; did you mean 'rate'"):
        design("normal-form", dynamics={"angle": "rate", "rat": "-angle"})
    with pytest.raises(InputError, match=r"injection.rat: is of no state; did you mean 'rate'"):
        design("normal-form", injection={"rat": "angle**2"})


def test_adaptive_observer_poles_agree_with_closed_form() -> None:
    """On a ball: j s^2 + (observer_gain + Kp) s + Gamma = 0, three times."""
    gains = {"observer_gain": 30.0, "integral_gain": 200.0, "proportional_gain": 10.0}
    built = design("adaptive", inertia=np.diag([5.0, 5.0, 5.0]).tolist(), gains=gains)
    expected = np.sort_complex(np.repeat(np.roots([5.0, 40.0, 200.0]), 3))
    assert poles(built) == pytest.approx(expected, rel=1e-9)
    with pytest.raises(InputError, match=r"poles .* which steps of 10 s do not follow"):
        design("adaptive", sampling_period=10.0).certify()
    # With observer_gain + Kp = -10 errors grow; on a ball by the roots of 5 s^2 - 10 s + 200.
    gains["proportional_gain"] = -40.0
    with pytest.raises(InputError, match=r"^observer_gain: .* errors with the poles 1[+-]6.2\d*j"):
        design("adaptive", inertia=np.diag([5.0, 5.0, 5.0]).tolist(), gains=gains).certify()


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 85.0])
def test_adaptive_observer_is_certified_up_to_the_poles_that_its_steps_follow(
    degrees: float,
) -> None:
    """Poles at an angle from the negative axis, just inside and outside of where |R(p T)| is 1."""
    ray, period, inertia = -np.exp(1j * np.radians(degrees)), 0.01, 5.0

    def grows(size: float) -> float:
        z = size * ray  # the fourth-order Runge-Kutta method multiplies e' = p e by R(z)
        return abs(np.polyval([1 / 24, 1 / 6, 1 / 2, 1, 1], z)) - 1

    # From one on: near the imaginary axis |R| is close to one for short steps, too.
    limit = optimize.brentq(grows, 1.0, 4.0)
    for factor, follows in ((0.99, True), (1.01, False)):
        rate = factor * limit / period
        gains = {
            "observer_gain": inertia * 2 * rate * -ray.real, "integral_gain": inertia * rate**2,
            "proportional_gain": 0.0,
        }  # fmt: skip
        built = design(
            "adaptive", inertia=(inertia * np.eye(3)).tolist(), gains=gains, sampling_period=period
        )
        observer, y = built.observer, np.zeros((2000, 3))
        start = observer.init([1e-9, 0.0, 0.0])
        errors = np.abs(observer.run(y, y, start=start, on_divergence="return")["fault"])
        assert (errors[-100:].max() < errors[:100].max()) == follows
        if follows:
            built.certify()
        else:
            with pytest.raises(InputError, match=r"which steps of 0\.01 s do not follow"):
                built.certify()


def test_high_gain_error_decays_within_the_proved_bound() -> None:
    """For two states the square root of the condition number of S is the golden ratio squared."""
    bounds = {"lipschitz": {"rate": {"angle": 9.81, "rate": 0.5}}, "initial_state": [0.3, 0]}
    built = design("high-gain", **bounds, gains={"rho": 12})
    rho, ratio = 12.0, (3.0 + np.sqrt(5.0)) / 2.0
    decay = built.certify()["decay"]
    assert decay == pytest.approx(rho / 2 - ratio * np.hypot(9.81 / rho, 0.5), rel=1e-9)
    y = np.zeros((101, 1))  # the plant at rest
    error = built.observer.run(y, y, start=built.start())["state"]
    S = lyapunov_matrix(2, rho)
    size = np.einsum("ki,ij,kj->k", error, S, error)
    bound = size[0] * np.exp(-2 * decay * 0.01 * np.arange(101)) * (1 + 1e-9)
    assert np.all(size <= bound)
    with pytest.raises(InputError, match=r"rho: 6 1/s is too low for the bounds of lipschitz"):
        design("high-gain", **bounds, gains={"rho": 6}).certify()
    with pytest.raises(InputError, match=r"lipschitz.rate.rate: -1 must be finite, 0 or more"):
        design("high-gain", lipschitz={"rate": {"rate": -1.0}})
    with pytest.raises(InputError, match=r"rho: makes a rate of 300 1/s, which with steps"):
        design("high-gain", gains={"rho": 300}).certify()
    with pytest.raises(InputError, match=r"drift.angle: 'rate' names rate, must name nothing but"):
        _ = design("high-gain", drift={"angle": "rate", "rate": 0}).observer
    with pytest.raises(InputError, match=r"measurements.angle: has the unit deg, must have that"):
        design("high-gain", measurements={"angle": "deg"})


def test_extended_high_gain_certificate_uses_the_linear_part() -> None:
    built = design("extended-high-gain")
    certificate = built.certify()
    A = np.diag([1.0], 1) - np.outer(high_gain(2, 5.0), [1.0, 0.0])
    assert np.poly(A) == pytest.approx(np.poly([complex(*p) for p in certificate["poles"]]))
    assert certificate["step_growth"] == pytest.approx(np.exp(-0.05), rel=1e-8)
    with pytest.raises(InputError, match=r"inputs: name 2 signals, must name 1, or 3 with the der"):
        design("extended-high-gain", inputs={"valve": "1", "rate": "1/s"})
    with pytest.raises(InputError, match=r"lipschitz: has no use here"):
        design("extended-high-gain", lipschitz={})


def test_learning_observer_radius_and_error_agree_with_single_axis() -> None:
    """K1 = I, held: w~ -> a w~ - b v, v -> v + K2 w~ a sample later, with a = exp(-l tau / j)."""
    j, observer_gain, K2, tau = 20.0, 500.0, 500.0, 0.01
    gains = {"K1": 1, "K2": K2, "observer_gain": observer_gain, "update_interval": tau}
    built = design("ilo", inertia=np.diag([j, j, j]).tolist(), gains=gains)
    a = np.exp(-observer_gain * tau / j)
    b = (1 - a) / observer_gain
    radius = np.abs(np.linalg.eigvals([[a - b * K2, -b], [K2, 1.0]])).max()
    certificate = built.certify()
    assert certificate["spectral_radius"] == pytest.approx(radius, rel=1e-12)
    assert certificate["rms_error_y"] == pytest.approx(0, abs=1e-15)
    with pytest.raises(InputError, match=r"must give stable error dynamics.* the limit is"):
        design("ilo", gains={**gains, "K2": 1e6}).certify()


def test_bank_modes_are_sampled_individually() -> None:
    built = design("imm")
    for one, friction in zip(built.observer.filters, (10, 20), strict=True):
        whole = expm(0.01 * np.array([[-friction, 40, 0], [-0.4, -20, 20], [0, 0, 0]]))
        assert pytest.approx(whole[:2, :2], abs=1e-14) == one.model.A
        assert pytest.approx(whole[:2, 2:], abs=1e-14) == one.model.B
    assert built.certify()["samples_in_worn"] == pytest.approx(1000)
    names = [signal.name for signal in built.estimates["probability"]]
    assert names == ["probability_healthy", "probability_worn"]
    with pytest.raises(InputError, match=r"modes.worn.A: has shape \(1, 1\), must be \(2, 2\)"):
        design("imm", modes={"healthy": {}, "worn": {"A": [[1]]}}).certify()


def test_units_of_products_are_reduced() -> None:
    assert product("rad/s", "rad/s") == "rad^2/s^2"
    assert product("rad/s", "s/rad") == "1"
    assert product("N m", "1/(A s^2)") == "N m/(A s^2)"
    assert product("rad", "") == ""
    derivatives = design("levant", measurements={"angle": "rad"}).states
    assert [signal.unit for signal in derivatives] == ["rad", "rad/s", "rad/s^2"]


@pytest.mark.parametrize("text", ["-1x", "1+2", "j", "nan", "1e400", "--1", "1+2j+3"])
def test_invalid_pole_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"must be a number, or one like -1|must be finite"):
        as_pole_list("poles", ["-2", text])
    assert as_pole_list("", [-2, ".5e1-3.25j", "-1+2i"]) == [-2, 5 - 3.25j, -1 + 2j]


@pytest.mark.parametrize("kind", ["ilo", "adaptive"])
def test_rigid_body_starts_from_the_stated_rate_and_fault(kind: str) -> None:
    rate, fault = [0.1, -0.2, 0.3], [0.5, 0.0, -0.5]
    built = design(kind, initial_state=rate, initial_fault=fault)
    wanted = built.observer.init(rate, fault=fault)
    found = built.start()
    assert np.array_equal(found.rate, wanted.rate)
    y, u = np.tile(rate, (3, 1)), np.zeros((3, 3))
    runs = [built.observer.run(y, u, start=state)["fault"] for state in (found, wanted)]
    assert np.array_equal(*runs)
    for given, said in (({"initial_fault": fault}, "goes with"), ({"initial_state": rate,
                        "initial_fault": fault[:2]}, r"has shape \(2,\)")):  # fmt: skip
        with pytest.raises(InputError, match=rf"^initial_fault: {said}"), built.keyed():
            design(kind, **given).start()

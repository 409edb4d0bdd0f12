"""Other errors and inconsistencies in print: symbols, shapes, signs and numbers."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plants.dc_motor import ControlledMotor, DCMotor, SpeedControl
from reobserve_papers.signals.inputs import Signal
from tests import ROOT
from tests.reobserve.synthesis.plants import dc_motor

SYSTEM = dc_motor()


def test_z_of_equation_3_is_not_the_filter_state() -> None:
    """z denotes the state of the dual (22), with six entries, while y has two."""
    y, x = np.array([1.1, 10.0]), np.array([1.0, 10.0])
    assert (SYSTEM.size, len(y)) == (6, 2)
    # With xz instead, (3) equals its own second half.
    xz, fault = np.array([0.3, -0.2]), np.array([0.0, 0.1])
    rate = SYSTEM.Az @ (y - xz)
    second = SYSTEM.Aa[2:] @ [*x, *xz] + SYSTEM.F[2:] @ fault
    assert rate == pytest.approx(second, abs=1e-15)


def test_az_itself_must_not_be_stable() -> None:
    """xz' = Az (y - xz) is stable if -Az is."""
    with pytest.raises(InputError, match=r"^Az: has an eigenvalue of real part -1, must be above"):
        dc_motor(Az=-1.0)
    assert np.linalg.eigvals(dc_motor(Az=1.0).Aa).real.max() < 0


def test_dd_of_equation_4_has_too_few_rows_for_the_augmented_state() -> None:
    assert (len(SYSTEM.Aa), len(SYSTEM.Dd)) == (4, 2)
    above = np.vstack([SYSTEM.Dd, np.zeros((2, 2))])
    assert np.array_equal(above, SYSTEM.Da[:, :2])


def test_fault_called_the_sensor_fault_does_not_affect_the_output() -> None:
    """Section IV calls fa the sensor fault and fs the actuator fault, yet Fs = [1 0]^T."""
    motor = DCMotor(0.01, 0.1, 0.01, 0.01, 1.0, 0.5)
    control = SpeedControl.placed(motor, (-3 + 2.25j, -3 - 2.25j, -12))
    loop = ControlledMotor(motor, control, np.diag([1.0, 2.0]), [[1.0], [0.0]], [[1.0], [0.0]])
    none = Signal(1, ())
    step = Signal.parse("fault", [{"kind": "constant", "axis": 1, "from": 0.5, "size": 0.1}], 1)
    jumps = []
    for faults in ((step, none), (none, step)):
        run = loop.simulate(none, *faults, np.zeros((200, 2)), np.zeros((200, 1)), 5e-3)
        jumps.append((run.after.output - run.before.output)[100, 0])
    assert jumps == pytest.approx([0.0, 0.1], abs=1e-14)


def test_e_is_not_an_input_matrix() -> None:
    """E = B of Section IV: (1) contains no E, and that of Lemma 1 is square."""
    with pytest.raises(InputError, match=r"^E: .*\(2, 1\)"):
        h_infinity_norm(SYSTEM.A, SYSTEM.Fa, np.eye(2), E=SYSTEM.B)
    assert np.array_equal(SYSTEM.Fa, SYSTEM.B)


def test_figure_numbers_are_one_above_those_in_the_text() -> None:
    """The text refers to Figs 3 and 4 for the noise, and to Fig. 1 for the first one without."""
    stated = Parameters.load(ROOT, "eso")
    text = {
        1: ("actuator", False),
        2: ("sensor", False),
        3: ("actuator", True),
        4: ("sensor", True),
    }
    captions = {}
    for number in (2, 3, 4, 5):
        body = stated.section("figures", f"fig{number}")
        noise = stated.section("scenarios", body["scenario"])["noise_power"]
        assert body["source"] == f"Fig. {number}"
        captions[number] = (body["layout"], noise > 0)
    assert all(captions[number] != text[number] for number in (2, 3, 4))
    assert captions == {number + 1: shown for number, shown in text.items()}


def test_printed_input_of_the_motor_has_three_rows() -> None:
    """A of the same equation has two rows; [0; 1/L] is B, since L i' = -Ke w - R i + u."""
    motor, x = DCMotor(2.0, 0.5, 0.1, 0.02, 0.05, 0.3), np.array([1.5, -0.7])
    printed = np.array([[0.0], [1.0], [0.3]])
    with pytest.raises(ValueError, match="broadcast"):
        motor.A @ x + printed @ [1.2]
    assert (motor.A @ x + motor.B @ [1.2])[1] == pytest.approx(
        (-0.02 * 1.5 + 0.05 * 0.7 + 1.2) / 0.3
    )


def test_only_table_is_not_numbered_first() -> None:
    """The text refers to table 1, and the only table is numbered seventh."""
    numerals = {"I": 1, "V": 5, "X": 10}
    heading = [numerals[letter] for letter in "VII"]
    assert sum(heading) == 7, "they fall, so that they add"
    stated = Parameters.load(ROOT, "eso").tree["plant"]
    constants = [body for body in stated.values() if body["source"].startswith("Table, ")]
    assert len(constants) == 6, "all parameters of the motor are of this one"

"""The augmented plant: its blocks, and the conditions for fault reconstruction."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from reobserve.core.errors import InputError
from reobserve.synthesis.extended_state.system import AugmentedSystem
from tests.reobserve.synthesis.plants import dc_motor, random_plant


def test_blocks_of_the_example_agree_with_the_paper() -> None:
    system = dc_motor()
    assert system.size == 6
    np.testing.assert_array_equal(
        system.A_tilde,
        [
            [-10, 1, 0, 0, 0, 0],
            [-0.02, -2, 0, 0, 2, 0],
            [1, 0, -1, 0, 0, 1],
            [0, 1, 0, -1, 0, 0],
            [0, 0, 0, 0, 0, 0],
            [0, 0, 0, 0, 0, 0],
        ],
    )
    np.testing.assert_array_equal(system.C_tilde, [[0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0]])
    np.testing.assert_array_equal(
        system.Bo,
        [
            [1, 0, 0, 0, 0],
            [0, 2, 0, 0, 0],
            [0, 0, 1, 0, 0],
            [0, 0, 0, 0, 0],
            [0, 0, 0, 1, 0],
            [0, 0, 0, 0, 1],
        ],
    )
    np.testing.assert_array_equal(system.Ba, [[0], [2], [0], [0]])


def test_filtered_output_agrees_with_the_augmented_system() -> None:
    """Constant inputs: (1)-(3) and (7) by two matrix exponentials, with a full Az."""
    Az = np.array([[3.0, 1.0], [0.5, 2.0]])
    system = random_plant(5, 3, Az=Az, B=np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]]))
    u, d, w, fa, fs = np.array([0.3, -0.7]), 0.4, -0.2, 0.9, -1.1
    state = expm(_with_input(system.A, system.B @ u + system.Dd[:, 0] * d + system.Fa[:, 0] * fa))
    augmented = expm(
        _with_input(system.Aa, system.Ba @ u + system.Da @ [d, w] + system.F @ [fa, fs])
    )
    np.testing.assert_allclose(augmented[:3, -1], state[:3, -1], atol=1e-14)
    # xz' = Az (y - xz) together with x' of (1), from rest.
    output = system.Dw[:, 0] * w + system.Fs[:, 0] * fs
    drift = np.concatenate([system.B @ u + system.Dd[:, 0] * d + system.Fa[:, 0] * fa, Az @ output])
    both = np.block([[system.A, np.zeros((3, 2))], [Az @ system.C, -Az]])
    np.testing.assert_allclose(
        augmented[:5, -1], expm(_with_input(both, drift))[:5, -1], atol=1e-14
    )
    steady = np.linalg.solve(-system.Aa, system.Ba @ u + system.Da @ [d, w] + system.F @ [fa, fs])
    np.testing.assert_allclose(steady[3:], system.C @ steady[:3] + output, atol=1e-12)


def _with_input(A: Any, drift: Any) -> Any:
    size = len(A)
    return np.vstack([np.hstack([A, drift[:, None]]), np.zeros((1, size + 1))])


@pytest.mark.parametrize("seed", range(6))
def test_conditions_are_equivalent_to_detectability(seed: int) -> None:
    """By the rank of [s I - A~; C~] at every eigenvalue of A~ that does not decay."""
    system = random_plant(seed, 4, 3)
    for pole in np.linalg.eigvals(system.A_tilde):
        if pole.real > -1e-9:
            pencil = np.vstack([pole * np.eye(system.size) - system.A_tilde, system.C_tilde])
            assert np.linalg.matrix_rank(pencil) == system.size


def test_system_may_have_faults_of_one_kind_only() -> None:
    sensor = dc_motor(Fa=np.zeros((2, 0)))
    assert (sensor.faults, sensor.size, sensor.Bo.shape) == (1, 5, (5, 4))
    actuator = dc_motor(Fs=np.zeros((2, 0)), B=np.zeros((2, 0)))
    np.testing.assert_array_equal(actuator.F, [[0], [2], [0], [0]])
    assert actuator.Ba.shape == (4, 0)


def test_stable_unobservable_mode_is_allowed() -> None:
    system = dc_motor(A=[[-3.0, 0.0], [0.0, -2.0]], C=[[0.0, 1.0], [0.0, 2.0]])
    assert system.outputs == 2


INTEGRATOR = [[0.0, 1.0], [0.0, -1.0]]
REFUSED = {
    "C has 1 row: fewer outputs": {"C": [[1.0, 0.0]], "Dw": [[1.0]], "Fs": [[1.0]]},
    "Fa: and Fs have no column": {"Fa": np.zeros((2, 0)), "Fs": np.zeros((2, 0))},
    r"Fa: has rank 0, must have 1": {"Fa": [[0.0], [0.0]]},
    r"Fs: has rank 1, must have 2": {"Fa": np.zeros((2, 0)), "Fs": [[1.0, 2.0], [2.0, 4.0]]},
    "eigenvalue 1, which does not decay: .* rank 1 of 2, so .* not detectable": {
        "A": [[1.0, 0.0], [0.0, -1.0]],
        "C": [[0.0, 1.0], [0.0, 2.0]],
    },
    r"a zero at the origin: .* rank 3 of 4, so a constant fault": {"A": INTEGRATOR},
    r"Az: has an eigenvalue of real part -1, must be above zero": {"Az": -1.0},
    r"Az: has shape \(3,\)": {"Az": [1.0, 2.0, 3.0]},
    r"A: has shape \(1, 2\), must be square": {"A": [[1.0, 2.0]]},
    r"C: has shape \(1, 3\), must be \(p, 2\) as A is \(2, 2\)": {"C": [[1.0, 0.0, 0.0]]},
    r"B: has shape \(1, 1\), must have 2 rows as A is \(2, 2\)": {"B": [[1.0]]},
    r"Dd: has shape \(2,\), must have 2 rows as A": {"Dd": [1.0, 2.0]},
    r"Fs: has shape \(3, 1\), must have 2 rows as C is \(2, 2\)": {"Fs": [[1.0]] * 3},
    r"Dw: has shape \(1, 2\), must have 2 rows as C is \(2, 2\)": {"Dw": [[1.0, 0.0]]},
    "A: .* not finite": {"A": [[np.nan, 0.0], [0.0, 1.0]]},
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_non_reconstructible_fault_is_named(sentence: str) -> None:
    with pytest.raises(InputError, match=sentence.replace("C has", "C: has")):
        dc_motor(**REFUSED[sentence])


def test_condition_of_the_paper_is_not_sufficient() -> None:
    """y = [1 0] x makes (A, C) observable, yet two faults cannot be distinguished from it."""
    motor, C = dc_motor(), np.array([[1.0, 0.0]])
    assert np.linalg.matrix_rank(np.vstack([C, C @ motor.A])) == 2
    faults = np.hstack([motor.Aa[:3, :3], [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]]])
    faults[2] = [1.0, 0.0, -1.0, 0.0, 1.0]
    A_tilde = np.vstack([faults, np.zeros((2, 5))])
    observability = [np.eye(5)[2] @ np.linalg.matrix_power(A_tilde, k) for k in range(5)]
    assert np.linalg.matrix_rank(np.array(observability)) == 4
    with pytest.raises(InputError, match="fewer outputs than faults, of which Fa has 1 and Fs 1"):
        dc_motor(C=C, Dw=[[1.0]], Fs=[[1.0]])


def test_ranks_do_not_depend_on_units() -> None:
    """The same motor with speeds in 1e-6 rad/s, currents in MA and a fault of 1e9 units."""
    scale = np.diag([1e6, 1e-6])
    motor = dc_motor()
    AugmentedSystem(
        scale @ motor.A @ np.linalg.inv(scale),
        scale @ motor.B,
        motor.C @ np.linalg.inv(scale),
        scale @ motor.Dd,
        motor.Dw,
        1e9 * scale @ motor.Fa,
        1e-9 * motor.Fs,
    )


def test_ranks_do_not_depend_on_units_for_any_signs() -> None:
    """Two sensor faults in units 1e15 apart, both of which lower the outputs."""
    none = np.zeros((2, 0))
    system = dc_motor(Fa=none, Fs=[[-1.0, 0.0], [0.0, -1e-15]])
    assert system.faults == 2

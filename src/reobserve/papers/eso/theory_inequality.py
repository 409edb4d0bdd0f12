"""The inequality (19) against Lemma 1, from which the paper derives it, and what the lemma says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.random_streams import random_stream
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains


@part
def agreement(system: AugmentedSystem, cases: int) -> Iterator[Metric]:
    """How far (19) is from (18), and recovered gains from those that P and Y were made of.

    Indriawati, Agustinah & Jazidie, (18) and (22) to (24).

    For ``cases`` random P and gains, relative to the largest entry; the worst case counts.
    """
    sides, recovered = zip(*(_case(system, str(case)) for case in range(cases)), strict=True)
    yield Metric("inequality_19", "lemma_difference", max(sides), "1")
    yield Metric("inequality_19", "gain_difference", max(recovered), "1")


def _case(system: AugmentedSystem, case: str) -> tuple[float, float]:
    stream, size, outputs = random_stream(0, "eso", "theory", case), system.size, system.outputs
    root, P2, P3 = stream.standard_normal((3, size, size))
    gains = Gains(*stream.standard_normal((2, size, outputs)))
    gamma = float(stream.uniform(1.0, 3.0))
    nothing = np.zeros((outputs, size))
    variables = PdPiVariables(root @ root.T, P2, P3, nothing, nothing).with_gains(gains)
    lemma = _lemma(system, gains, variables, gamma)
    side: Any = np.block(variables.blocks(system, gamma))
    found = variables.gains()
    return _difference(side, lemma), max(
        _difference(found.L, gains.L), _difference(found.Ld, gains.Ld)
    )


def _lemma(system: AugmentedSystem, gains: Gains, variables: PdPiVariables, gamma: float) -> Any:
    """The left side of (18) for the dual (24), whose input has as many entries as its state."""
    Ao, Eo = error_system(system, gains)
    one, zero = np.eye(system.size), np.zeros((system.size, system.size))
    A = np.block([[zero, one], [Ao.T, -Eo.T]])
    B = np.vstack([zero, one])
    C = np.hstack([system.Bo.T, np.zeros(system.Bo.T.shape)])
    P = np.block([[variables.P1, zero], [variables.P2, variables.P3]])
    none = np.zeros((B.shape[1], len(C)))
    return np.block(
        [
            [A @ P + P.T @ A.T, B, P.T @ C.T],
            [B.T, -gamma * one, none],
            [C @ P, none.T, -gamma * np.eye(len(C))],
        ]
    )


def _difference(found: Any, expected: Any) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def margin_above_norm(system: AugmentedSystem, gains: Gains, norm: float, excess: float) -> float:
    """How far below zero (19) is for given gains, at a gamma just above their norm; 0 if nowhere.

    Indriawati, Agustinah & Jazidie, Lemma 1.

    Lemma 1 promises a P for every gamma above the norm. With S = Eo^T, M = Ao^T and

        S^-1 M P1 + P1 M^T S^-T + (P1 Bo Bo^T P1 + S^-1 S^-T) / gamma < 0

    it is P2 = S^-1 M P1 and P3 = S^-1 / gamma; P1 solves the Riccati equation with a little more
    than S^-1 S^-T in place of it. P1 must be positive definite as well.

    Parameters
    ----------
    system, gains, norm
        A stable observer with its H-infinity norm, at least one.
    excess
        Of gamma over the norm, relative.

    Raises
    ------
    InputError
        If the excess is not above zero.
    """
    from scipy.linalg import solve_continuous_are

    if not excess > 0:
        raise InputError("excess", f"{excess:g} must be greater than zero")
    gamma = (1.0 + excess) * norm
    Ao, Eo = error_system(system, gains)
    inverse = np.linalg.inv(Eo)
    # The square root of the factor scales the norm, and stays below gamma.
    source = (1.0 + excess) * inverse.T @ inverse / gamma
    try:
        P1 = solve_continuous_are(
            Ao @ inverse, system.Bo, source, -gamma * np.eye(system.Bo.shape[1])
        )
    except np.linalg.LinAlgError:
        return 0.0
    P1 = (P1 + P1.T) / 2.0
    empty = np.zeros((system.outputs, system.size))
    variables = PdPiVariables(P1, (Ao @ inverse).T @ P1, inverse.T / gamma, empty, empty)
    side: Any = np.block(variables.with_gains(gains).blocks(system, gamma))
    largest = max(np.linalg.eigvalsh(side)[-1], -np.linalg.eigvalsh(P1)[0])
    return max(0.0, -float(largest))

"""What linear theory predicts for the error of an observer under a stated fault."""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.papers.ilo import keys
from reobserve.papers.ilo.body import known_body
from reobserve.replication.parameters.job import Job
from reobserve.synthesis.ilo_accuracy import pi_error_transfer, predicted_rms_error
from reobserve.synthesis.ilo_error_system import LearningLaw


def predicted_error(job: Job, observer: keys.Observer, axis: int) -> float | None:
    """RMS of e on ``axis`` [N m] in steady state, once every term of the fault is on.

    None where the fault is no sum of constants and sines of distinct frequencies, or where the
    observer is told a wrong inertia, for which the gyroscopic and control torques matter, too.
    """
    if observer.inertia_factor != 1.0 or any(
        term["kind"] not in ("constant", "sine") or "until" in term for term in job.scenario.fault
    ):
        return None
    waves: dict[float, np.ndarray[Any, np.dtype[np.complex128]]] = {}
    for term in job.scenario.fault:
        constant = term["kind"] == "constant"
        frequency = 0.0 if constant else float(term["frequency"])
        size = term["size"] if constant else term["amplitude"] * np.exp(1j * term.get("phase", 0.0))
        wave = waves.setdefault(frequency, np.zeros(3, dtype=np.complex128))
        wave[term["axis"] - 1] += size
    omega = np.array(list(waves))
    torque = np.array(list(waves.values()))
    body = known_body(job.plant)
    common = (body.inertia, observer.damping, body.fault_matrix)
    if observer.algorithm == "adaptive":
        transfer = pi_error_transfer(
            omega, *common, observer.integral_gain, observer.proportional_gain
        )
        error = np.einsum("kij,kj->ki", transfer, torque)[:, axis]
        return float(np.sqrt(np.sum(np.abs(error) ** 2 * np.where(omega == 0, 1.0, 0.5))))
    rms = predicted_rms_error(
        np.where(omega[:, None] == 0, torque.real, np.abs(torque)),
        omega,
        LearningLaw(*common, observer.K1, observer.K2, observer.update_interval),
        phases=np.angle(torque),
        reading="sampled" if observer.algorithm == "sampled_ilo" else "continuous",
    )
    return float(rms[axis])

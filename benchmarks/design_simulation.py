"""Simulation of an extended state observer against scipy.signal and python-control."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.design_problem import PERIOD, linear_system, plant, record
from benchmarks.report import Check, Row, Section
from benchmarks.timing import medians
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.synthesis.extended_state import pd_pi

Array = NDArray[np.float64]
Peer = Callable[[], Array]

_SAMPLES, _FEW = 1_000_000, 20_000
_TIMES_CONTROL = 50.0  # the aim
_TOLERANCE = 1e-9


def add(section: Section, quick: bool) -> None:
    """A PD/PI observer of six states over held and over straight measurements."""
    repeats = 3 if quick else 9
    system = plant(2)
    gains = pd_pi.design(system).gains
    output, control = record(_SAMPLES)
    matrices = linear_system(system, gains)
    observer = ExtendedStateObserver(system, gains=gains, sampling_period=PERIOD)
    methods = {"zero": _held, "first": _straight}
    for hold, peers_of in methods.items():
        before = (_last(output), _last(control)) if hold == "zero" else (output, control)
        few = before[0][:_FEW], before[1][:_FEW]
        found = observer.run(output[:_FEW], control[:_FEW], before=few)
        ours = np.hstack([found["state"], found["actuator_fault"], found["sensor_fault"]])
        peers = peers_of(matrices, np.hstack([output[:_FEW], control[:_FEW]]))
        label = f"{_SAMPLES:,} samples, {hold}-order hold"
        agreeing = {}
        for name, peer in peers.items():
            difference = float(np.max(np.abs(peer() - ours)))
            check = Check(f"{label}, {name}, first {_FEW:,} estimates", difference, _TOLERANCE)
            section.checks.append(check)
            if check.agrees:
                agreeing[name] = peer
            else:
                section.notes.append(f"{label}: {name} computes something else, is not measured")
        jobs: dict[str, Callable[[], object]] = {
            "run": partial(observer.run, output, control, before=before),
            **agreeing,
        }
        times = medians(jobs, repeats)
        each = {name: time / (_SAMPLES if name == "run" else _FEW) for name, time in times.items()}
        section.rows += [
            Row(
                f"{label}: run, a sample",
                each["run"],
                name,
                each[name],
                aim=_TIMES_CONTROL if name == "forced_response" else None,
            )
            for name in agreeing
        ]
    section.notes.append(
        f"simulations: median of {repeats} rounds, peers in turns, of {system.size} states and "
        f"their filter; the peers ran {_FEW:,} of the samples, their systems made before"
    )


def _last(samples: Array) -> Array:
    """Limits from the left of what is held from sample to sample."""
    return np.concatenate([samples[:1], samples[:-1]])


def _held(matrices: tuple[Array, ...], inputs: Array) -> dict[str, Peer]:
    import control
    from scipy import signal

    sampled = signal.cont2discrete(matrices, PERIOD, "zoh")
    model = control.ss(*sampled)
    return {
        "dlsim": lambda: np.asarray(signal.dlsim(sampled, inputs)[1]),
        "forced_response": lambda: _response(model, inputs),
    }


def _straight(matrices: tuple[Array, ...], inputs: Array) -> dict[str, Peer]:
    import control
    from scipy import signal

    model = control.ss(*matrices)
    return {
        "lsim": lambda: np.asarray(signal.lsim(matrices, inputs, _time(inputs))[1]),
        "forced_response": lambda: _response(model, inputs),
    }


def _response(model: object, inputs: Array) -> Array:
    import control

    return np.asarray(control.forced_response(model, _time(inputs), inputs.T).outputs.T)


def _time(inputs: Array) -> NDArray[Any]:
    return PERIOD * np.arange(len(inputs))

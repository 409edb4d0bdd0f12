"""The extended state observer: one matrix times what is known, a step."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.program import Program
from reobserve.codegen.programs.sampling import RowBuffer
from reobserve.observers.extended_state import EsoState, ExtendedStateObserver


def extended_state(observer: ExtendedStateObserver, state: EsoState | None) -> Program:
    """The exact discretisation of the observer, for y in straight lines and u held."""
    system = observer.system
    begun = observer.init() if state is None else state
    p, m, size = system.outputs, observer.inputs, system.size
    program = Program("Extended state observer", p, m)
    weights = observer._weights.T  # of the state, then y and u at start, end and middle
    start, end, middle = (
        weights[:, first : first + p + m]
        for first in (p + size + place * (p + m) for place in range(3))
    )
    # A straight line has its mean in the middle, and what is held its value.
    Phi = program.constant("Phi", weights[:, : p + size])
    before = program.constant("Gamma_0", start[:, :p] + 0.5 * middle[:, :p])
    after = program.constant("Gamma_1", end[:, :p] + 0.5 * middle[:, :p])
    rows = RowBuffer(program, begun)
    # z: filter of the measurements, states, filtered measurements, faults of actuators and sensors
    z = program.remember("z", np.concatenate([begun.filtered, begun.estimate]))
    value = Phi @ z + before @ rows.y_before + after @ program.y
    if rows.u_before is not None:
        held = start[:, p:] + end[:, p:] + middle[:, p:]
        value = value + program.constant("Gamma_u", held) @ rows.u_before
    with rows.moves():
        program.let(z, value)
    n, r = system.states, system.Fa.shape[1]
    ends = np.cumsum([p, n, p, r, system.Fs.shape[1]])
    spans = {"state": (ends[0], ends[1]), "actuator_fault": (ends[2], ends[3])}
    spans["sensor_fault"] = (ends[3], ends[4])
    for name, (first, last) in spans.items():
        if last > first:
            program.estimate_part(name, z, int(first), int(last))
    rows.keep()
    return program

"""The rigid body and gains of the parameter file, without compiled observers, for metrics."""

from __future__ import annotations

from reobserve.core.errors import located
from reobserve.core.matrices import as_matrix
from reobserve.core.validation import MatrixValue
from reobserve.systems.rigid_body import RigidBody
from reobserve_papers.papers.ilo import keys


def known_body(plant: keys.Plant, factor: float = 1.0) -> RigidBody:
    """The rigid body of an observer's model, with its inertia multiplied by ``factor``."""
    with located("plant"):
        body = RigidBody(plant.inertia, plant.input_matrix, plant.fault_matrix)
    return RigidBody(factor * body.inertia, body.input_matrix, body.fault_matrix)


def on_axis(gain: MatrixValue, axis: int) -> float:
    """The entry of a gain on the diagonal."""
    return float(as_matrix("gain", gain, 3)[axis, axis])

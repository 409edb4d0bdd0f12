"""The rigid body of the parameter file, without the compiled observers, for the metrics."""

from __future__ import annotations

from reobserve.core.errors import located
from reobserve.systems.rigid_body import RigidBody
from reobserve_papers.papers.ilo import keys


def known_body(plant: keys.Plant, factor: float = 1.0) -> RigidBody:
    """The rigid body of an observer's model, with its inertia multiplied by ``factor``."""
    with located("plant"):
        body = RigidBody(plant.inertia, plant.input_matrix, plant.fault_matrix)
    return RigidBody(factor * body.inertia, body.input_matrix, body.fault_matrix)

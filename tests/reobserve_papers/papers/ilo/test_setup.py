"""The time grid of observers on that of the plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.observers.ilo import SampledILO
from reobserve.systems.rigid_body import RigidBody
from reobserve_papers.papers.ilo.setup import stride
from reobserve_papers.parameters.job import read_parameters
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT


@pytest.mark.parametrize(
    ("period", "samples"),
    [(0.002, 1), (0.004, 2), (0.02, 10), (0.001, 0), (0.003, 0), (1e-6, 0)],
)
def test_half_period_must_be_a_whole_number_of_samples(period: float, samples: int) -> None:
    observer = SampledILO(
        RigidBody(inertia=np.eye(3)),
        K1=1.0,
        K2=0.1,
        observer_gain=1.0,
        update_interval=period,
        sampling_period=period,
    )
    plant = replace(read_parameters(Parameters.load(ROOT, "ilo")).plant, step=0.001)
    if samples:
        assert stride(plant, observer) == samples
    else:
        with pytest.raises(InputError, match=r"^sampling_period: .* even multiple of plant.step"):
            stride(plant, observer)

"""Derivatives of the input by the differentiator, at every sampling that the paper leaves open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.observer_inputs import inputs
from reobserve_papers.parameters.job import read_job
from reobserve_papers.signals.series import Channel, Series
from tests.reobserve_papers.papers import fixed_parameters
from tests.reobserve_papers.pipeline.conftest import PARAMETER_FILES

CHOICES = dict(PARAMETER_FILES["delay"].entries())["observers.order2_noise.sampling"]["range"]
STEP, STEPS = 2.5e-3, 2000


@pytest.mark.parametrize("sampling", CHOICES["choices"])
def test_rates_of_a_parabola_agree_between_samples_of_the_differentiator(sampling: float) -> None:
    """Its second derivative is constant, so that extrapolating u' adds no error."""
    time = STEP * np.arange(STEPS + 1)
    rates = np.column_stack([0.04 * time - 0.1, np.full(len(time), 0.04)])
    channels = {
        "input": Channel(0.2 - 0.1 * time + 0.02 * time**2, "N m"),
        "input_derivatives": Channel(rates, "N m/s"),
    }
    plant = Series(time, channels, {})
    settings = fixed_parameters("delay").settings("observe", "order2_noise")
    job = read_job(keys.Parameters, settings)
    exact, zero = (
        replace(job.observer, sampling=sampling, initial_derivatives=start)
        for start in ("exact", "zero")
    )
    found, before = inputs(job, exact, plant)
    assert np.array_equal(found[:, 0], plant["input"])
    assert np.array_equal(found, before)
    # Without noise the errors are of the order of L T^2 and L T.
    assert found[:, 1] == pytest.approx(rates[:, 0], abs=4 * job.observer.L * sampling**2)
    assert found[:, 2] == pytest.approx(rates[:, 1], abs=4 * job.observer.L * sampling)
    assert np.array_equal(inputs(job, zero, plant)[0][0], [0.2, 0.0, 0.0])

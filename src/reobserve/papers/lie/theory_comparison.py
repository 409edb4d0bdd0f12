"""Section 6 in numbers: an order in both forms, and the constant gain, over initial states.

The paper tells of its experience with orders, readings of the gain and runs that it does not list;
each of them is a value of the ledger here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from reobserve.core.errors import located
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_transformed import TransformedObserver
from reobserve.papers.lie import keys
from reobserve.papers.lie.comparison import axis, records
from reobserve.papers.lie.scoring import ratios, share_better
from reobserve.papers.lie.setup import build_system, stored_form
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import Job, named
from reobserve.signals.grid import multiple


@part
def measure(job: Job, design: Mapping[str, Any]) -> Iterator[Metric]:
    """Shares of initial states, and by how much an order improves on the constant gain.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    """
    theory, body = job.theory, named(job.observers, "constant", keys.Identity)
    form = stored_form(job.plant, job.designs["linear"], design)
    step = theory.compared_period
    steps = multiple("compared_duration", theory.compared_duration, step, "compared_period")
    with located("compared_order"):
        observers = {
            "constant": IdentityObserver(form, 0, sampling_period=step),
            "identity": IdentityObserver(
                form, theory.compared_order, theory.compared_gain, sampling_period=step
            ),
            "transformed": TransformedObserver(form, theory.compared_order, sampling_period=step),
        }
    plant = PolynomialPlant(build_system(job.plant))
    estimate = np.array(body.initial_estimate)
    coordinates = axis(theory.compared_half_width, theory.compared_points)
    runs = list(records(plant, coordinates, estimate, steps, step))
    found = {
        name: [run.outcome(observer, estimate, theory.compared_band) for run in runs]
        for name, observer in observers.items()
    }
    for name, outcomes in found.items():
        settled = float(np.mean([one.settled for one in outcomes]))
        yield Metric(name, "share_settled", settled, "1")
        latest = float(np.max([one.settling_time for one in outcomes]))
        yield Metric(name, "latest_settling_time", latest, "s")
    ise, reference = ([one.ise for one in found[name]] for name in ("identity", "constant"))
    yield Metric("identity", "share_better", share_better(ise, reference), "1")
    most = 1.0 - float(np.min(ratios(ise, reference)))
    yield Metric("identity", "largest_improvement", max(0.0, most), "1")

"""Stage theory: numbers on the proofs and remarks of the paper."""

from __future__ import annotations

from typing import Any

from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.papers.delay import (
    keys,
    theory_conditions,
    theory_derivatives,
    theory_gains,
    theory_orders,
    theory_runs,
    theory_state_gain,
)


def measure(job: keys.Job, designs: dict[str, Any]) -> list[Metric]:
    """The numbers of the theory (see `MEANINGS` of `metrics`)."""
    ramp, sine = (theory_runs.record(job, terms) for terms in (job.theory.ramp, job.theory.sine))
    return [
        *theory_conditions.measure(job, ramp, sine),
        *theory_gains.measure(job, ramp),
        *theory_derivatives.measure(job, sine),
        *theory_runs.measure(job, ramp, sine),
        *theory_orders.measure(job, sine),
        *theory_state_gain.measure(job, ramp),
    ]

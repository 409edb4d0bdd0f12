"""What of the ledger takes building to see: errors show before a long build."""

from __future__ import annotations

from reobserve.ledger.check import Checks
from reobserve.papers.ilo import keys, plant
from reobserve.papers.ilo.setup import build_observer
from reobserve.papers.ilo.theory_runs import NEEDED
from reobserve.timeseries.grid import noise_hold

_MATCHED = {"continuous": keys.Continuous, "adaptive": keys.Adaptive}

CHECKS = Checks(
    build={
        "plant": lambda job: noise_hold(job.plant),
        "scenario": plant.build,
        "observer": lambda job: build_observer(job.plant, job.observer),
    },
    about={
        keys.Matching: _MATCHED,
        keys.MatchingFigure: {**_MATCHED, "matched": keys.Adaptive},
        keys.Theory: NEEDED,
    },
)

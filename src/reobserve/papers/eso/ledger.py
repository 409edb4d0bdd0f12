"""What of the ledger takes building to see: errors show before a long build."""

from __future__ import annotations

from reobserve.ledger.check import Checks
from reobserve.papers.eso import plant
from reobserve.papers.eso.scoring import check_rules
from reobserve.papers.eso.setup import augmented

# Designs are not computed: whether a solver finds one shows in their stage.
CHECKS = Checks(
    build={
        # What can be wrong with the plant is so with any filter.
        "plant": lambda job: augmented(job.plant, 1.0),
        "scenario": plant.build,
        "design": lambda job: augmented(job.plant, job.design.filter_rate),
        "metrics": lambda job: check_rules(job.metrics, job.plant),
    }
)

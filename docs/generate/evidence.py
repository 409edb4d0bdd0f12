"""The evidence on a paper in the repository: parameters, claims, errata, golden numbers.

A claim's numbers are the golden ones, its samples those of `config/samples`, its verdict is the
accepted one; that the first two give the third is checked here, so that no page says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import takewhile
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.core.files import read_table
from reobserve_papers.claims.checks import THEORY
from reobserve_papers.claims.claims_table import HEADER, row
from reobserve_papers.claims.decider import Decider
from reobserve_papers.claims.entries import Result
from reobserve_papers.claims.errata import Erratum, read_errata
from reobserve_papers.claims.inquiry import read_robustness
from reobserve_papers.claims.registry import Claim as Registered
from reobserve_papers.claims.registry import Registry, read_claims, read_registry
from reobserve_papers.claims.title import MAIN, TITLE, Row, Title, title_from
from reobserve_papers.golden.number_files import read_metrics
from reobserve_papers.metrics.metrics import Metric, lookup
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.reported_claims import ReportedClaim, claim_of_row

GOLDEN = "tests/golden"


@dataclass(frozen=True)
class Paper:
    """What git holds of a paper."""

    root: Path
    name: str
    accepted: Mapping[str, Mapping[str, str]]
    seed: int = 0

    @cached_property
    def parameters(self) -> Parameters:
        """Its parameters."""
        return Parameters.load(self.root, self.name, seed=self.seed)

    @cached_property
    def result(self) -> Result | None:
        """The result in one sentence."""
        return read_claims(self.root, self.name).result

    @property
    def stated(self) -> Title:
        """The title with the main claims, without dissent, which takes no alternatives."""
        rows = takewhile(lambda row: row["kind"] in (TITLE, MAIN), self.decider.rows())
        return title_from(list(rows))

    @property
    def about(self) -> Mapping[str, Any]:
        """Title, authors, and year and DOI if there are any."""
        found: Mapping[str, Any] = self.parameters.tree["about"]
        return found

    @cached_property
    def registry(self) -> Registry:
        """Its claims as they are registered."""
        return read_registry(self.root, self.parameters)

    @cached_property
    def numbers(self) -> dict[str, list[Metric]]:
        """The golden numbers by figure, and of the theory."""
        names = [
            *self.parameters.tree["figures"],
            *([THEORY] if "theory" in self.parameters.tree else []),
        ]
        return {name: read_metrics(self.root, self.name, name) for name in names}

    @cached_property
    def claims(self) -> tuple[ReportedClaim, ...]:
        """The claims with all that is known of each.

        Raises
        ------
        InputError
            If a claim was not accepted, or numbers and samples give another verdict.
        """
        return tuple(map(self._claim, self.registry.claims))

    @cached_property
    def decider(self) -> Decider:
        """Whoever decides the claims, from golden numbers and cached samples."""
        numbers = {name: lookup(found) for name, found in self.numbers.items()}
        path = self.root / samples_path(self.name)
        samples = read_robustness(path, self.parameters, self.registry.claims)
        return Decider(self.registry, numbers, samples, self.seed)

    @cached_property
    def alternatives(self) -> list[Row]:
        """What each alternative changes."""
        return list(self.decider.rows())

    @cached_property
    def title(self) -> Title:
        """The title of the replication."""
        return title_from(self.alternatives)

    def _claim(self, claim: Registered) -> ReportedClaim:
        place = f"claims.{self.name}.{claim.name}"
        if claim.name not in self.accepted:
            raise InputError(place, "has no accepted verdict: make accept keeps it")
        accepted = self.accepted[claim.name]["verdict"]
        decider = self.decider
        drawn = decider.samples.get(claim.name)
        found = row(claim, decider, decider.numbers, drawn)
        cells = {key: str(value) for key, value in found.items()}
        if cells["verdict"] != accepted:
            problem = (
                f"{cells['verdict']} by golden numbers and cached samples, accepted as {accepted}"
            )
            raise InputError(place, f"{problem}: make accept keeps what is so")
        return claim_of_row({**dict.fromkeys(HEADER, ""), **cells})

    @cached_property
    def errata(self) -> tuple[Erratum, ...]:
        """Its errata."""
        return read_errata(self.root, self.name)


@cache
def papers(root: Path) -> list[Paper]:
    """All papers of the project, in alphabetic order."""
    rows = read_table(root / GOLDEN / "claims.csv", ("paper", "claim", "verdict", "holds"))
    seed = read_yaml(root / "config/config.yaml")["seed"]
    return [
        Paper(root, name, {row["claim"]: row for row in rows if row["paper"] == name}, seed)
        for name in known_papers(root)
    ]

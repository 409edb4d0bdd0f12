"""Claims with their verdicts, as the build computed them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from reobserve_papers.claims.verdict_rules import BROKEN, VERDICTS
from reobserve_papers.report.report_gaps import Gap

# The sign before a verdict, in the report and on the site: none depends on its colour.
SIGNS = dict(zip((*VERDICTS, BROKEN), "●◆◐✕?–△", strict=True))

_DRAWN = ("samples", "held", "void", "share", "low", "high")


@dataclass(frozen=True)
class ReportedRobustness:
    """The share of settings in which a claim holds, of those that the paper leaves open.

    ``share`` of the samples held the claim, with its 95 % interval ``low`` to ``high``; of the
    others some ``tied`` and in some the claim was ``opposed``. ``whole`` says that the samples are
    all settings, counted; beside them ``void`` ones are no case. ``null`` is the share of the
    baseline.
    """

    samples: int
    held: int
    tied: int
    opposed: int
    share: float
    low: float
    high: float
    whole: bool
    null: float | None
    void: int
    lost: int
    cached: int

    @property
    def no_better(self) -> str:
        """The words for a claim that its baseline meets as often or more often."""
        return "no better than the baseline" if self.null and self.null >= self.share else ""


@dataclass(frozen=True)
class ReportedClaim:
    """Claim of a paper, and what was found."""

    name: str
    promised: str
    quantifier: str
    place: str
    statement: str
    verdict: str
    measured: tuple[str, ...]
    why: str
    threshold: str
    margin: str
    figures: tuple[str, ...]
    depends_on: tuple[str, ...]
    choice: str
    separation: str
    setting: str
    robustness: ReportedRobustness | None
    problem: Gap | None

    @property
    def is_main(self) -> bool:
        """True if the title of the replication depends on it."""
        return bool(self.promised)


def claim_of_row(
    row: Mapping[str, str], cached: int = 0, problem: Gap | None = None
) -> ReportedClaim:
    """Return a claim, from its row of the table with all cells as text.

    ``cached`` is how many of its samples were cached.
    """
    texts = {
        key: row[key]
        for key in (
            "promised",
            "quantifier",
            "place",
            "statement",
            "verdict",
            "why",
            "threshold",
            "margin",
            "choice",
            "separation",
            "setting",
        )
    }
    return ReportedClaim(
        name=row["claim"],
        # Check by check: each begins with the figure or the theory it names.
        measured=tuple(filter(None, re.split(r"; (?=(?:fig\w+|theory) )", row["measured"]))),
        figures=tuple(row["figures"].split()),
        depends_on=tuple(row["depends_on"].split()),
        robustness=_robustness(row, cached),
        problem=problem,
        **texts,
    )


def _robustness(row: Mapping[str, str], cached: int) -> ReportedRobustness | None:
    if not all(row[key] for key in _DRAWN) or int(row["samples"]) == 0:
        return None
    counted, held, tied, opposed = (int(row[key]) for key in ("samples", "held", "tied", "opposed"))
    return ReportedRobustness(
        samples=counted,
        held=held,
        tied=tied,
        opposed=opposed,
        share=float(row["share"]),
        low=float(row["low"]),
        high=float(row["high"]),
        whole=row["low"] == row["high"],
        null=float(row["null"]) if row["null"] else None,
        void=int(row["void"]),
        lost=counted - held - tied - opposed,
        cached=cached,
    )

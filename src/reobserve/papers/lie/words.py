"""Settings of the ledger as drawings and captions write them."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from reobserve.replication.parameters.job import Job

_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def starts(job: Job) -> str:
    """Where the plant starts, and the estimate of the first observer."""
    first = next(iter(job.observers.values()))
    return f"x(0) = {pair(job.scenario.initial_state)}, x̂(0) = {pair(first.initial_estimate)}"


def vector(injection: Any) -> str:
    """An injection of one output, as a row of polynomials: (−2 y + ⅓ y³, −4 y)."""
    rows: dict[int, list[str]] = {}
    for term in injection:
        (power,) = term["powers"]
        rows.setdefault(term["component"], []).append(_term(term["coefficient"], power))
    return "(" + ", ".join(_sum(rows[component]) for component in sorted(rows)) + ")"


def _term(coefficient: Any, power: int) -> str:
    fraction = Fraction(coefficient).limit_denominator(1000)
    number = f"{float(coefficient):g}"
    if abs(float(fraction) - float(coefficient)) < 1e-12 and len(number) > 5:
        number = str(fraction)
    return f"{number} y{str(power).translate(_RAISED) if power > 1 else ''}".replace("-", "−")


def _sum(terms: list[str]) -> str:
    return " + ".join(terms).replace("+ −", "− ")


def pair(values: Any) -> str:
    """A state: (2, 0.5)."""
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"

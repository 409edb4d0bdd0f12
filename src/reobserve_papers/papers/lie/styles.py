"""One colour and one dash for each observer and each kind of gain, and settings as text.

Fig. 1 of the paper names its dashes: the constant gain solid, order 4 long and short, the nonlinear
injection long.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from reobserve_papers.papers.lie import keys
from reobserve_papers.plotting.figures import Style

SOLID, LONG_SHORT, LONG = "-", (0, (7, 1.6, 2.5, 1.6)), (0, (9, 3))

SERIES = Style("#c4500a", LONG_SHORT, 1.2, "s")
JACOBIAN = Style("#7a5195", (0, (4, 1.5)), 1.2, "D")
COMPOSED = Style("#5b8c2a", (0, (1.5, 1.2)), 1.3, "v")
TRANSFORMED = Style("#8a6d3b", (0, (5, 1.5, 1, 1.5, 1, 1.5)), 1.2, "P")

OBSERVERS = {
    "constant": Style("#1a1a1a", SOLID, 1.0, "o"),
    "order4": SERIES,
    "injection": Style("#2a7fc1", LONG, 1.3, "^"),
    "jacobian4": JACOBIAN,
    "composed4": COMPOSED,
    "transformed4": TRANSFORMED,
    "cubic4": Style("#b0305c", (0, (1, 0.8)), 2.0, "*"),
}

EDGE = Style("#00796b", (0, (5, 1.5)), 1.2, "s")  # of a domain, and of curves without an observer

# Over orders: kinds of gain of the identity form. Over initial states: both forms.
GAINS = {
    "series": (SERIES, "series of L"),
    "jacobian": (JACOBIAN, "(∂S/∂x)⁻¹"),
    "composed": (COMPOSED, "∂T/∂z at S(x)"),
}
FORMS = {
    "series": (SERIES, "identity form, series of L"),
    "jacobian": (JACOBIAN, "identity form, (∂S/∂x)⁻¹"),
    "transformed": (TRANSFORMED, "transformed form"),
}

# For added observers, in turn.
OTHERS = (Style("0.45", "-", 1.1, "x"), Style("0.6", (0, (2, 2)), 1.1, "+"))


def style_of(observer: str, index: int = 0) -> Style:
    """The style of an observer, or by its ``index`` if it has none of its own."""
    return OBSERVERS.get(observer, OTHERS[index % len(OTHERS)])


_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def starts(job: keys.Job) -> str:
    """The initial state of the plant, and the initial estimate of the first observer."""
    first = next(iter(job.observers.values()))
    return f"x(0) = {pair(job.scenario.initial_state)}, x̂(0) = {pair(first.initial_estimate)}"


def vector(injection: Any) -> str:
    """An injection of one output, as a row of polynomials: (−2 y + ⅓ y³, −4 y)."""
    rows: dict[int, list[str]] = {}
    for term in injection:
        (power,) = term["powers"]
        rows.setdefault(term["component"], []).append(_term(term["coefficient"], power))
    sums = (" + ".join(rows[component]).replace("+ −", "− ") for component in sorted(rows))
    return f"({', '.join(sums)})"


def _term(coefficient: Any, power: int) -> str:
    fraction = Fraction(coefficient).limit_denominator(1000)
    number = f"{float(coefficient):g}"
    if abs(float(fraction) - float(coefficient)) < 1e-12 and len(number) > 5:
        number = str(fraction)
    return f"{number} y{str(power).translate(_RAISED) if power > 1 else ''}".replace("-", "−")


def pair(values: Any) -> str:
    """A state: (2, 0.5)."""
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"

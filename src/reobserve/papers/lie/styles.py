"""One colour and one dash for each observer and each reading of the gain, in all figures.

Fig. 1 of the paper names its dashes: the constant gain solid, order 4 long and short, the nonlinear
injection long.
"""

from __future__ import annotations

from reobserve.plotting.figures import Style

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
    "cubic4": Style("#b0305c", (0, (3, 1, 1, 1)), 1.4, "*"),
}

EDGE = Style("#00796b", (0, (5, 1.5)), 1.2, "s")  # of a domain, and of what belongs to no observer

# Over orders: the readings of the identity form's gain, and the other form.
READINGS = {
    "series": (SERIES, "identity form, series of L"),
    "jacobian": (JACOBIAN, "identity form, (∂S/∂x)⁻¹"),
    "composed": (COMPOSED, "identity form, ∂T/∂z at S(x)"),
}
FORMS = {**READINGS, "transformed": (TRANSFORMED, "transformed form")}

# Observers that the ledger adds take these in turn.
OTHERS = (Style("0.45", "-", 1.1, "x"), Style("0.6", (0, (2, 2)), 1.1, "+"))


def style_of(observer: str, index: int = 0) -> Style:
    """The style of an observer; of one of the ``index``-th place that none is kept for."""
    return OBSERVERS.get(observer, OTHERS[index % len(OTHERS)])

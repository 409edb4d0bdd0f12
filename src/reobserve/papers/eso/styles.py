"""One colour, dash and marker for each kind of design, in all figures."""

from __future__ import annotations

from reobserve.papers.eso import keys
from reobserve.plotting.figures import STYLES, Style

_BLACK, _ORANGE, _BLUE, _, _GREEN = STYLES
_PURPLE = Style("#a66fc0", "-", 0.9, "D")  # whole and light: it has all of the noise

# By the name of a design, and of the rows of the study.
KINDS = {
    "pi_feasible": (_BLACK, "PI, by feasibility"),
    "pd_pi_least_norm": (_ORANGE, "PD/PI, least norm"),
    "pd_pi_least_gamma": (_PURPLE, "PD/PI, least γ"),
    "pi_least_norm": (_BLUE, "PI, least norm"),
    "pi_least_gamma": (_GREEN, "PI, least γ"),
}


def style_of(design: keys.Design) -> Style:
    """The style of an observer, by how its gains came about."""
    return KINDS[design.name][0]
